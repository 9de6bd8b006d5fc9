// Between steps, one thread: 0 when a frame begins, 1 and 2 after a round whose queue was 0 or 1,
// 3 after what was dropped, 4 after all rounds.

void main() {
    if (gl_GlobalInvocationID.x != 0u) return;
    if (argument == 0u) {
        splits = merges = dropped = queued[0] = queued[1] = taken = 0u;
    } else if (argument <= 2u) {
        splits += queued[argument - 1u];
        queued[argument - 1u] = 0u;
    } else if (argument == 3u) {
        merges = dropped;
        is_free += dropped;
    } else {
        const uint from_free = min(taken, is_free);
        is_free -= from_free;
        slots += taken - from_free;
        taken = 0u;
    }
}
