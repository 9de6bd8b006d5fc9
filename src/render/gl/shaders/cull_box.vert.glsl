// The twelve triangles of each patch's box, by the arithmetic of patch_draw.vert.glsl; of one whose
// turn it is not, nothing.

out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[1];
};
flat out uint slot;

const int kCorner[6] = int[6](0, 1, 2, 2, 1, 3);  // of a face, two bits

void main() {
    CullRecord record = records[gl_InstanceID];
    slot = record.slot;
    if (!isTurn(slot)) {
        gl_Position = vec4(0);
        gl_ClipDistance[0] = -1;
        return;
    }
    int face = gl_VertexID / 6, corner = kCorner[gl_VertexID % 6], axis = face >> 1;
    ivec3 at;
    at[axis] = face & 1;
    at[(axis + 1) % 3] = corner & 1;
    at[(axis + 2) % 3] = corner >> 1;
    vec3 d = vec3(record.corner + at * record.extent);
    float x = dot(d, right.xyz) + right.w;
    float y = dot(d, up.xyz) + up.w;
    float z = dot(d, forward.xyz) + forward.w;
    gl_Position = vec4(x * clip_from_view.x, y * clip_from_view.y, depth_scale, z);
    gl_ClipDistance[0] = z - near_depth;
}
