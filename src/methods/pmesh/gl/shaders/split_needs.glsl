// SplitView::needs() and ResidentSplits::isBlocked(), operation by operation.

struct Criterion {
    uint w[5];
};

Criterion getCriterion(uint column, uint slot) {
    Criterion c;
    for (uint i = 0u; i < 5u; ++i) c.w[i] = get(column + i, slot);
    return c;
}
void putCriterion(uint column, uint slot, Criterion c) {
    for (uint i = 0u; i < 5u; ++i) put(column + i, slot, c.w[i]);
}
/// NestedCriterion, `half_at` half words from a place.
Criterion readCriterion(uint at, uint half_at) {
    Criterion c;
    for (uint i = 0u; i < 5u; ++i) {
        const uint h = half_at + 2u * i;
        const uint low = split_word[at + h / 2u] >> (h % 2u * 16u) & 0xffffu;
        const uint high = split_word[at + (h + 1u) / 2u] >> ((h + 1u) % 2u * 16u) & 0xffffu;
        c.w[i] = low | high << 16;
    }
    c.w[4] &= 0xffu;
    return c;
}

uint low(Criterion c, uint k) { return c.w[k / 2u] >> (k % 2u * 16u) & 0xffffu; }
uint high(Criterion c, uint k) { return low(c, k + 3u); }
uint errorOf(Criterion c) { return c.w[3] & 0xffffu; }
int normalByte(Criterion c, uint k) {
    return int(k == 2u ? c.w[4] : c.w[3] >> (16u + 8u * k));
}
int lowNormal(Criterion c, uint k) { return normalByte(c, k) << 28 >> 28; }
int highNormal(Criterion c, uint k) { return normalByte(c, k) << 24 >> 28; }

Criterion within(Criterion a, Criterion b) {
    Criterion c;
    uint lows[3], highs[3];
    uint normals = 0u;
    for (uint k = 0u; k < 3u; ++k) {
        lows[k] = max(low(a, k), low(b, k));
        highs[k] = min(high(a, k), high(b, k));
        const int n = max(lowNormal(a, k), lowNormal(b, k));
        const int m = min(highNormal(a, k), highNormal(b, k));
        normals |= uint(n & 15 | (m & 15) << 4) << (8u * k);
    }
    c.w[0] = lows[0] | lows[1] << 16;
    c.w[1] = lows[2] | highs[0] << 16;
    c.w[2] = highs[1] | highs[2] << 16;
    c.w[3] = min(errorOf(a), errorOf(b)) | normals << 16;
    c.w[4] = normals >> 16;
    return c;
}

bool shows(Criterion c, float from) {
    precise float squared = 0.0, inside = 0.0;
    for (uint k = 0u; k < 3u; ++k) {
        precise float d = max(max(float(low(c, k)) - eye[k], eye[k] - float(high(c, k))), 0.0);
        squared = squared + d * d;
    }
    for (uint i = 0u; i < 4u; ++i) {
        precise float depth = -side[i].w;
        for (uint k = 0u; k < 3u; ++k)
            depth = depth + float(side[i][k] > 0.0 ? high(c, k) : low(c, k)) * side[i][k];
        inside = min(inside, depth);
    }
    precise float rest = uintBitsToFloat(errorOf(c) << 16) * from + inside * OUTSIDE;
    precise float product = rest * max(rest, 0.0);
    return product > squared;
}

bool facesAway(Criterion c) {
    precise float along = 0.0;
    for (uint k = 0u; k < 3u; ++k) {
        const float near = float(low(c, k)) - eye[k], far = float(high(c, k)) - eye[k];
        const float from = float(lowNormal(c, k)), to = float(highNormal(c, k));
        along = along + min(min(from * near, from * far), min(to * near, to * far));
    }
    return along > 0.0;
}

bool needs(Criterion c) {
    if (!shows(c, eye.w)) return false;
    return hides_backs == 0u || shows(c, eye.w * (1.0 / HIDDEN)) || !facesAway(c);
}

bool isBlocked(Criterion c) {
    for (uint i = 0u; i < 5u * blockings; i += 5u) {
        Criterion b;
        for (uint j = 0u; j < 5u; ++j) b.w[j] = blocking[i + j];
        bool is_within = errorOf(b) >= errorOf(c);
        for (uint k = 0u; k < 3u; ++k)
            is_within = is_within && low(b, k) <= low(c, k) && high(b, k) >= high(c, k);
        if (is_within) return true;
    }
    return false;
}

bool mayOpen(uint split, Criterion c) {
    return split != NONE && node[3u * (split / SLOTS)] != NONE && !isBlocked(c);
}

/// To the queue of the round that comes next, if its next split is to be applied.
void look(uint slot, uint split, Criterion next, uint queue) {
    if (needs(next) && mayOpen(split, next))
        list[(QUEUE + queue) * capacity + atomicAdd(queued[queue], 1u)] = slot;
}
