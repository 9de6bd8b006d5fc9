// ActiveMesh::split().

/// A triangle of the star by its place; beyond an open fan's ends there is none.
uint triangleOf(Star star, uint i) {
    if (i < star.count) return cornerOf(star, i);
    if (!star.closed) return kNone;
    return cornerOf(star, i == star.count ? 0u : star.count - 1u);
}
uint placeOfRank(Star star, uint rank) {
    const uint place = star.first + rank;
    return place < neighbours(star) ? place : place - neighbours(star);
}
uint arc(uint from, uint to, uint ring) {  // both included
    const uint until = (2u << to) - 1u, before_from = (1u << from) - 1u;
    return from <= to ? until & ~before_from : ((1u << ring) - 1u) & (until | ~before_from);
}

/// The star's triangles between vr and vl become u's, and two new ones come; returns first corners
/// of v and of u.
uvec2 splitFaces(uint v, Star star, uint u, uvec2 faces, uint l, uint r, bool has_left,
                 bool has_right) {
    const uint n = star.count;
    const uint chunk = face[placeOf(cornerOf(star, 0u) | 3u) + 4u];
    const uint begin = has_right ? r : 0u, end = has_left ? l : n;
    uint i = begin;
    for (uint left = end >= begin ? end - begin : n - begin + end; left > 0u; --left) {
        setVertexAt(cornerOf(star, i), u);
        if (++i == n) i = 0u;
    }
    const uint fl = 4u * faces.x, fr = 4u * (has_left ? faces.y : faces.x);
    if (has_left) {
        const uint vl = neighbourOf(star, l);
        const uint of_u = triangleOf(star, l - 1u), of_v = triangleOf(star, l);
        const uint at = placeOf(fl);
        face[at] = v;
        face[at + 1u] = u;
        face[at + 2u] = vl;
        face[at + 3u] = v;
        face[at + 7u] = chunk;
        link(fl, has_right ? fr : kNone);
        link(fl + 1u, of_u == kNone ? kNone : previousCorner(of_u));
        link(fl + 2u, of_v);
        if (of_v == kNone) pulse[vl].y = fl + 2u;
    }
    if (has_right) {
        const uint vr = neighbourOf(star, r);
        const uint of_v = triangleOf(star, r - 1u), of_u = triangleOf(star, r);
        const uint at = placeOf(fr);
        face[at] = u;
        face[at + 1u] = v;
        face[at + 2u] = vr;
        face[at + 3u] = u;
        face[at + 7u] = chunk;
        if (!has_left) link(fr, kNone);
        link(fr + 1u, of_v == kNone ? kNone : previousCorner(of_v));
        link(fr + 2u, of_u);
        if (of_u == kNone) pulse[vr].y = fr + 2u;
    }
    uvec2 corner = uvec2(has_left ? fl : fr + 1u, has_left ? fl + 1u : fr);
    if (!star.closed) corner = uvec2(firstCorner(corner.x), firstCorner(corner.y));
    return corner;
}

/// Returns which neighbours are v's now, and which u's.
uvec2 split(uint v, Star star, uint u, uvec2 faces) {
    const uvec4 before = pulse[v];
    uvec4 a = before, b, r = record[v], s;
    uvec4 c = uvec4(0u), d = uvec4(0u);
    const uint id = r.x;
    const uvec4 o = operation[2u * id];
    const bool has_left = rankLeft(o) != kNoRank, has_right = rankRight(o) != kNoRank;
    const uint left = placeOfRank(star, rankLeft(o)), right = placeOfRank(star, rankRight(o));
    const uvec2 corners = splitFaces(v, star, u, faces, left, right, has_left, has_right);
    a.y = corners.x;
    b = uvec4(nameOf(id), corners.y, 0u, 0u);

    ivec4 p = vertex[v];
    const uint normals = operation[2u * id + 1u].z;
    s = uvec4(kNone, kNone, r.y, uint(p.w) & 0xffffu);
    vertex[u] = ivec4(p.xyz + offset(id, o, 1u), int(normals >> 16));
    vertex[v] = ivec4(p.xyz + offset(id, o, 0u), int(normals & 0xffffu));
    setLast(a, r, c, id);
    setLast(b, s, d, id);
    setNext(a, r, c, o.x);
    setNext(b, s, d, o.y);
    record[v] = r;
    record[u] = s;
    criteria[v] = c;
    criteria[u] = d;

    const uint ring = neighbours(star);
    const uint of_v = arc(has_left ? left : 0u, has_right ? right : ring - 1u, ring);
    const uint of_u = arc(has_right ? right : 0u, has_left ? left : ring - 1u, ring);
    a.w = weightOn(b, a);
    b.w = weightOn(a, b);
    for (uint i = 0u; i < ring; ++i) {
        const uint w = neighbourOf(star, i);
        const uvec4 q = pulse[w];
        uint change = 0u - weightOn(before, q);
        if ((of_v >> i & 1u) != 0u) {
            change += weightOn(a, q);
            a.w += weightOn(q, a);
        }
        if ((of_u >> i & 1u) != 0u) {
            change += weightOn(b, q);
            b.w += weightOn(q, b);
        }
        addAround(w, change);
    }
    pulse[v] = a;
    pulse[u] = b;
    return uvec2(of_v, of_u);
}
