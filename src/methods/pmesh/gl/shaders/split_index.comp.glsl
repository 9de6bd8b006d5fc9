// Which vertex a leaf hangs below: bits counted, in three steps, then slots in the order of leaves.

const uint PART = 1024u;  // words that a group counts
shared uint sums[64];

/// Of the threads before, in a group.
uint sumBefore(uint own) {
    const uint lane = gl_LocalInvocationID.x;
    sums[lane] = own;
    for (uint step = 1u; step < 64u; step *= 2u) {
        barrier();
        const uint more = lane >= step ? sums[lane - step] : 0u;
        barrier();
        sums[lane] += more;
    }
    barrier();
    return sums[lane] - own;
}

/// Of one part: in each word how many are before it in the part; all of them behind the index.
void countPart(uint part) {
    const uint each = PART / 64u, begin = part * PART + gl_LocalInvocationID.x * each;
    const uint end = min(begin + each, leaf_words);
    uint own = 0u;
    for (uint w = begin; w < end; ++w) own += uint(bitCount(leaf_word[w]));
    uint before = sumBefore(own);
    if (gl_LocalInvocationID.x == 63u) leaf_word[2u * leaf_words + part] = before + own;
    for (uint w = begin; w < end; ++w) {
        leaf_word[leaf_words + w] = before;
        before += uint(bitCount(leaf_word[w]));
    }
    barrier();
}

/// Of all parts, by one group.
void countAll(uint parts) {
    const uint each = (parts + 63u) / 64u, begin = min(gl_LocalInvocationID.x * each, parts);
    const uint end = min(begin + each, parts), at = 2u * leaf_words;
    uint own = 0u;
    for (uint p = begin; p < end; ++p) own += leaf_word[at + p];
    uint before = sumBefore(own);
    for (uint p = begin; p < end; ++p) {
        const uint count = leaf_word[at + p];
        leaf_word[at + p] = before;
        before += count;
    }
}

void main() {
    if (splits + merges == 0u) return;
    const uint parts = (leaf_words + PART - 1u) / PART;
    if (argument == 0u) {
        for (uint p = gl_WorkGroupID.x; p < parts; p += gl_NumWorkGroups.x) countPart(p);
    } else if (argument == 1u) {
        if (gl_WorkGroupID.x == 0u) countAll(parts);
    } else if (argument == 2u) {
        for (uint w = gl_GlobalInvocationID.x; w < leaf_words; w += threads())
            leaf_word[leaf_words + w] += leaf_word[2u * leaf_words + w / PART];
    } else {
        for (uint slot = gl_GlobalInvocationID.x; slot < slots; slot += threads())
            if ((get(STATE, slot) & 3u) == ALIVE)
                list[ORDER * capacity + countUpTo(get(FIRST, slot)) - 1u] = slot;
    }
}
