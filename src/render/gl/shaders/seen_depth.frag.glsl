// The largest depth in each tile of a finished picture: multires/seen_depth.h.
layout(binding = 2) uniform sampler2D picture_depth;
layout(location = 0) out float farthest;

void main() {
    ivec2 first = TILE * ivec2(gl_FragCoord.xy);
    ivec2 end = min(first + TILE, textureSize(picture_depth, 0));
    farthest = 0.0;
    for (int y = first.y; y < end.y; ++y)
        for (int x = first.x; x < end.x; ++x)
            farthest = max(farthest, texelFetch(picture_depth, ivec2(x, y), 0).r);
}
