// What a pass has taken from the free places, added and left free.

void commit() {
    const uint used = min(splits, free_vertices), used_faces = min(2u * splits, free_faces);
    vertices += splits - used;
    faces += 2u * splits - used_faces;
    free_vertex_head = (free_vertex_head + used) & vertex_mask;
    free_face_head = (free_face_head + used_faces) & face_mask;
    free_vertices += freed_vertices - used;
    free_faces += freed_faces - used_faces;
    all_splits += splits;
    all_merges += merges;
    passes += uint(splits + merges != 0u);
    splits = merges = freed_vertices = freed_faces = 0u;
}
