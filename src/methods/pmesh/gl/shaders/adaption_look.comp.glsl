// What a pass begins with: what the one before has left free; the first round of forced marks; or,
// where none is fresh or woken, so that nothing will split, what may be undone. Counts of the pass
// before are set back.

/// What follows from nothing being fresh needs that all is loaded.
bool nothingSplits() {
    return fresh[0] == 0u && is_woken == 0u;
}

void main() {
    appendFree();
    const uint other = ((pass + 1u) & 1u) * blocks;
    for (uint i = gl_GlobalInvocationID.x; i < blocks; i += threads())
        work[at_split_blocks + other + i] = work[at_merge_blocks + other + i] = 0u;
    if (nothingSplits()) {
        findMerges();
    } else {
        for (uint i = gl_GlobalInvocationID.x; i < fresh[0]; i += threads())
            force(work[at_fresh + i], 1u);
    }
}
