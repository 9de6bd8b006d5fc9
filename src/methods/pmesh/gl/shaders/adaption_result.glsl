// What an operation leaves free: the vertex and two faces, or kNone.

void tellFreed(uint i, uint u, uvec2 faces) {
    const uint at = at_result + 3u * i;
    work[at] = u;
    work[at + 1u] = faces.x;
    work[at + 2u] = faces.y;
    if (u != kNone) atomicAdd(work[at_result_vertices + i / kResults], 1u);
    const uint freed = uint(faces.x != kNone) + uint(faces.y != kNone);
    if (freed != 0u) atomicAdd(work[at_result_faces + i / kResults], freed);
}
