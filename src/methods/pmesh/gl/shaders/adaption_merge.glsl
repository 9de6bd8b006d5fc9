// Adaption::applyMerges().

void release(uint w) {
    const uint around = atomicAdd(pulse[w].w, 0u);
    if (around >> 16 != 0u || lastLevel(pulse[w]) == 0u) return;
    if (insert(at_is_released, w)) work[at_released + atomicAdd(released, 1u)] = w;
}

void applyMerges() {
    for (uint i = gl_GlobalInvocationID.x; i < merges; i += threads()) {
        const uint u = work[at_merges + i], v = otherEnd(u);
        Star star = gatherStar(pulse[v].y, 0u), other = gatherStar(pulse[u].y, 1u);
        if (u == v) {
            moveBack(v, star);
            tellFreed(splits + i, kNone, uvec2(kNone));
        } else {
            tellFreed(splits + i, u, merge(v, star, u, other));
        }
        const uint count = neighbours(star), all = count + neighbours(other);
        for (uint j = 0u; j <= all; ++j) {
            const uint w = j == all ? v : j < count ? neighbourOf(star, j) : neighbourOf(other, j - count);
            if (j == all || (w != u && w != v)) release(w);
        }
    }
}
