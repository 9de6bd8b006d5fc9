// What is the same for all of a draw: FrameBlock of frame_block.h.
layout(std140, binding = 0) uniform Frame {
    vec4 right, up, forward;  // axes of the view in lattice space; w: of the lattice origin, in view space
    vec2 clip_from_view;      // what x and y are multiplied by; turns y down
    float depth_scale;        // what the depth buffer holds, times the depth in lattice units
    float inv_focal;          // 1 / pixels
    vec3 light;               // towards the light, in view space, unit length
    int show;                 // the numbers of enum Show
    vec2 centre;              // of the picture, in pixels
    vec2 scalar_range;        // lowest value, 1 / range
    float near_depth;         // in lattice units
};

const int kShaded = 0, kNormals = 1, kDepth = 2, kTriangles = 5, kColour = 7, kScalar = 8;

// Of DrawRecord::flags of frame_block.h.
const uint kBothSides = 1u;
