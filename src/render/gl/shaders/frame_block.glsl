// What is the same for all of a draw: FrameBlock of frame_block.h.
layout(std140, binding = 0) uniform Frame {
    vec4 right, up, forward;  // axes of the view in lattice space; w: of the lattice origin, in view space
    vec2 clip_from_view;      // what x and y are multiplied by; turns y down
    float depth_scale;        // what the depth buffer holds, times the depth in lattice units
    float inv_focal;          // 1 / pixels
    vec3 light;               // towards the light, in view space, unit length
    float near_depth;         // in lattice units
    vec2 centre;              // of the picture, in pixels
    vec2 scalar_range;        // lowest value, 1 / range
};

// What programs are made for: see Look of draw_programs.h.
#define PATCH_COLOUR 0
#define VERTEX_COLOUR 1
#define TRIANGLE_COLOUR 2
#define SCALAR_COLOUR 3
#define UNLIT 0
#define LIT 1
#define NORMALS 2
#if BASE == VERTEX_COLOUR || BASE == SCALAR_COLOUR
#define HAS_VERTEX_VALUE
#endif

// Of DrawRecord::flags of frame_block.h.
const uint kBothSides = 1u;
