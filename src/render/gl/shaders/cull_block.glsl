// What the shaders of occlusion culling share: CullRecord and what is around it, see occlusion.h.
struct CullRecord {
    ivec3 corner;
    uint slot;
    ivec3 extent;
    uint always;
};
layout(std430, binding = 1) readonly buffer CullRecords { CullRecord records[]; };
// In sight in the picture before, and in this one so far.
layout(std430, binding = 5) buffer Last { uint last[]; };
layout(std430, binding = 6) buffer Now { uint now[]; };

// Which of those in sight are looked at in this picture: the others stay in sight.
layout(location = 0) uniform uint turn;
layout(location = 1) uniform uint turns;
bool isTurn(uint slot) {
    return last[slot] == 0u || (slot + turn) % turns == 0u;
}
