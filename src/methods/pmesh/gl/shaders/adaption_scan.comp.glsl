// Adaption::scan(): what is needed is marked, what is not may be undone. Sets are emptied.

shared uint is_needed[8];
shared uint count[2], begin[2];  // of those to split, to merge

void main() {
    const uint end = max(vertices, covered);
    if (gl_GlobalInvocationID.x == 0u) all_splits = all_merges = passes = is_woken = is_evaluated = 0u;
    for (uint i = gl_GlobalInvocationID.x; i < 4u * blocks; i += threads())
        work[at_split_blocks + i] = 0u;
    for (uint first = gl_WorkGroupID.x * 256u; first < end; first += threads()) {
        const uint lane = gl_LocalInvocationID.x, v = first + lane;
        if (lane < 8u) is_needed[lane] = 0u;
        if (lane < 2u) count[lane] = 0u;
        barrier();
        bool is_split = false, is_merge = false;
        if (v < vertices) {
            const uvec4 c = criteria[v];
            const ivec3 p = vertex[v].xyz;
            is_split = needs(p, c.xy);
            is_merge = !needsLast(p, c.zw);
        }
        uint place[2];
        if (is_split) {
            atomicOr(is_needed[lane >> 5], 1u << (lane & 31u));
            place[0] = atomicAdd(count[0], 1u);
        }
        if (is_merge) place[1] = atomicAdd(count[1], 1u);
        barrier();
        if (lane == 0u && count[0] != 0u) begin[0] = atomicAdd(fresh[0], count[0]);
        if (lane == 1u && count[1] != 0u) begin[1] = atomicAdd(may_merge, count[1]);
        if (lane < 8u) {
            work[at_marked + (first >> 5) + lane] = is_needed[lane];
            work[at_may_split + (first >> 5) + lane] = 0u;
        }
        barrier();
        if (is_split) work[at_fresh + begin[0] + place[0]] = v;
        if (is_merge) work[at_may_merge + begin[1] + place[1]] = v;
    }
}
