// The picture from its samples, as raster/finish_picture.cpp makes it: the mean of a pixel's
// samples in linear light, empty ones with the background, and the depth of the nearest.

layout(binding = 3) uniform sampler2D background;  // four columns
#ifdef SHOW_DEPTH
layout(binding = 4) uniform sampler2D depth_range;  // of the last step of depth_range.frag.glsl
#endif

layout(location = 0) out vec4 colour;
layout(location = 1) out float depth;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 behind = texelFetch(background, ivec2(pixel.x & 3, pixel.y), 0).rgb;
    float nearest = nearestOf(pixel);
    depth = nearest > 0.0 ? reference / nearest : uintBitsToFloat(0x7f800000u);
    vec3 sum = vec3(0.0);
    for (int s = 0; s < SAMPLES; ++s)
        sum += depthOf(pixel, s) > 0.0 ? texelFetch(drawn_colour, pixel, s).rgb : behind;
    colour = vec4(sum / float(SAMPLES), 1.0);
#ifdef SHOW_DEPTH
    if (nearest > 0.0) {
        vec2 range = texelFetch(depth_range, ivec2(0), 0).rg;
        float first = reference / range.x, last = reference / range.y;
        float scale = last > first ? 0.9 / (last - first) : 0.0;
        colour.rgb = linearFromSrgb(vec3(1.0 - (depth - first) * scale));
    }
#endif
}
