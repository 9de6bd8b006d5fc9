// SplitFront::decide()

void main() {
    for (uint slot = gl_GlobalInvocationID.x; slot < slots; slot += threads()) {
        const uint state = get(STATE, slot);
        if ((state & 3u) != ALIVE) continue;
        if (!needs(getCriterion(BIRTH, slot))) {
            put(STATE, slot, state & ~3u | DROPPED);
            list[GONE * capacity + atomicAdd(dropped, 1u)] = slot;
        } else {
            look(slot, get(SPLIT, slot), getCriterion(NEXT, slot), 0u);
        }
    }
}
