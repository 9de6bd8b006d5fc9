#include "store/front_body.h"

namespace pietra {

void FrontPatch::reset(size_t vertex_count, size_t triangle_count) {
    items.reset(vertex_count, triangle_count);
    position.resize(vertex_count);
    triangle.resize(triangle_count);
    parents.resize(vertex_count);
    shared.clear();
    loop_begin.clear();
    border_vertices = vertices = triangles = 0;
}

void FrontPatch::closeLoop(uint32_t first) {
    const uint32_t end = items.size();
    for (uint32_t i = first; i < end; ++i) {
        items[i].prev = i == first ? end - 1 : i - 1;
        items[i].next = i == end - 1 ? first : i + 1;
    }
    // Nothing lies behind a border edge: expect the fourth corner of a parallelogram along the
    // loop.
    for (uint32_t i = first; i < end; ++i)
        items[i].over = items[items[i].prev].at + items[items[i].next].at - items[i].at;
}

void appendShared(const FrontPatch& patch, uint32_t patch_index,
                  std::span<const uint32_t> final_vertex, std::vector<SharedVertex>& list) {
    const auto base = uint32_t(list.size());
    size_t loop = 0;
    for (uint32_t v = 0; v < patch.border_vertices; ++v) {
        const bool starts = loop < patch.loop_begin.size() && patch.loop_begin[loop] == v;
        if (starts) ++loop;
        const uint32_t loop_end =
            loop < patch.loop_begin.size() ? patch.loop_begin[loop] : patch.border_vertices;
        list.push_back({patch.position[v], patch_index, final_vertex.empty() ? v : final_vertex[v],
                        base + (starts ? loop_end - 1 : v - 1)});
    }
}

void NormalPredictor::predict(std::span<const Lanes> position, std::span<const Triangle> triangles,
                              int bits) {
    const size_t n = position.size();
    sum_.assign(n, Lanes{0, 0, 0, 0});
    for (const Triangle& t : triangles) {
        const Lanes a = position[t[0]];
        const Lanes normal = crossProduct(position[t[1]] - a, position[t[2]] - a);
        sum_[t[0]] += normal;
        sum_[t[1]] += normal;
        sum_[t[2]] += normal;
    }
    // encodeNormal of geometry/octahedral.h at any number of bits, without branches.
    x_.resize(n);
    y_.resize(n);
    const auto top = float((1 << (bits - 1)) - 1);
    for (size_t v = 0; v < n; ++v) {
        const float nx = sum_[v][0], ny = sum_[v][1], nz = sum_[v][2];
        const float size = std::abs(nx) + std::abs(ny) + std::abs(nz);
        const float scale = size > 0 ? top / size : 0;
        const float x = nx * scale, y = ny * scale;
        const float folded_x = (top - std::abs(y)) * (x < 0 ? -1.0f : 1.0f);
        const float folded_y = (top - std::abs(x)) * (y < 0 ? -1.0f : 1.0f);
        x_[v] = roundToInt(nz < 0 ? folded_x : x);
        y_[v] = roundToInt(nz < 0 ? folded_y : y);
    }
}

}  // namespace pietra
