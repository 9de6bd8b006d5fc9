// SplitFront::applySplit(), for all of a queue; what they bring to the other one.

uint childOf(uint id, uint code) {
    if (code < SLOTS) return id / SLOTS * SLOTS + code;
    if (code == NO_CHILD) return NONE;
    return node[3u * (id / SLOTS) + code / SLOTS] * SLOTS + code % SLOTS;
}

uint takeSlot() {
    const uint n = atomicAdd(taken, 1u);
    return n < is_free ? list[FREE * capacity + is_free - 1u - n] : slots + n - is_free;
}

void main() {
    const uint from = argument, to = 1u - argument;
    for (uint i = gl_GlobalInvocationID.x; i < queued[from]; i += threads()) {
        const uint v = list[(QUEUE + from) * capacity + i], id = get(SPLIT, v);
        const uint place = node[3u * (id / SLOTS)] * SLOTS + id % SLOTS;
        const uint at = place * SPLIT_WORDS;
        const uint name = split_word[at], codes = split_word[at + 1u];
        const uint u = takeSlot();
        const Criterion own = getCriterion(NEXT, v);
        putCriterion(BIRTH, u, own);
        put(FIRST, u, name);
        put(MADE, u, id);
        put(PARENT, u, get(LAST, v));
        put(LAST, v, name);
        put(LAST, u, name);
        for (uint k = 0u; k < 6u; ++k) put(LEAF + k, u, split_word[at + 2u + k]);
        for (uint t = 2u; t < 8u; t += 3u)
            if (split_word[at + t] != split_word[at + t + 1u]) atomicAdd(triangles, 1);
        const uint normals = split_word[at + 14u];
        for (uint k = 0u; k < 4u; ++k) put(MERGED + k, u, get(DRAWN + k, v));
        for (uint k = 0u; k < 3u; ++k) {
            put(DRAWN + k, v, split_word[at + 8u + k]);
            put(DRAWN + k, u, split_word[at + 11u + k]);
        }
        put(DRAWN + 3u, v, normals & 0xffffu);
        put(DRAWN + 3u, u, normals >> 16);
        const uint at_words = at_split_words + place * 2u * words;
        for (uint k = 0u; k < words; ++k) {
            put(WORDS + words + k, u, get(WORDS + k, v));
            put(WORDS + k, v, split_word[at_words + k]);
            put(WORDS + k, u, split_word[at_words + words + k]);
        }
        put(STATE, u, ALIVE | ((codes & CLOSED) != 0u ? IS_CLOSED : 0u));
        atomicOr(leaf_word[name / 32u], 1u << name % 32u);
        const uint child_v = childOf(id, codes & 0x7fffu), child_u = childOf(id, codes >> 16);
        const Criterion next_v = within(own, readCriterion(at, 30u));
        const Criterion next_u = within(own, readCriterion(at, 39u));
        put(SPLIT, v, child_v);
        put(SPLIT, u, child_u);
        putCriterion(NEXT, v, next_v);
        putCriterion(NEXT, u, next_u);
        look(v, child_v, next_v, to);
        look(u, child_u, next_u, to);
    }
}
