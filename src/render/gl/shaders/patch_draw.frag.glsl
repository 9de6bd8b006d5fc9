// A pixel of a patch: the light of raster/shade_kernel.cpp, whose constants come from shading.h as
// macros. The result is in linear light; the target turns it to sRGB.
//
// Each view has a program of its own: llvmpipe computes what a branch leaves out, too.

#ifdef WIRE
noperspective in vec3 edge_distance;  // in pixels
flat in float least_height;
#define view_normal wire_normal
#define patch_words wire_words
#define vertex_value wire_value
#endif
in vec3 view_normal;
flat in uvec4 patch_words;
#ifdef HAS_VERTEX_VALUE
in vec3 vertex_value;
#endif

layout(location = 0) out vec4 colour;

// Attributes are those of the pixel's centre or, where it is outside the triangle, of about the
// nearest point inside: on the way to the covered samples. With three samples covered, or two
// opposite ones, the centre is inside; with one, or two neighbours, the triangle's edge may lie
// anywhere between.
#if SAMPLES == 1
#define AT_PLACE(value) value
#else
#define AT_PLACE(value) interpolateAtOffset(value, place_offset)
vec2 place_offset;
void findPlace() {
    const vec2 kSample[4] =
        vec2[4](vec2(-0.125, -0.375), vec2(0.375, -0.125), vec2(-0.375, 0.125), vec2(0.125, 0.375));
    vec2 sum = vec2(0.0);
    for (int s = 0; s < 4; ++s)
        if ((gl_SampleMaskIn[0] >> s & 1) != 0) sum += kSample[s];
    int count = bitCount(gl_SampleMaskIn[0] & 15);
    place_offset = sum * (count == 1 ? 0.5 : count == 2 ? 0.2 : 0.0);
}
#endif

#if BASE == PATCH_COLOUR
vec3 baseColour() {
    return uintBitsToFloat(patch_words.xyz);
}
#elif BASE == VERTEX_COLOUR
vec3 baseColour() {
    // The patch's colour is that of its tint; it does not matter where there is no light.
    vec3 colour_there = max(AT_PLACE(vertex_value), 0.0);
    return LIGHT == LIT ? uintBitsToFloat(patch_words.xyz) * colour_there : colour_there;
}
#elif BASE == SCALAR_COLOUR
layout(binding = 0) uniform sampler1D scalar_colours;
vec3 baseColour() {
    int last = textureSize(scalar_colours, 0) - 1;
    float t = clamp(AT_PLACE(vertex_value).x, 0.0, 1.0);
    return textureLod(scalar_colours, (t * last + 0.5) / (last + 1), 0.0).rgb;
}
#else
// The low 64 bits of a product; x is the low word.
uvec2 times(uvec2 a, uvec2 b) {
    uint high, low;
    umulExtended(a.x, b.x, high, low);
    return uvec2(low, high + a.x * b.y + a.y * b.x);
}
uvec2 foldedBy(uvec2 a, int bits) {
    return a ^ uvec2(a.x >> bits | a.y << (32 - bits), a.y >> bits);
}

// hashColour() of shading.cpp.
vec3 hashColour(uint patch_id, uint triangle) {
    uint carry;
    uvec2 bits = uvec2(uaddCarry(triangle, 0x7f4a7c15u, carry), 0u);
    bits.y = patch_id + 0x9e3779b9u + carry;
    bits = times(foldedBy(bits, 30), uvec2(0x1ce4e5b9u, 0xbf58476du));
    bits = times(foldedBy(bits, 27), uvec2(0x133111ebu, 0x94d049bbu));
    bits = foldedBy(bits, 31);
    float hue = float(bits.x & 0xffffu) / 65536.0;
    float saturation = 0.35 + 0.4 * float(bits.x >> 16 & 0xffu) / 255.0;
    float value = 0.75 + 0.25 * float(bits.x >> 24) / 255.0;
    vec3 ramp = clamp(abs(fract(hue + vec3(0.0, 2.0, 1.0) / 3.0) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
    return linearFromSrgb(value * (1.0 - saturation * (1.0 - ramp)));
}
vec3 baseColour() {
    return hashColour(patch_words.x, uint(gl_PrimitiveID));
}
#endif

vec3 lit(vec3 n, vec3 eye, vec3 base) {
    float key = max(dot(n, light), 0.0);
    float sky = 0.5 + 0.5 * n.y;
    float shine = key > 0.0 ? max(dot(n, normalize(eye + light)), 0.0) : 0.0;
    for (int k = 0; k < 5; ++k) shine *= shine;
    vec3 received = max(dot(n, eye), 0.0) * EYE_LIGHT + key * KEY_LIGHT + sky * SKY_LIGHT +
                    (1.0 - sky) * GROUND_LIGHT;
    return received * base + shine * SHINE;
}

vec3 unitOrZero(vec3 v) {
    float square = dot(v, v);
    return v * (square > 0.0 ? inversesqrt(square) : 0.0);
}

void main() {
#if SAMPLES > 1
    findPlace();
#endif
#if LIGHT == UNLIT
    colour = vec4(baseColour(), 1.0);
#else
    // Towards the eye, from the pixel's centre whichever samples are covered.
    vec2 place = floor(gl_FragCoord.xy) + 0.5 - centre;
    vec3 eye = normalize(vec3(vec2(-place.x, place.y) * inv_focal, 1.0));
    vec3 n = unitOrZero(AT_PLACE(view_normal));
    // Near a silhouette normals point away from faces that are seen: only a normal that is clearly
    // wrong is turned round on a front.
    float limit = gl_FrontFacing ? -0.25 : 0.0;
    if ((patch_words.w & kBothSides) != 0u && dot(n, eye) < limit) n = -n;
#if LIGHT == NORMALS
    colour = vec4(linearFromSrgb(n * 0.5 + 0.5), 1.0);
#else
    vec3 base = baseColour();
#ifdef WIRE
    // wireShade() of shading.h.
    float nearest = min(min(edge_distance.x, edge_distance.y), edge_distance.z);
    float line = clamp(WIRE_REACH - abs(nearest), 0.0, 1.0);
    float visible = clamp((least_height - WIRE_LEAST_HEIGHT) / WIRE_FADE, 0.0, 1.0);
    base *= 1.0 - WIRE_DARKNESS * line * visible;
#endif
    colour = vec4(lit(n, eye, base), 1.0);
#endif
#endif
}
