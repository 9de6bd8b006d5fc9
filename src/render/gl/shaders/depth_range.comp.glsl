// Nearest and farthest of all pixels' nearest depths, for Show::kDepth.
layout(local_size_x = 16, local_size_y = 16) in;

shared uint group_nearest, group_farthest;

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        group_nearest = 0u;
        group_farthest = 0xffffffffu;
    }
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    float nearest = all(lessThan(pixel, size)) ? nearestOf(pixel) : 0.0;
    if (nearest > 0.0) {
        atomicMax(group_nearest, floatBitsToUint(nearest));
        atomicMin(group_farthest, floatBitsToUint(nearest));
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        atomicMax(nearest_bits, group_nearest);
        atomicMin(farthest_bits, group_farthest);
    }
}
