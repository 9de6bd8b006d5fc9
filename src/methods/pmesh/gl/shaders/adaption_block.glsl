// The adaption's memory on the GPU (adaption.h has what it does). Vertices and faces lie as in
// ActiveMesh, operations as GlAdaption packs them. Counts are kept here, so that a frame needs no
// answer from the GPU: each step takes as many groups as fill it, which share the elements that
// there are.

layout(local_size_x = GROUP) in;

const uint kNone = 0xffffffffu;
const uint kLeafLevel = 1023u;
const uint kNoRank = 15u;
const uint kDummyRanks = 0xffu;
const uint kEverNeeded = 0x7fffu, kBlocked = 0x8000u;

layout(std430, binding = 0) buffer Vertices { ivec4 vertex[]; };  // position, normal
layout(std430, binding = 1) buffer Pulses { uvec4 pulse[]; };     // name, corner, levels, around
layout(std430, binding = 2) buffer Criteria { uvec4 criteria[]; };  // two each: next split, last
layout(std430, binding = 3) buffer Records { uvec4 record[]; };     // next, last, undo_*
layout(std430, binding = 4) buffer Faces { uint face[]; };          // ActiveFace: eight each
/// Two each: children, level | radius << 16, error | ranks << 8 | shift << 16; deltas with the
/// radius around u, normals, the box of normals.
layout(std430, binding = 5) readonly buffer Operations { uvec4 operation[]; };

/// Sets are a bit a vertex; how many are in each block of them is counted as they come.
const uint kBlockWords = 256u, kBlockBits = 32u * kBlockWords;
const uint kResults = 256u;  // in a block

layout(std430, binding = 6) WORK_ACCESS buffer State {
    uint vertices, faces;  // in the arrays, free places included
    uint covered;          // vertices for which sets may hold something
    uint free_vertex_head, free_vertices, free_face_head, free_faces;
    uint fresh[2];  // in the queues of each round
    uint may_merge, released;
    uint splits, merges;  // in this pass
    uint is_woken;        // 1: the pass before has found some that may split in this one
    uint is_evaluated;    // 1: merges of this pass have been looked for
    uint freed_vertices, freed_faces;
    uint all_splits, all_merges, passes;  // in this frame
    uint kept_vertices, kept_faces;       // at its end
    uint to_vertices, to_faces;           // places below that are to be filled
    int box[6];                           // of all vertices: its corners
};

/// Where arrays begin in `work`.
layout(std140, binding = 0) uniform Places {
    uint base_vertices, base_faces;
    uint vertex_mask, face_mask;  // of the rings
    uint at_marked, at_may_split, at_to_merge, at_is_released;
    uint at_split_blocks, at_merge_blocks, blocks;  // both twice
    uint at_fresh, capacity;                        // two queues
    uint at_may_merge, at_released;
    uint at_splits, at_merges, at_result;
    uint at_result_vertices, at_result_faces;  // freed, a block of results
    uint at_free_vertices, at_free_faces;      // rings
    uint at_gone, at_gone_blocks, at_hole_blocks;
    uint at_from, at_to, at_rank;  // those that move; the rank of one beyond
    uint result_blocks, face_capacity, gone_blocks, hole_blocks;
};
layout(std430, binding = 7) WORK_ACCESS buffer Work { uint work[]; };

layout(location = 0) uniform uint pass;      // its parity tells which counts of blocks are its own
layout(location = 1) uniform uint argument;  // of the step

uint threads() {
    return gl_NumWorkGroups.x * uint(GROUP);
}

bool has(uint at, uint v) {
    return (work[at + (v >> 5)] >> (v & 31u) & 1u) != 0u;
}
/// False if it was there.
bool insert(uint at, uint v) {
    const uint bit = 1u << (v & 31u);
    if ((work[at + (v >> 5)] & bit) != 0u) return false;
    return (atomicOr(work[at + (v >> 5)], bit) & bit) == 0u;
}
void erase(uint at, uint v) {
    atomicAnd(work[at + (v >> 5)], ~(1u << (v & 31u)));
}
void insertCounted(uint at, uint at_blocks, uint v) {
    if (insert(at, v)) atomicAdd(work[at_blocks + v / kBlockBits], 1u);
}
/// To be looked at in the pass of this parity.
void maySplit(uint v, uint parity) {
    insertCounted(at_may_split, at_split_blocks + parity * blocks, v);
}
void mark(uint v, uint round) {
    if (!insert(at_marked, v)) return;
    work[at_fresh + (round & 1u) * capacity + atomicAdd(fresh[round], 1u)] = v;
}
