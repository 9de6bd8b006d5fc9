// Sums over a group of 256, in the order of its threads.

shared uint sums[2][256];

/// The sum of those before this thread; `total`: of all. Called by all of them.
uint sumBefore(uint own, out uint total) {
    const uint lane = gl_LocalInvocationID.x;
    uint from = 0u;
    barrier();
    sums[0][lane] = own;
    for (uint step = 1u; step < 256u; step *= 2u) {
        barrier();
        sums[from ^ 1u][lane] = sums[from][lane] + (lane >= step ? sums[from][lane - step] : 0u);
        from ^= 1u;
    }
    barrier();
    total = sums[from][255];
    return sums[from][lane] - own;
}

/// Of the first `count` of work[at] and on.
uint sumOf(uint at, uint count) {
    uint own = 0u, total;
    for (uint i = gl_LocalInvocationID.x; i < count; i += 256u) own += work[at + i];
    sumBefore(own, total);
    return total;
}
