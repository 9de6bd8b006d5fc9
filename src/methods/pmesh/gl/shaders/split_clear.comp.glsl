// Slots of what was dropped are free, and their leaves begin no vertex.

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < dropped; i += threads()) {
        const uint slot = list[GONE * capacity + i], first = get(FIRST, slot);
        atomicAnd(leaf_word[first / 32u], ~(1u << first % 32u));
        put(STATE, slot, DEAD);
        list[FREE * capacity + is_free + i] = slot;
    }
}
