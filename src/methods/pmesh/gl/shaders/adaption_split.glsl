// Adaption::placeSplits() and applySplits().

uint vertexPlace(uint i) {
    if (i >= free_vertices) return vertices + i - free_vertices;
    return work[at_free_vertices + ((free_vertex_head + i) & vertex_mask)];
}
uint facePlace(uint i) {
    if (i >= free_faces) return faces + i - free_faces;
    return work[at_free_faces + ((free_face_head + i) & face_mask)];
}

/// `at`: marked neighbours of the one that has split, at its end v. Those that still wait for it
/// mark it.
void wakeAround(Star star, uint v, uint at) {
    const uint next = (pass + 1u) & 1u, level = nextLevel(pulse[v]);
    bool is_forced = false;
    for (; at != 0u; at &= at - 1u) {
        const uint w = neighbourOf(star, findLSB(at));
        if ((atomicAdd(pulse[w].w, 0u) & 0xffffu) == 0u) {
            maySplit(w, next);
            is_woken = 1u;
        }
        is_forced = is_forced || level < nextLevel(pulse[w]);
    }
    if (is_forced || needs(vertex[v].xyz, criteria[v].xy)) mark(v, 0u);
}

void applySplits() {
    for (uint i = gl_GlobalInvocationID.x; i < splits; i += threads()) {
        const uint v = work[at_splits + i], u = vertexPlace(i);
        const uvec2 faces = uvec2(facePlace(2u * i), facePlace(2u * i + 1u));
        const uvec4 o = operation[2u * record[v].x];
        Star star = gatherStar(pulse[v].y, 0u);
        erase(at_marked, v);
        uint marked = 0u;
        for (uint j = 0u; j < neighbours(star); ++j)
            marked |= uint(has(at_marked, neighbourOf(star, j))) << j;
        uint ends = 2u;
        uvec2 at = uvec2(marked, 0u);
        if (isDummy(o)) {
            move(v, star);
            tellFreed(i, u, faces);
            ends = 1u;
        } else {
            star.first = firstOf(star);
            at = split(v, star, u, faces) & marked;
            const bool has_both = rankLeft(o) != kNoRank && rankRight(o) != kNoRank;
            tellFreed(i, kNone, uvec2(kNone, has_both ? kNone : faces.y));
        }
        for (uint end = 0u; end < ends; ++end)
            wakeAround(star, end == 0u ? v : u, end == 0u ? at.x : at.y);
    }
}
