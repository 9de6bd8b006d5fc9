// A frame's end: Adaption::tidy(), ActiveMesh::fillHoles(). The steps, by ARGUMENT:
//   0  free places of the last pass are collected
//   1  (one group) it is entered in the books; what stays is counted
//   2  those released are looked at; free places beyond what stays are noted, those below counted
//   3  both are listed: the elements beyond that stay, in order, and the places below
//   4  faces move
//   5  vertices move, and the books are closed

uint freeVertex(uint i) {
    return work[at_free_vertices + ((free_vertex_head + i) & vertex_mask)];
}
uint freeFace(uint i) {
    return work[at_free_faces + ((free_face_head + i) & face_mask)];
}

void enter() {
    commit();
    covered = vertices;
    kept_vertices = vertices - free_vertices;
    kept_faces = faces - free_faces;
    to_vertices = to_faces = 0u;
}

void unblock(uint u) {
    erase(at_is_released, u);
    if (!isNewEnd(pulse[u], record[u])) u = otherEnd(u);
    if (canUndo(pulse[u], record[u])) criteria[u].z &= ~kBlocked;
}

/// side: 0 for vertices, 1 for faces.
void note(uint place, uint kept, uint i, uint side) {
    if (place >= kept) {
        const uint at = place - kept;
        atomicOr(work[at_gone + side * (face_capacity / 32u) + (at >> 5)], 1u << (at & 31u));
        atomicAdd(work[at_gone_blocks + side * gone_blocks + at / kBlockBits], 1u);
    } else {
        atomicAdd(work[at_hole_blocks + side * hole_blocks + i / kResults], 1u);
    }
}

void listHoles(uint block, uint count, uint kept, uint side) {
    const uint i = block * kResults + gl_LocalInvocationID.x;
    const uint place = i < count ? (side == 0u ? freeVertex(i) : freeFace(i)) : kNone;
    uint total;
    const uint begin = sumOf(at_hole_blocks + side * hole_blocks, block);
    const uint at = begin + sumBefore(uint(place < kept), total);
    if (place < kept) work[at_to + side * face_capacity + at] = place;
    if ((block + 1u) * kResults < count || gl_LocalInvocationID.x != 0u) return;
    if (side == 0u) to_vertices = begin + total;
    if (side == 1u) to_faces = begin + total;
}

/// Of those beyond: the ones that stay.
void listStaying(uint block, uint count, uint kept, uint side) {
    const uint gone_before = sumOf(at_gone_blocks + side * gone_blocks, block);
    const uint w = block * kBlockWords + gl_LocalInvocationID.x;
    uint bits = 0u, total;
    if (32u * w < count) {
        const uint at = at_gone + side * (face_capacity / 32u) + w;
        bits = ~work[at];
        work[at] = 0u;
        if (count - 32u * w < 32u) bits &= (1u << (count - 32u * w)) - 1u;
    }
    uint place = at_from + side * face_capacity + block * kBlockBits - gone_before +
                 sumBefore(uint(bitCount(bits)), total);
    const uint begin = at_from + side * face_capacity;
    for (; bits != 0u; bits &= bits - 1u) {
        const uint at = 32u * w + uint(findLSB(bits));
        if (side == 1u) work[at_rank + at] = place - begin;
        work[place++] = kept + at;
    }
}

void list(uint count, uint kept, uint side) {
    const uint holes = (count + kResults - 1u) / kResults;
    const uint tails = (count + kBlockBits - 1u) / kBlockBits;
    for (uint b = gl_WorkGroupID.x; b < holes; b += gl_NumWorkGroups.x)
        listHoles(b, count, kept, side);
    for (uint b = gl_WorkGroupID.x; b < tails; b += gl_NumWorkGroups.x)
        listStaying(b, count, kept, side);
}

void moveFace(uint from, uint to) {
    face[8u * to + 7u] = face[8u * from + 7u];
    for (uint k = 0u; k < 3u; ++k) {
        const uint old_corner = 4u * from + k, new_corner = 4u * to + k;
        const uint v = vertexAt(old_corner), t = twinOf(old_corner);
        setVertexAt(new_corner, v);
        if (pulse[v].y == old_corner) pulse[v].y = new_corner;
        if (t == kNone || t >> 2 < kept_faces) {
            link(new_corner, t);
        } else {
            setTwin(new_corner, 4u * work[at_to + face_capacity + work[at_rank + (t >> 2) - kept_faces]] + (t & 3u));
        }
    }
}

void moveVertex(uint from, uint to) {
    vertex[to] = vertex[from];
    record[to] = record[from];
    pulse[to] = pulse[from];
    criteria[to] = criteria[from];
    const uint first = pulse[to].y;
    for (uint c = first; c != kNone;) {
        setVertexAt(c, to);
        c = leftOf(c);
        if (c == first) break;
    }
}

void clearBlocks() {
    for (uint i = gl_GlobalInvocationID.x; i < 2u * gone_blocks; i += threads())
        work[at_gone_blocks + i] = 0u;
    for (uint i = gl_GlobalInvocationID.x; i < 2u * hole_blocks; i += threads())
        work[at_hole_blocks + i] = 0u;
}

void close() {
    vertices = kept_vertices;
    faces = kept_faces;
    free_vertices = free_faces = free_vertex_head = free_face_head = 0u;
    may_merge = released = fresh[0] = 0u;
    for (int k = 0; k < 3; ++k) {
        box[k] = 0x7fffffff;
        box[3 + k] = -0x7fffffff;
    }
}

void main() {
    const uint first = gl_GlobalInvocationID.x;
    if (argument == 0u) appendFree();
    if (argument == 1u && first == 0u) enter();
    if (argument == 2u) {
        for (uint i = first; i < released; i += threads()) unblock(work[at_released + i]);
        for (uint i = first; i < free_vertices; i += threads())
            note(freeVertex(i), kept_vertices, i, 0u);
        for (uint i = first; i < free_faces; i += threads()) note(freeFace(i), kept_faces, i, 1u);
    }
    if (argument == 3u) {
        list(free_vertices, kept_vertices, 0u);
        list(free_faces, kept_faces, 1u);
    }
    if (argument == 4u) {
        for (uint i = first; i < to_faces; i += threads())
            moveFace(work[at_from + face_capacity + i], work[at_to + face_capacity + i]);
        clearBlocks();
    }
    if (argument == 5u) {
        for (uint i = first; i < to_vertices; i += threads())
            moveVertex(work[at_from + i], work[at_to + i]);
        if (first == 0u) close();
    }
}
