// ActiveMesh::sortInSpace(): vertices by a key of their place, in three stable passes over six bits
// of it; faces by their first vertex, whose few faces are sorted one by one. The steps, by ARGUMENT:
//   0  the box of all vertices
//   1  keys
//   2  how often each digit is met, a tile of elements        for PASS 0, 1, 2
//   3  sums of these counts by blocks                             "
//   4  of all before                                              "
//   5  elements go where their digit's are                        "
//   6  places of vertices
//   7  faces are counted at their first vertices
//   8  sums of these counts by blocks
//   9  of all before
//  10  faces go there
//  11  in order; places of faces
//  12  faces and corners name the new places
//  13  elements go there: to memory aside in step 13, back in step 14, for PASS 0 to 5

const uint kDigits = 64u;
const uint kTile = 1024u;
const uint kScanned = 2048u;  // a group, eight a thread

shared int low[3], high[3];
shared uint met[kDigits][8];  // of 256 elements: a bit each
shared uint next_place[kDigits];

uint elements() {
    return vertices - base_vertices;
}
uint tiles() {
    return (elements() + kTile - 1u) / kTile;
}
uint keysAt(uint turn) {
    return (turn & 1u) == 0u ? at_fresh : at_may_merge;
}
uint idsAt(uint turn) {
    return (turn & 1u) == 0u ? at_fresh + capacity : at_released;
}
uint placeOfVertex(uint v) {
    return work[at_merges + v];
}
uint placeOfFace(uint f) {
    return f < base_faces ? f : work[at_rank + f];
}

void findBox() {
    const uint lane = gl_LocalInvocationID.x;
    if (lane < 3u) {
        low[lane] = 0x7fffffff;
        high[lane] = -0x7fffffff;
    }
    barrier();
    for (uint v = gl_GlobalInvocationID.x; v < vertices; v += threads())
        for (int k = 0; k < 3; ++k) {
            atomicMin(low[k], vertex[v][k]);
            atomicMax(high[k], vertex[v][k]);
        }
    barrier();
    if (lane < 3u) {
        atomicMin(box[lane], low[lane]);
        atomicMax(box[3u + lane], high[lane]);
    }
}

/// Six bits of x, every third bit of the result.
uint spread(uint x) {
    uint bits = x & 0x3fu;
    bits = (bits | bits << 8) & 0x0300fu;
    bits = (bits | bits << 4) & 0x030c3u;
    return (bits | bits << 2) & 0x09249u;
}

void findKeys() {
    const ivec3 first = ivec3(box[0], box[1], box[2]), size = ivec3(box[3], box[4], box[5]) - first;
    const int shift = max(findMSB(uint(max(size.x, max(size.y, size.z)))) - 5, 0);
    for (uint i = gl_GlobalInvocationID.x; i < elements(); i += threads()) {
        const uvec3 p = uvec3((vertex[base_vertices + i].xyz - first) >> shift);
        work[keysAt(0u) + i] = spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2;
        work[idsAt(0u) + i] = base_vertices + i;
    }
}

uint digitOf(uint i) {
    return work[keysAt(pass) + i] >> (6u * pass) & (kDigits - 1u);
}

void countDigits(uint tile) {
    const uint lane = gl_LocalInvocationID.x;
    barrier();
    if (lane < kDigits) next_place[lane] = 0u;
    barrier();
    const uint end = min(elements(), (tile + 1u) * kTile);
    for (uint i = tile * kTile + lane; i < end; i += 256u) atomicAdd(next_place[digitOf(i)], 1u);
    barrier();
    if (lane < kDigits) work[at_result + lane * tiles() + tile] = next_place[lane];
}

/// 256 elements at a time: how many before have the same digit is counted in bits.
void placeDigits(uint tile) {
    const uint lane = gl_LocalInvocationID.x;
    barrier();
    if (lane < kDigits) next_place[lane] = work[at_result + lane * tiles() + tile];
    const uint end = min(elements(), (tile + 1u) * kTile);
    for (uint first = tile * kTile; first < end; first += 256u) {
        for (uint k = lane; k < 8u * kDigits; k += 256u) met[k >> 3][k & 7u] = 0u;
        barrier();
        const uint i = first + lane;
        const uint digit = i < end ? digitOf(i) : 0u;
        if (i < end) atomicOr(met[digit][lane >> 5], 1u << (lane & 31u));
        barrier();
        if (i < end) {
            uint before = uint(bitCount(met[digit][lane >> 5] & ((1u << (lane & 31u)) - 1u)));
            for (uint w = 0u; w < lane >> 5; ++w) before += uint(bitCount(met[digit][w]));
            const uint to = next_place[digit] + before;
            work[keysAt(pass + 1u) + to] = work[keysAt(pass) + i];
            work[idsAt(pass + 1u) + to] = work[idsAt(pass) + i];
        }
        barrier();
        if (lane < kDigits)
            for (uint w = 0u; w < 8u; ++w) next_place[lane] += uint(bitCount(met[lane][w]));
        barrier();
    }
}

