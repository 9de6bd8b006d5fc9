// ActiveMesh::merge().

/// Returns the faces that are free now.
uvec2 merge(uint v, Star star, uint u, Star other) {
    const uvec4 before = pulse[v], b = pulse[u];
    uvec4 a = before;
    const bool open = !star.closed || !other.closed;
    const uint n = other.count;
    uint at = 0u;
    while (neighbourOf(other, at) != v) ++at;
    for (uint i = 0u; i < n; ++i) setVertexAt(cornerOf(other, i), v);
    const bool has_left = other.closed || at > 0u, has_right = other.closed || at < n;
    const uint fl = has_left ? previousCorner(cornerOf(other, at == 0u ? n - 1u : at - 1u)) : kNone;
    const uint fr = has_right ? cornerOf(other, at) : kNone;
    uint stays = kNone, vl = kNone, vr = kNone;
    if (has_left) {
        const uint of_u = twinOf(fl + 1u), of_v = twinOf(fl + 2u);
        vl = vertexAt(fl + 2u);
        link(of_u, of_v);
        if (pulse[vl].y == fl + 2u) pulse[vl].y = of_u;
        stays = of_v != kNone ? of_v : nextCorner(of_u);
    }
    if (has_right) {
        const uint of_v = twinOf(fr + 1u), of_u = twinOf(fr + 2u);
        vr = vertexAt(fr + 2u);
        link(of_v, of_u);
        if (pulse[vr].y == fr + 2u) pulse[vr].y = of_v;
        if (!has_left) stays = of_u != kNone ? of_u : nextCorner(of_v);
    }
    a.y = open ? firstCorner(stays) : stays;

    uvec4 r = record[v];
    const uvec4 s = record[u];
    uvec4 c = criteria[v];
    const uint id = r.y;
    const uvec4 o = operation[2u * id];
    vertex[v] = ivec4(vertex[v].xyz - offset(id, o, 0u), int(s.w & 0xffffu));
    setLast(a, r, c, s.z);
    setNext(a, r, c, id);
    record[v] = r;
    criteria[v] = c;

    uint around = 0u;
    for (uint i = 0u; i < neighbours(star); ++i) {
        const uint w = neighbourOf(star, i);
        if (w == u) continue;
        const uvec4 q = pulse[w];
        addAround(w, weightOn(a, q) - weightOn(before, q));
        around += weightOn(q, a);
        if (!open && lastLevel(q) == lastLevel(a))
            a.y = cornerOf(star, w != vr ? i : (i == 0u ? star.count - 1u : i - 1u));
    }
    for (uint i = 0u; i < neighbours(other); ++i) {
        const uint w = neighbourOf(other, i);
        if (w == v) continue;
        const bool new_at_v = w != vl && w != vr;
        const uvec4 q = pulse[w];
        addAround(w, (new_at_v ? weightOn(a, q) : 0u) - weightOn(b, q));
        if (!new_at_v) continue;
        around += weightOn(q, a);
        if (!open && lastLevel(q) == lastLevel(a)) a.y = cornerOf(other, i);
    }
    a.w = around;
    pulse[v] = a;
    pulse[u].x = kNone;
    return uvec2(fl == kNone ? fl : fl >> 2, fr == kNone ? fr : fr >> 2);
}
