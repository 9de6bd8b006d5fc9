// Free places go to the ends of their rings, in the order of the operations: a group takes a block
// of results.

void append(uint block, uint blocks_used) {
    const uint i = block * kResults + gl_LocalInvocationID.x, at = at_result + 3u * i;
    uvec3 free = uvec3(kNone);
    if (i < splits + merges) free = uvec3(work[at], work[at + 1u], work[at + 2u]);
    uint count, total;
    uint begin = sumOf(at_result_vertices, block);
    uint place = begin + sumBefore(uint(free.x != kNone), total);
    count = begin + total;
    if (free.x != kNone)
        work[at_free_vertices + ((free_vertex_head + free_vertices + place) & vertex_mask)] = free.x;
    begin = sumOf(at_result_faces, block);
    place = begin + sumBefore(uint(free.y != kNone) + uint(free.z != kNone), total);
    for (uint k = 1u; k < 3u; ++k)
        if (free[k] != kNone)
            work[at_free_faces + ((free_face_head + free_faces + place++) & face_mask)] = free[k];
    if (block + 1u == blocks_used && gl_LocalInvocationID.x == 0u) {
        freed_vertices = count;
        freed_faces = begin + total;
    }
}

void appendFree() {
    const uint used = (splits + merges + kResults - 1u) / kResults;
    for (uint b = gl_WorkGroupID.x; b < used; b += gl_NumWorkGroups.x) append(b, used);
}
