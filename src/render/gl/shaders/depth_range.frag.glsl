// One step of finding the nearest and the farthest depth of the picture, for Show::kDepth: a texel
// for each 16 x 16 of the step before, or, in the FIRST step, of the drawn pixels. The largest and
// the smallest value of the depth buffer; 0 and 1 where there are none.
//
// note: not by a compute shader, for which llvmpipe (Mesa 22) does not wait until all is drawn.

#ifndef FIRST
layout(binding = 4) uniform sampler2D step_before;
#endif

layout(location = 0) out vec2 range;

vec2 rangeAt(ivec2 place) {
#ifdef FIRST
    float nearest = nearestOf(place);
    return vec2(nearest, nearest > 0.0 ? nearest : 1.0);
#else
    return texelFetch(step_before, place, 0).rg;
#endif
}

void main() {
#ifdef FIRST
    ivec2 end = size;
#else
    ivec2 end = textureSize(step_before, 0);
#endif
    ivec2 first = ivec2(gl_FragCoord.xy) * 16, last = min(first + 16, end);
    range = vec2(0.0, 1.0);
    for (int y = first.y; y < last.y; ++y)
        for (int x = first.x; x < last.x; ++x) {
            vec2 r = rangeAt(ivec2(x, y));
            range = vec2(max(range.x, r.x), min(range.y, r.y));
        }
}
