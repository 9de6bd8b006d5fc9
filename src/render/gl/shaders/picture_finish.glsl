// What the finishing shaders share: the drawn samples, SAMPLES of a pixel, and what the depth
// buffer means: FinishBlock of frame_block.h.
layout(std140, binding = 1) uniform Finish {
    float reference;  // depth in input units times what the depth buffer holds; which is 0 where nothing is
    float padding;
    ivec2 size;
};
#if SAMPLES == 1
layout(binding = 1) uniform sampler2D drawn_colour;
layout(binding = 2) uniform sampler2D drawn_depth;
#else
layout(binding = 1) uniform sampler2DMS drawn_colour;
layout(binding = 2) uniform sampler2DMS drawn_depth;
#endif

float depthOf(ivec2 pixel, int s) {
    return texelFetch(drawn_depth, pixel, s).r;
}
float nearestOf(ivec2 pixel) {
    float nearest = depthOf(pixel, 0);
    for (int s = 1; s < SAMPLES; ++s) nearest = max(nearest, depthOf(pixel, s));
    return nearest;
}
