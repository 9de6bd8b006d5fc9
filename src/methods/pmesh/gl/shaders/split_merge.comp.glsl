// SplitFront::merge(): of all splits undone next to each other, the one above the others tells what
// v is.

bool isAlive(uint slot) { return (get(STATE, slot) & 3u) == ALIVE; }

/// It was active when the frame began: is it still?
bool isStill(uint name) {
    const uint slot = list[countUpTo(name) - 1u];
    return get(FIRST, slot) == name && isAlive(slot);
}

/// The last one before, in the order of leaves.
uint aliveBefore(uint leaf) {
    uint rank = countUpTo(leaf) - 2u;
    while (!isAlive(list[rank])) --rank;
    return list[rank];
}

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < dropped; i += threads()) {
        const uint u = list[GONE * capacity + i], parent = get(PARENT, u);
        for (uint t = 0u; t < 6u; t += 3u)
            if (get(LEAF + t, u) != get(LEAF + t + 1u, u)) atomicAdd(triangles, -1);
        if (parent == NONE || isStill(parent)) {
            const uint v = aliveBefore(get(FIRST, u));
            put(SPLIT, v, get(MADE, u));
            put(LAST, v, parent);
            for (uint k = 0u; k < 5u; ++k) put(NEXT + k, v, get(BIRTH + k, u));
            for (uint k = 0u; k < 4u; ++k) put(DRAWN + k, v, get(MERGED + k, u));
            for (uint k = 0u; k < words; ++k) put(WORDS + k, v, get(WORDS + words + k, u));
        }
    }
}
