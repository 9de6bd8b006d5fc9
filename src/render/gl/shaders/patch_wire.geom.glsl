// Gives each triangle its distances to its edges, for lines along them; else what vertices have passes.

layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

in gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[1];
} gl_in[];
out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[1];
};

in vec3 view_normal[];
flat in uvec4 patch_words[];
out vec3 wire_normal;
flat out uvec4 wire_words;
#ifdef HAS_VERTEX_VALUE
in vec3 vertex_value[];
out vec3 wire_value;
#endif
noperspective out vec3 edge_distance;
flat out float least_height;

void main() {
    vec2 image[3];
    bool all_seen = true;
    for (int k = 0; k < 3; ++k) {
        all_seen = all_seen && gl_in[k].gl_ClipDistance[0] > 0.0;
        image[k] = gl_in[k].gl_Position.xy / gl_in[k].gl_Position.w * centre;
    }
    vec2 a = image[1] - image[0], b = image[2] - image[0];
    float area = abs(a.x * b.y - a.y * b.x);
    vec3 height;
    for (int k = 0; k < 3; ++k)
        height[k] = area / max(distance(image[(k + 1) % 3], image[(k + 2) % 3]), 1.0 / 256.0);
    least_height = all_seen ? min(min(height.x, height.y), height.z) : 0.0;
    for (int k = 0; k < 3; ++k) {
        gl_Position = gl_in[k].gl_Position;
        gl_ClipDistance[0] = gl_in[k].gl_ClipDistance[0];
        wire_normal = view_normal[k];
        wire_words = patch_words[0];
#ifdef HAS_VERTEX_VALUE
        wire_value = vertex_value[k];
#endif
        edge_distance = vec3(0.0);
        edge_distance[k] = height[k];
        EmitVertex();
    }
    EndPrimitive();
}
