// Adaption::findSplits() of one that is fresh: marks those that must split before, for the next
// round; where there are none, it may split.

void force(uint v, uint next_round) {
    const uvec4 p = pulse[v];
    if (lower(p) == 0u) {
        maySplit(v, pass & 1u);
        return;
    }
    const uint level = nextLevel(p);
    for (uint c = p.y;;) {
        const uint place = placeOf(c), w = face[place + 1u], left = face[place + 4u];
        if (nextLevel(pulse[w]) < level) mark(w, next_round);
        if (left == kNone) {
            const uint last = vertexAt(previousCorner(c));
            if (nextLevel(pulse[last]) < level) mark(last, next_round);
        }
        if (left == kNone || left == p.y) return;
        c = left;
    }
}
