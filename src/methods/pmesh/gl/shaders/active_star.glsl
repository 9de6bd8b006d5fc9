// Stars, and what changes at one: as in ActiveMesh.

/// Of vertices that split or merge: at most fifteen neighbours, and one for the other end. A thread
/// has two, in the memory of its group.
const uint kRoom = 17u;
struct Star {
    uint count;
    bool closed;
    uint first;
    uint slot;
};
shared uint star_corner[2][kRoom][GROUP];
shared uint star_neighbour[2][kRoom + 1u][GROUP];

uint cornerOf(Star star, uint i) {
    return star_corner[star.slot][i][gl_LocalInvocationID.x];
}
uint neighbourOf(Star star, uint i) {
    return star_neighbour[star.slot][i][gl_LocalInvocationID.x];
}
uint neighbours(Star star) {
    return star.closed ? star.count : star.count + 1u;
}

Star gatherStar(uint from, uint slot) {
    const uint lane = gl_LocalInvocationID.x;
    Star star = Star(0u, false, 0u, slot);
    for (uint c = from; star.count < kRoom;) {
        const uint place = placeOf(c), left = face[place + 4u];
        star_corner[slot][star.count][lane] = c;
        star_neighbour[slot][star.count][lane] = face[place + 1u];
        ++star.count;
        if (left == kNone)
            star_neighbour[slot][star.count][lane] = vertexAt(previousCorner(c));
        if (left == from) star.closed = true;
        if (left == kNone || left == from) break;
        c = left;
    }
    return star;
}

/// From where ranks count.
uint firstOf(Star star) {
    if (!star.closed) return 0u;
    uint first = 0u, least_name = kNone;
    for (uint i = 0u; i < star.count; ++i) {
        const uint name = pulse[neighbourOf(star, i)].x;
        first = name < least_name ? i : first;
        least_name = min(name, least_name);
    }
    return first;
}

/// v alone changes: from `before` to `after`, whose count is set.
void changeAround(Star star, uvec4 before, inout uvec4 after) {
    after.w = 0u;
    for (uint i = 0u; i < neighbours(star); ++i) {
        const uint w = neighbourOf(star, i);
        const uvec4 p = pulse[w];
        addAround(w, weightOn(after, p) - weightOn(before, p));
        after.w += weightOn(p, after);
    }
}

void move(uint v, Star star) {
    const uvec4 before = pulse[v];
    uvec4 p = before, r = record[v];
    uvec4 c = criteria[v];
    const uint id = r.x;
    const uvec4 o = operation[2u * id];
    vertex[v].xyz += offset(id, o, 0u);
    setLast(p, r, c, id);
    setNext(p, r, c, o.x);
    changeAround(star, before, p);
    pulse[v] = p;
    record[v] = r;
    criteria[v] = c;
}

void moveBack(uint v, Star star) {
    const uvec4 before = pulse[v];
    uvec4 p = before, r = record[v];
    uvec4 c = criteria[v];
    const uint id = r.y;
    const uvec4 o = operation[2u * id];
    vertex[v].xyz -= offset(id, o, 0u);
    setLast(p, r, c, o.y);
    setNext(p, r, c, id);
    changeAround(star, before, p);
    pulse[v] = p;
    record[v] = r;
    criteria[v] = c;
}
