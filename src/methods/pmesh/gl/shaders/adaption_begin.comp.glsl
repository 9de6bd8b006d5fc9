// One group: the pass before is entered in the books; what rounds have left is forced until nothing
// is; splits are counted.

shared uint sum;

void main() {
    const uint lane = gl_LocalInvocationID.x;
    const bool nothing_splits = fresh[0] == 0u && is_woken == 0u;
    for (uint round = 1u;; round ^= 1u) {
        barrier();
        const uint count = fresh[round];
        if (lane == 0u) fresh[round ^ 1u] = 0u;
        memoryBarrierBuffer();
        barrier();
        if (count == 0u) break;
        for (uint i = lane; i < count; i += 1024u)
            force(work[at_fresh + (round & 1u) * capacity + i], round ^ 1u);
        memoryBarrierBuffer();
    }
    if (lane == 0u) sum = 0u;
    memoryBarrierBuffer();
    barrier();
    uint own = 0u;
    for (uint i = lane; i < blocks; i += 1024u)
        own += work[at_split_blocks + (pass & 1u) * blocks + i];
    if (own != 0u) atomicAdd(sum, own);
    barrier();
    if (lane != 0u) return;
    commit();
    fresh[0] = fresh[1] = 0u;
    splits = sum;
    is_woken = 0u;
    is_evaluated = uint(nothing_splits);
}
