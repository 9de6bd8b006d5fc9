// A vertex of a patch. Positions are integers until the camera's integer part has been subtracted,
// and the operations after that are the CPU renderer's (raster/projection.h), `precise` so that no
// compiler contracts them in one program and not in the other: a vertex has one image, bit for bit,
// in every patch. Drivers round images to 1/256 pixel or finer, as the CPU does.
//
// note: rounding them here would be exacter still, but it must come after clipping: it moves a point
// far away by more than what is near the eye can bear.
//
// Row 0 of the picture is row 0 of the target: y is turned down, so that the fill rule and the places
// of the samples are the CPU's, and no rows are exchanged on the way to a file.

layout(location = 0) in uvec2 packed_position;  // 21 bits an axis, from the patch's corner
layout(location = 1) in ivec2 packed_normal;    // octahedral
layout(location = 2) in vec4 vertex_colour;     // sRGB
layout(location = 3) in float vertex_scalar;

struct Draw {
    ivec3 corner;  // of the patch, less the camera's integer part
    uint flags;
    vec3 colour;  // of the patch, in linear light
    uint id;
};
layout(std430, binding = 0) readonly buffer Draws { Draw draws[]; };

out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[1];
};
out vec3 view_normal;
flat out uvec4 patch_words;  // colour, or the id for TRIANGLE_COLOUR; flags
#ifdef HAS_VERTEX_VALUE
out vec3 vertex_value;  // the colour in linear light, or the scalar's place in its range
#endif

vec3 unitNormal() {
    vec2 p = vec2(packed_normal) / 32767.0;
    float z = 1.0 - abs(p.x) - abs(p.y);
    if (z < 0.0) p = (1.0 - abs(p.yx)) * mix(vec2(1.0), vec2(-1.0), lessThan(p, vec2(0.0)));
    return normalize(vec3(p, z));
}

void main() {
    Draw draw = draws[gl_BaseInstanceARB];
    uvec3 offset = uvec3(packed_position.x & 0x1fffffu,
                         packed_position.x >> 21 | (packed_position.y & 0x3ffu) << 11,
                         packed_position.y >> 10 & 0x1fffffu);
    precise vec3 d = vec3(ivec3(offset) + draw.corner);
    precise float x = d.x * right.x + d.y * right.y + d.z * right.z + right.w;
    precise float y = d.x * up.x + d.y * up.y + d.z * up.z + up.w;
    precise float z = d.x * forward.x + d.y * forward.y + d.z * forward.z + forward.w;

    gl_Position = vec4(x * clip_from_view.x, y * clip_from_view.y, depth_scale, z);
    gl_ClipDistance[0] = z - near_depth;

    vec3 n = unitNormal();
    view_normal = vec3(dot(n, right.xyz), dot(n, up.xyz), -dot(n, forward.xyz));
    patch_words = uvec4(floatBitsToUint(draw.colour), draw.flags);
#if BASE == TRIANGLE_COLOUR
    patch_words.x = draw.id;
#elif BASE == VERTEX_COLOUR
    vertex_value = linearFromSrgb(vertex_colour.rgb);
#elif BASE == SCALAR_COLOUR
    vertex_value = vec3((vertex_scalar - scalar_range.x) * scalar_range.y);
#endif
}
