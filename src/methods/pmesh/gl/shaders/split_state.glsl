// What all steps share. Each goes through its work in strides: as many groups as fill the GPU,
// however much there is.

layout(local_size_x = 64) in;

const uint NONE = 0xffffffffu;
const uint SLOTS = 682u;      // kSplitSlots
const uint SPLIT_WORDS = 24u; // of ResidentSplit
const uint NO_CHILD = 2047u, CLOSED = 0x8000u;

// Counts. Slots from `slots` on, and `is_free` of them before, have no vertex.
layout(std430, binding = 0) buffer State {
    uint slots, is_free;
    uint taken;  // of those, from the end of the list
    uint dropped, queued[2];
    uint splits, merges;
    int triangles;
};
// Columns of `capacity` words, a word a slot.
layout(std430, binding = 1) buffer Vertices { uint vertex[]; };
const uint BIRTH = 0u, NEXT = 5u;  // criteria, as NestedCriterion lies in memory
const uint FIRST = 10u, SPLIT = 11u, MADE = 12u, LAST = 13u, PARENT = 14u;
const uint DRAWN = 15u, MERGED = 19u;  // three words of position, one of normal
const uint LEAF = 23u, STATE = 29u, WORDS = 30u;
const uint DEAD = 0u, ALIVE = 1u, DROPPED = 2u, IS_CLOSED = 4u;
// ResidentSplit, node after node; then their words.
layout(std430, binding = 2) readonly buffer Splits { uint split_word[]; };
// Of each node: its place among the splits, or NONE; its children.
layout(std430, binding = 3) readonly buffer Nodes { uint node[]; };
// A bit a leaf; then of each 32 how many are set before.
layout(std430, binding = 4) buffer Leaves { uint leaf_word[]; };
// `capacity` words each: slots in the order of leaves, free ones, dropped ones, two queues.
layout(std430, binding = 5) buffer Lists { uint list[]; };
const uint ORDER = 0u, FREE = 1u, GONE = 2u, QUEUE = 3u;
// What is missing: five words each.
layout(std430, binding = 6) readonly buffer Blocking { uint blocking[]; };

layout(std140, binding = 0) uniform Frame {
    vec4 eye;      // and the reach
    vec4 side[4];  // and their products with the eye
    uint hides_backs, blockings;
    uint capacity, leaf_words, words, at_split_words;
};
layout(location = 0) uniform uint argument;

uint threads() { return gl_NumWorkGroups.x * gl_WorkGroupSize.x; }
uint get(uint column, uint slot) { return vertex[column * capacity + slot]; }
void put(uint column, uint slot, uint value) { vertex[column * capacity + slot] = value; }

/// Of those up to a leaf, its own included.
uint countUpTo(uint leaf) {
    const uint word = leaf / 32u;
    return leaf_word[leaf_words + word] +
           uint(bitCount(leaf_word[word] << (31u - leaf % 32u)));
}
