// SplitFront::arrived(): so many, seven words each behind what is blocking: first leaf, split, what
// it states.

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < argument; i += threads()) {
        const uint at = 7u * i;
        const uint slot = list[countUpTo(blocking[at]) - 1u];
        if (get(FIRST, slot) != blocking[at] || get(SPLIT, slot) != blocking[at + 1u]) continue;
        Criterion c;
        for (uint k = 0u; k < 5u; ++k) c.w[k] = blocking[at + 2u + k];
        putCriterion(NEXT, slot, within(getCriterion(NEXT, slot), c));
    }
}