/// work[at] and on become sums of those before.
void sumBlock(uint at, uint count, uint block) {
    uint own = 0u, total;
    const uint first = block * kScanned + 8u * gl_LocalInvocationID.x;
    for (uint i = first; i < min(first + 8u, count); ++i) own += work[at + i];
    sumBefore(own, total);
    if (gl_LocalInvocationID.x == 0u) work[at_splits + block] = total;
}
void scanBlock(uint at, uint count, uint block) {
    uint own = 0u, total;
    const uint first = block * kScanned + 8u * gl_LocalInvocationID.x;
    for (uint i = first; i < min(first + 8u, count); ++i) own += work[at + i];
    uint before = sumOf(at_splits, block);
    before += sumBefore(own, total);
    for (uint i = first; i < min(first + 8u, count); ++i) {
        const uint mine = work[at + i];
        work[at + i] = before;
        before += mine;
    }
}
void scanStep(uint at, uint count, bool sums_only) {
    const uint used = (count + kScanned - 1u) / kScanned;
    for (uint b = gl_WorkGroupID.x; b < used; b += gl_NumWorkGroups.x) {
        if (sums_only) {
            sumBlock(at, count, b);
        } else {
            scanBlock(at, count, b);
        }
    }
}

void placeVertices() {
    for (uint v = gl_GlobalInvocationID.x; v < vertices; v += threads()) {
        if (v < base_vertices) {
            work[at_merges + v] = v;
        } else {
            work[at_merges + work[idsAt(3u) + v - base_vertices]] = v;
        }
        work[at_result + v] = work[at_result + capacity + v] = 0u;
    }
}

uint firstVertex(uint f) {
    return min(placeOfVertex(face[8u * f]),
               min(placeOfVertex(face[8u * f + 1u]), placeOfVertex(face[8u * f + 2u])));
}

void placeFaces() {
    for (uint f = base_faces + gl_GlobalInvocationID.x; f < faces; f += threads()) {
        const uint v = firstVertex(f);
        work[at_to + work[at_result + v] + atomicAdd(work[at_result + capacity + v], 1u)] = f;
    }
}

void orderFaces() {
    for (uint v = gl_GlobalInvocationID.x; v < vertices; v += threads()) {
        const uint begin = at_to + work[at_result + v];
        const uint count = work[at_result + capacity + v];
        for (uint i = 1u; i < count; ++i) {
            const uint f = work[begin + i];
            uint j = i;
            for (; j > 0u && work[begin + j - 1u] > f; --j) work[begin + j] = work[begin + j - 1u];
            work[begin + j] = f;
        }
        for (uint i = 0u; i < count; ++i)
            work[at_rank + work[begin + i]] = base_faces + begin - at_to + i;
    }
}

uint movedCorner(uint corner) {
    return corner == kNone ? kNone : 4u * placeOfFace(corner >> 2) + (corner & 3u);
}
void rename() {
    for (uint f = gl_GlobalInvocationID.x; f < faces; f += threads())
        for (uint k = 0u; k < 3u; ++k) {
            setVertexAt(4u * f + k, placeOfVertex(face[8u * f + k]));
            face[8u * f + 4u + k] = movedCorner(face[8u * f + 4u + k]);
        }
    for (uint v = gl_GlobalInvocationID.x; v < vertices; v += threads())
        pulse[v].y = movedCorner(pulse[v].y);
}

uvec4 element(uint kind, uint i) {
    if (kind == 0u) return uvec4(vertex[i]);
    if (kind == 1u) return pulse[i];
    if (kind == 2u) return criteria[i];
    if (kind == 3u) return record[i];
    const uint at = 8u * i + 4u * (kind - 4u);
    return uvec4(face[at], face[at + 1u], face[at + 2u], face[at + 3u]);
}
void moveAside(uint kind) {
    const uint first = kind < 4u ? base_vertices : base_faces, end = kind < 4u ? vertices : faces;
    for (uint i = first + gl_GlobalInvocationID.x; i < end; i += threads()) {
        const uint to = at_from + 4u * (kind < 4u ? placeOfVertex(i) : placeOfFace(i));
        const uvec4 e = element(kind, i);
        for (uint k = 0u; k < 4u; ++k) work[to + k] = e[k];
    }
}
void moveBack(uint kind) {
    const uint first = kind < 4u ? base_vertices : base_faces, end = kind < 4u ? vertices : faces;
    for (uint i = first + gl_GlobalInvocationID.x; i < end; i += threads()) {
        const uint at = at_from + 4u * i;
        const uvec4 e = uvec4(work[at], work[at + 1u], work[at + 2u], work[at + 3u]);
        if (kind == 0u) vertex[i] = ivec4(e);
        if (kind == 1u) pulse[i] = e;
        if (kind == 2u) criteria[i] = e;
        if (kind == 3u) record[i] = e;
        if (kind >= 4u)
            for (uint k = 0u; k < 4u; ++k) face[8u * i + 4u * (kind - 4u) + k] = e[k];
    }
}

void main() {
    const uint table = kDigits * tiles();
    if (argument == 0u) findBox();
    if (argument == 1u) findKeys();
    if (argument == 2u)
        for (uint t = gl_WorkGroupID.x; t < tiles(); t += gl_NumWorkGroups.x) countDigits(t);
    if (argument == 3u || argument == 4u) scanStep(at_result, table, argument == 3u);
    if (argument == 5u)
        for (uint t = gl_WorkGroupID.x; t < tiles(); t += gl_NumWorkGroups.x) placeDigits(t);
    if (argument == 6u) placeVertices();
    if (argument == 7u)
        for (uint f = base_faces + gl_GlobalInvocationID.x; f < faces; f += threads())
            atomicAdd(work[at_result + firstVertex(f)], 1u);
    if (argument == 8u || argument == 9u) scanStep(at_result, vertices, argument == 8u);
    if (argument == 10u) placeFaces();
    if (argument == 11u) orderFaces();
    if (argument == 12u) rename();
    if (argument == 13u) moveAside(pass);
    if (argument == 14u) moveBack(pass);
}
