#include "methods/pmesh/operations.h"

#include <fmt/format.h>

namespace pietra::pmesh {

bool criteriaNest(const Operation& parent, const Operation& child, int end) {
    if (child.error > parent.error || !parent.normals.encloses(child.normals)) return false;
    const Vec3l d(parent.offset(end));
    const int64_t room = int64_t(decodeRadius(parent.radius)) - decodeRadius(child.radius);
    return room >= 0 && d.x * d.x + d.y * d.y + d.z * d.z <= room * room;
}

std::string faultOf(const Operation& o) {
    if (o.level > kMaxLevel)
        return fmt::format("its level is {}, the largest is {}", o.level, kMaxLevel);
    if (o.radius > kMaxRadiusCode) return fmt::format("its radius has the code {}", o.radius);
    if (o.normals.empty()) return "its box of normals is empty";
    if (o.shift > (o.isDummy() ? 0 : 20))
        return fmt::format("its deltas are shifted by {}", o.shift);
    if (o.rankLeft() == o.rankRight() && !o.isDummy()) return "its neighbours have equal ranks";
    return "";
}

std::vector<OperationId> coarseToFine(const ProgressiveMesh& mesh) {
    std::array<uint32_t, kMaxLevel + 2> begin{};
    for (const Operation& o : mesh.operation)
        if (o.error != 0) ++begin[o.level + 1u];
    for (size_t level = 1; level < begin.size(); ++level) begin[level] += begin[level - 1];
    std::vector<OperationId> order(begin.back());
    for (OperationId id = 0; id < mesh.operation.size(); ++id)
        if (mesh.operation[id].error != 0) order[begin[mesh.operation[id].level]++] = id;
    return order;
}

std::string validate(const ProgressiveMesh& mesh) {
    const size_t count = mesh.operation.size();
    std::vector<uint8_t> has_parent(count, 0);
    if (mesh.base_operation.size() != mesh.base_vertex.size())
        return fmt::format("{} base vertices have {} operations", mesh.base_vertex.size(),
                           mesh.base_operation.size());
    for (const Triangle& t : mesh.base_triangle)
        for (const uint32_t v : t)
            if (v >= mesh.base_vertex.size()) return fmt::format("base vertex {} is not there", v);
    for (const OperationId o : mesh.base_operation) {
        if (o == kNoOperation) continue;
        if (o >= count || has_parent[o]++) return fmt::format("operation {}: not a tree", o);
        if (mesh.operation[o].isDummy() && mesh.operation[o].child[1] != kNoOperation)
            return fmt::format("operation {}: it does not know its parent", o);
    }
    for (size_t o = 0; o < count; ++o) {
        const Operation& op = mesh.operation[o];
        if (op.error == 0) {
            if (has_parent[o]) return fmt::format("operation {}: its error has the code 0", o);
            continue;
        }
        if (const std::string fault = faultOf(op); !fault.empty())
            return fmt::format("operation {}: {}", o, fault);
        for (const int end : {0, 1}) {
            const OperationId c = op.childOf(end);
            if (c == kNoOperation) continue;
            if (c <= o || c >= count || has_parent[c]++)
                return fmt::format("operation {}: not a tree", c);
            if (mesh.operation[c].isDummy() && mesh.operation[c].child[1] != o)
                return fmt::format("operation {}: it does not know its parent", c);
            if (mesh.operation[c].level <= op.level)
                return fmt::format("operation {}: its level is not above its parent's", c);
            if (!criteriaNest(op, mesh.operation[c], end))
                return fmt::format("operation {}: its criteria exceed its parent's", c);
        }
    }
    for (size_t o = 0; o < count; ++o)
        if (mesh.operation[o].error != 0 && !has_parent[o])
            return fmt::format("operation {}: no parent", o);
    return "";
}

}  // namespace pietra::pmesh
