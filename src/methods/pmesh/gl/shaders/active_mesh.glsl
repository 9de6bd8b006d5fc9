// What ActiveMesh does, function by function.

uint nextCorner(uint corner) {
    return (corner & 3u) == 2u ? corner - 2u : corner + 1u;
}
uint previousCorner(uint corner) {
    return (corner & 3u) == 0u ? corner + 2u : corner - 1u;
}
uint placeOf(uint corner) {
    return 2u * corner - (corner & 3u);
}
uint vertexAt(uint corner) {
    return face[placeOf(corner)];
}
uint leftOf(uint corner) {
    return face[placeOf(corner) + 4u];
}
uint twinOf(uint half_edge) {
    return leftOf(nextCorner(half_edge));
}
void setVertexAt(uint corner, uint v) {
    face[placeOf(corner)] = v;
    if ((corner & 3u) == 0u) face[placeOf(corner) + 3u] = v;
}
void setTwin(uint half_edge, uint other) {
    face[placeOf(nextCorner(half_edge)) + 4u] = other;
}
void link(uint half_edge, uint other) {
    if (half_edge != kNone) setTwin(half_edge, other);
    if (other != kNone) setTwin(other, half_edge);
}
/// The first corner of the fan that has this one, or this one where the fan is closed.
uint firstCorner(uint corner) {
    for (uint c = corner;;) {
        const uint t = twinOf(c);
        if (t == kNone) return c;
        c = nextCorner(t);
        if (c == corner) return c;
    }
}

// ---- pulses, by value

uint nextLevel(uvec4 p) {
    return p.z & 0xffffu;
}
uint lastLevel(uvec4 p) {
    return p.z >> 16;
}
uint lower(uvec4 p) {
    return p.w & 0xffffu;
}
uint higher(uvec4 p) {
    return p.w >> 16;
}
uint weightOn(uvec4 p, uvec4 neighbour) {
    return uint(nextLevel(p) < nextLevel(neighbour)) |
           uint(lastLevel(p) > lastLevel(neighbour)) << 16;
}
void addAround(uint v, uint weight) {
    if (weight != 0u) atomicAdd(pulse[v].w, weight);
}

// ---- operations

uint rankLeft(uvec4 o) {
    return o.w >> 8 & 15u;
}
uint rankRight(uvec4 o) {
    return o.w >> 12 & 15u;
}
bool isDummy(uvec4 o) {
    return (o.w >> 8 & 0xffu) == kDummyRanks;
}
ivec3 offset(uint id, uvec4 o, uint end) {
    const ivec2 bytes = ivec2(operation[2u * id + 1u].xy);
    const ivec3 a = ivec3(bitfieldExtract(bytes.x, 0, 8), bitfieldExtract(bytes.x, 8, 8),
                          bitfieldExtract(bytes.x, 16, 8));
    const ivec3 b = ivec3(bitfieldExtract(bytes.x, 24, 8), bitfieldExtract(bytes.y, 0, 8),
                          bitfieldExtract(bytes.y, 8, 8));
    const int scale = 1 << (o.w >> 16 & 31u);
    if (isDummy(o)) return (a * 256 + (b & 0xff)) * scale;
    return (end == 0u ? a : b) * scale;
}
uint nameOf(uint id) {
    return base_vertices + id;
}
bool isNewEnd(uvec4 p, uvec4 r) {
    return lastLevel(p) != 0u && p.x == nameOf(r.y);
}
bool canUndo(uvec4 p, uvec4 r) {
    return r.y != kNone && (isNewEnd(p, r) || isDummy(operation[2u * r.y]));
}
void setNext(inout uvec4 p, inout uvec4 r, inout uvec4 c, uint next) {
    r.x = next;
    r.w &= 0xffffu;
    uint level = kLeafLevel;
    c.xy = uvec2(0u);
    if (next != kNone) {
        const uvec4 o = operation[2u * next];
        level = o.z & 0xffffu;
        c.xy = uvec2(o.z >> 16 | (o.w & 0xffu) << 16, operation[2u * next + 1u].w);
    }
    p.z = (p.z & 0xffff0000u) | level;
}
void setLast(inout uvec4 p, inout uvec4 r, inout uvec4 c, uint last) {
    r.y = last;
    c.zw = uvec2(kEverNeeded, 0u);
    p.z &= 0xffffu;
    if (last == kNone) return;
    const uvec4 o = operation[2u * last];
    p.z |= ((o.z & 0xffffu) + 1u) << 16;
    if (!canUndo(p, r)) return;
    const uvec4 rest = operation[2u * last + 1u];
    c.zw = uvec2(rest.y >> 16 | (o.w & 0xffu) << 16, rest.w);
}

uint otherEnd(uint v) {
    const uvec4 p = pulse[v];
    if (lastLevel(p) == 0u) return v;
    const uint ahead = vertexAt(nextCorner(p.y)), behind = vertexAt(previousCorner(p.y));
    if (lastLevel(pulse[ahead]) == lastLevel(p)) return ahead;
    if (lastLevel(pulse[behind]) == lastLevel(p)) return behind;
    for (uint c = p.y;;) {
        const uint w = vertexAt(nextCorner(c));
        if (lastLevel(pulse[w]) == lastLevel(p)) return w;
        const uint before = previousCorner(c), left = twinOf(before);
        if (left == kNone) {
            const uint end = vertexAt(before);
            return lastLevel(pulse[end]) == lastLevel(p) ? end : v;
        }
        if (left == p.y) return v;
        c = left;
    }
}
