// Empties the sets of what may split and of what is to merge into lists, in the order of the
// vertices: a group takes a block of a set, a thread 32 vertices. ARGUMENT: 1 for the last pass.

void take(uint at, uint at_blocks, uint block, uint at_list) {
    if (work[at_blocks + block] == 0u) return;
    const uint begin = sumOf(at_blocks, block);
    const uint w = block * kBlockWords + gl_LocalInvocationID.x;
    uint bits = work[at + w], total;
    work[at + w] = 0u;
    uint place = at_list + begin + sumBefore(uint(bitCount(bits)), total);
    for (; bits != 0u; bits &= bits - 1u) work[place++] = 32u * w + uint(findLSB(bits));
}

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < result_blocks; i += threads())
        work[at_result_vertices + i] = work[at_result_faces + i] = 0u;
    const uint used = (vertices + kBlockBits - 1u) / kBlockBits;
    if (splits != 0u)
        for (uint b = gl_WorkGroupID.x; b < used; b += gl_NumWorkGroups.x)
            take(at_may_split, at_split_blocks + (pass & 1u) * blocks, b, at_splits);
    if (is_evaluated == 0u && argument == 0u) return;
    for (uint b = gl_WorkGroupID.x; b < used; b += gl_NumWorkGroups.x)
        take(at_to_merge, at_merge_blocks + (pass & 1u) * blocks, b, at_merges);
    if (gl_WorkGroupID.x != 0u) return;
    const uint total = sumOf(at_merge_blocks + (pass & 1u) * blocks, blocks);
    if (gl_LocalInvocationID.x == 0u) {
        merges = total;
        may_merge = released = 0u;
    }
}
