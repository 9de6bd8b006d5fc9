#pragma once
// The structs that shaders read, as they lie in buffers (std140 and std430):
// shaders/frame_block.glsl, patch_draw.vert.glsl and picture_finish.glsl say the same.

#include <cstdint>

#include "geometry/vec.h"

namespace pietra {

/// Binding points.
inline constexpr uint32_t kFrameBinding = 0, kFinishBinding = 1;  // uniform blocks
inline constexpr uint32_t kDrawsBinding = 0, kCullBinding = 1, kCommandsBinding = 2,
                          kSeenBinding = 3, kFoundBinding = 4, kLastBinding = 5,
                          kNowBinding = 6;  // storage blocks
inline constexpr uint32_t kScalarColoursUnit = 0, kColourUnit = 1, kDepthUnit = 2,
                          kBackgroundUnit = 3, kRangeUnit = 4;

struct FrameBlock {
    glm::vec4 right, up, forward;
    glm::vec2 clip_from_view;
    float depth_scale, inv_focal;
    Vec3f light;
    float near_depth;
    glm::vec2 centre, scalar_range;
};
static_assert(sizeof(FrameBlock) == 96);

struct DrawRecord {
    static constexpr uint32_t kBothSides = 1;
    Vec3i corner;
    uint32_t flags;
    Vec3f colour;
    uint32_t id;
};
static_assert(sizeof(DrawRecord) == 32);

/// OpenGL's own, of glMultiDrawElementsIndirect().
struct DrawCommand {
    uint32_t indices, instances, first_index;
    int32_t base_vertex;
    uint32_t base_instance;
};
static_assert(sizeof(DrawCommand) == 20);

struct FinishBlock {
    float reference;
    float padding;
    int32_t width, height;
};
static_assert(sizeof(FinishBlock) == 16);

}  // namespace pietra
