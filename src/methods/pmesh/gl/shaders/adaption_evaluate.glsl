// Adaption::findCandidates() and findMerges(): those that may be undone, and those that were
// released, one by one. To look at one twice changes nothing.

/// Whether the operation that made u is.
bool isNeeded(uint u) {
    const ivec3 p = vertex[u].xyz;
    if (needsLast(p, criteria[u].zw)) return true;
    const uint id = record[u].y;
    const uvec4 o = operation[2u * id];
    return needs(p - offset(id, o, isDummy(o) ? 0u : 1u),
                 uvec2(o.z >> 16 | (o.w & 0xffu) << 16, operation[2u * id + 1u].w));
}

void setBlocked(uint u, bool blocked) {
    const uint c = criteria[u].z;
    criteria[u].z = blocked ? c | kBlocked : c & ~kBlocked;
}

bool anyMarkedAround(uint v) {
    const uint first = pulse[v].y;
    for (uint c = first;;) {
        const uint place = placeOf(c), left = face[place + 4u];
        if (has(at_marked, face[place + 1u])) return true;
        if (left == kNone) return has(at_marked, vertexAt(previousCorner(c)));
        if (left == first) return false;
        c = left;
    }
}

void evaluate(uint u) {
    const bool blocked = higher(pulse[u]) > 0u;
    setBlocked(u, blocked);
    if (blocked || has(at_marked, u) || isNeeded(u)) return;
    const uint v = otherEnd(u);
    if (higher(pulse[v]) > 0u) {
        setBlocked(u, true);
        return;
    }
    if (argument != 0u)  // else none is marked
        if (anyMarkedAround(u) || anyMarkedAround(v)) return;
    insertCounted(at_to_merge, at_merge_blocks + (pass & 1u) * blocks, u);
}

void findMerges() {
    for (uint i = gl_GlobalInvocationID.x; i < may_merge + released; i += threads()) {
        if (i < may_merge) {
            evaluate(work[at_may_merge + i]);
            continue;
        }
        uint u = work[at_released + i - may_merge];
        erase(at_is_released, u);
        if (!isNewEnd(pulse[u], record[u])) u = otherEnd(u);
        if (canUndo(pulse[u], record[u])) evaluate(u);
    }
}
