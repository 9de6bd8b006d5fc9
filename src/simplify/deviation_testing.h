#pragma once
// What the test and the benchmark of the deviation bound share: meshes, a plain simplifier that
// knows its own maps, and an oracle for the true distance. Slow and simple on purpose; not for the
// library.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <queue>
#include <random>
#include <string>
#include <unordered_map>
#include <vector>

#include "geometry/mesh.h"
#include "simplify/deviation.h"

namespace pietra::testing {

// ---- meshes
// ----------------------------------------------------------------------------------------

/// A height field of n x n quads, `cell` lattice units wide, height(x, y) in lattice units.
template <class Height>
Mesh heightField(int n, int cell, Height&& height) {
    Mesh mesh;
    for (int y = 0; y <= n; ++y) {
        for (int x = 0; x <= n; ++x) {
            mesh.position.push_back(
                {1000 + x * cell, 1000 + y * cell, 500000 + int32_t(std::lround(height(x, y)))});
        }
    }
    for (uint32_t y = 0; y < uint32_t(n); ++y) {
        for (uint32_t x = 0; x < uint32_t(n); ++x) {
            const uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            mesh.triangle.push_back({a, b, d});
            mesh.triangle.push_back({a, d, c});
        }
    }
    return mesh;
}

/// An octahedron subdivided `levels` times; radius(direction) in lattice units.
template <class Radius>
Mesh bumpySphere(int levels, Radius&& radius) {
    std::vector<Vec3d> point{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    std::vector<Triangle> triangle{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                   {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
        const auto mid = [&](uint32_t a, uint32_t b) {
            const auto [it, added] = middle.try_emplace(std::minmax(a, b), uint32_t(point.size()));
            if (added) point.push_back(glm::normalize(point[a] + point[b]));
            return it->second;
        };
        std::vector<Triangle> finer;
        for (const Triangle& t : triangle) {
            const uint32_t a = mid(t[0], t[1]), b = mid(t[1], t[2]), c = mid(t[2], t[0]);
            finer.insert(finer.end(), {{t[0], a, c}, {t[1], b, a}, {t[2], c, b}, {a, b, c}});
        }
        triangle = finer;
    }
    Mesh mesh;
    for (const Vec3d& p : point) {
        mesh.position.push_back(Vec3i(glm::round(Vec3d(1 << 20) + radius(p) * p)));
    }
    mesh.triangle = triangle;
    return mesh;
}

/// Adds the triangles of `other`, shifted.
inline void append(Mesh& mesh, const Mesh& other, const Vec3i& shift = {0, 0, 0}) {
    const uint32_t base = uint32_t(mesh.position.size());
    for (const Vec3i& p : other.position) mesh.position.push_back(p + shift);
    for (const Triangle& t : other.triangle) {
        mesh.triangle.push_back({t[0] + base, t[1] + base, t[2] + base});
    }
}

// ---- a plain simplifier
// ----------------------------------------------------------------------------

struct Simplified {
    Mesh mesh;
    std::vector<uint32_t> vertex_map, triangle_map;
    std::vector<uint8_t> triangle_changed;
};

/// Edge collapse on quadrics with optimal placement on the lattice, link and flip tests.
class PlainSimplifier {
public:
    PlainSimplifier(const Mesh& mesh, std::vector<uint8_t> locked)
        : mesh_(mesh), locked_(std::move(locked)) {
        locked_.resize(mesh.position.size(), 0);
        lockBorders();
        fans_.resize(mesh.position.size());
        quadric_.resize(mesh.position.size());
        stamp_.assign(mesh.position.size(), 0);
        for (uint32_t v = 0; v < mesh.position.size(); ++v) parent_.push_back(v);
        alive_.assign(mesh.triangle.size(), 1);
        moved_.assign(mesh.triangle.size(), 0);
        live_ = mesh.triangle.size();
        for (uint32_t t = 0; t < mesh.triangle.size(); ++t) {
            for (const uint32_t v : mesh.triangle[t]) fans_[v].push_back(t);
            addQuadric(t);
        }
    }

    Simplified run(size_t target_triangles) {
        for (uint32_t v = 0; v < fans_.size(); ++v) pushEdges(v, true);
        while (live_ > target_triangles && !queue_.empty()) {
            const Candidate c = queue_.top();
            queue_.pop();
            if (stamp_[c.a] == c.stamp_a && stamp_[c.b] == c.stamp_b) collapse(c);
        }
        return finish();
    }

private:
    struct Quadric {
        double a[10] = {};
        void plane(const Vec3d& n, double d, double w) {
            const double v[4] = {n.x, n.y, n.z, d};
            for (int i = 0, k = 0; i < 4; ++i) {
                for (int j = i; j < 4; ++j) a[k++] += w * v[i] * v[j];
            }
        }
        Quadric operator+(const Quadric& o) const {
            Quadric r = *this;
            for (int i = 0; i < 10; ++i) r.a[i] += o.a[i];
            return r;
        }
        double at(const Vec3d& p) const {
            return a[0] * p.x * p.x + a[4] * p.y * p.y + a[7] * p.z * p.z +
                   2 * (a[1] * p.x * p.y + a[2] * p.x * p.z + a[5] * p.y * p.z + a[3] * p.x +
                        a[6] * p.y + a[8] * p.z) +
                   a[9];
        }
    };
    struct Candidate {
        double cost;
        uint32_t a, b, stamp_a, stamp_b;
        Vec3i at;
        bool operator<(const Candidate& o) const {
            return cost != o.cost ? cost > o.cost : a != o.a ? a > o.a : b > o.b;
        }
    };

    Vec3d local(uint32_t v) const { return Vec3d(mesh_.position[v] - centre_); }

    void lockBorders() {
        std::unordered_map<uint64_t, int> uses;
        const auto key = [](uint32_t a, uint32_t b) {
            return uint64_t(std::min(a, b)) << 32 | std::max(a, b);
        };
        for (const Triangle& t : mesh_.triangle) {
            for (int k = 0; k < 3; ++k) ++uses[key(t[k], t[(k + 1) % 3])];
        }
        for (const Triangle& t : mesh_.triangle) {
            for (int k = 0; k < 3; ++k) {
                if (uses[key(t[k], t[(k + 1) % 3])] != 2) {
                    locked_[t[k]] = locked_[t[(k + 1) % 3]] = 1;
                }
            }
        }
        if (!mesh_.position.empty()) centre_ = mesh_.position[0];
    }

    void addQuadric(uint32_t t) {
        const Triangle& tri = mesh_.triangle[t];
        const Vec3d a = local(tri[0]);
        const Vec3d n = glm::cross(local(tri[1]) - a, local(tri[2]) - a);
        const double area = glm::length(n);
        if (!(area > 0)) return;
        Quadric q;
        q.plane(n / area, -glm::dot(n / area, a), area);
        for (const uint32_t v : tri) {
            quadric_[v] = quadric_[v] + q;
            const Vec3d p = local(v);
            for (int k = 0; k < 3; ++k) {  // the regulariser, centred at the vertex
                Vec3d axis(0);
                axis[k] = 1;
                quadric_[v].plane(axis, -p[k], 1e-4 * area);
            }
        }
    }

    void pushEdges(uint32_t v, bool upward_only) {
        for (const uint32_t t : fans_[v]) {
            for (const uint32_t w : mesh_.triangle[t]) {
                if (w != v && (!upward_only || w > v)) pushEdge(v, w);
            }
        }
    }

    void pushEdge(uint32_t a, uint32_t b) {
        if (locked_[a] && locked_[b]) return;
        const Quadric q = quadric_[a] + quadric_[b];
        Vec3i at;
        if (locked_[a] || locked_[b]) {
            at = mesh_.position[locked_[a] ? a : b];
        } else {
            const Vec3d m[3] = {
                {q.a[0], q.a[1], q.a[2]}, {q.a[1], q.a[4], q.a[5]}, {q.a[2], q.a[5], q.a[7]}};
            const Vec3d rhs(-q.a[3], -q.a[6], -q.a[8]);
            const Vec3d middle = 0.5 * (local(a) + local(b));
            const double det = glm::dot(m[0], glm::cross(m[1], m[2]));
            Vec3d best(glm::dot(rhs, glm::cross(m[1], m[2])) / det,
                       glm::dot(m[0], glm::cross(rhs, m[2])) / det,
                       glm::dot(m[0], glm::cross(m[1], rhs)) / det);
            const double edge = glm::length(local(a) - local(b));
            if (!(glm::length(best - middle) <= edge)) best = middle;
            at = centre_ + Vec3i(glm::round(best));
        }
        queue_.push({q.at(Vec3d(at - centre_)), a, b, stamp_[a], stamp_[b], at});
    }

    bool linkAllows(uint32_t a, uint32_t b) const {
        std::vector<uint32_t> near_a, near_b, third;
        const auto collect = [&](uint32_t v, std::vector<uint32_t>& near) {
            for (const uint32_t t : fans_[v]) {
                for (const uint32_t w : mesh_.triangle[t]) {
                    if (w != v) near.push_back(w);
                }
            }
            std::sort(near.begin(), near.end());
            near.erase(std::unique(near.begin(), near.end()), near.end());
        };
        collect(a, near_a);
        collect(b, near_b);
        std::vector<uint32_t> common;
        std::set_intersection(near_a.begin(), near_a.end(), near_b.begin(), near_b.end(),
                              std::back_inserter(common));
        size_t shared = 0;
        for (const uint32_t t : fans_[a]) {
            const Triangle& tri = mesh_.triangle[t];
            shared += tri[0] == b || tri[1] == b || tri[2] == b;
        }
        return common.size() == shared && near_a.size() + near_b.size() > 8;
    }

    bool flips(uint32_t v, uint32_t other, const Vec3i& at) const {
        for (const uint32_t t : fans_[v]) {
            Triangle tri = mesh_.triangle[t];
            if (tri[0] == other || tri[1] == other || tri[2] == other) continue;
            Vec3d before[3], after[3];
            for (int k = 0; k < 3; ++k) {
                before[k] = local(tri[k]);
                after[k] = tri[k] == v ? Vec3d(at - centre_) : before[k];
            }
            const Vec3d n = glm::cross(before[1] - before[0], before[2] - before[0]);
            const Vec3d m = glm::cross(after[1] - after[0], after[2] - after[0]);
            if (!(glm::dot(n, m) > 0.2 * glm::length(n) * glm::length(m)) && glm::length(n) > 0) {
                return true;
            }
            if (!(glm::length(m) > 0)) return true;
        }
        return false;
    }

    void collapse(const Candidate& c) {
        const uint32_t a = locked_[c.b] ? c.b : c.a, b = locked_[c.b] ? c.a : c.b;
        if (!linkAllows(a, b) || flips(a, b, c.at) || flips(b, a, c.at)) return;
        mesh_.position[a] = c.at;
        quadric_[a] = quadric_[a] + quadric_[b];
        parent_[b] = a;
        std::vector<uint32_t> fan;
        for (const uint32_t v : {a, b}) {
            for (const uint32_t t : fans_[v]) {
                Triangle& tri = mesh_.triangle[t];
                if (!alive_[t]) continue;
                for (uint32_t& w : tri) w = w == b ? a : w;
                moved_[t] = 1;
                if (tri[0] == tri[1] || tri[1] == tri[2] || tri[2] == tri[0]) {
                    alive_[t] = 0;
                    --live_;
                } else {
                    fan.push_back(t);
                }
            }
        }
        fans_[b].clear();
        fans_[a] = fan;
        for (const uint32_t t : fan) {
            for (const uint32_t w : mesh_.triangle[t]) {
                std::erase_if(fans_[w], [&](uint32_t s) { return !alive_[s]; });
            }
        }
        ++stamp_[a];
        ++stamp_[b];
        pushEdges(a, false);
    }

    Simplified finish() {
        Simplified out;
        const uint32_t none = kNoDeviationIndex;
        std::vector<uint32_t> renumber(mesh_.position.size(), none);
        out.triangle_map.assign(mesh_.triangle.size(), none);
        for (uint32_t t = 0; t < mesh_.triangle.size(); ++t) {
            if (!alive_[t]) continue;
            out.triangle_map[t] = uint32_t(out.mesh.triangle.size());
            Triangle tri = mesh_.triangle[t];
            for (uint32_t& v : tri) {
                if (renumber[v] == none) {
                    renumber[v] = uint32_t(out.mesh.position.size());
                    out.mesh.position.push_back(mesh_.position[v]);
                }
                v = renumber[v];
            }
            out.mesh.triangle.push_back(tri);
            out.triangle_changed.push_back(moved_[t]);
        }
        for (uint32_t v = 0; v < mesh_.position.size(); ++v) {
            uint32_t root = v;
            while (parent_[root] != root) root = parent_[root];
            out.vertex_map.push_back(renumber[root]);
        }
        return out;
    }

    Mesh mesh_;
    Vec3i centre_{0};
    std::vector<uint8_t> locked_, alive_, moved_;
    std::vector<std::vector<uint32_t>> fans_;
    std::vector<Quadric> quadric_;
    std::vector<uint32_t> stamp_, parent_;
    size_t live_ = 0;
    std::priority_queue<Candidate> queue_;
};

// ---- the truth
// ---------------------------------------------------------------------------------------

/// Exact distances from points to a mesh, by a uniform grid, in double.
class DistanceOracle {
public:
    explicit DistanceOracle(const Mesh& mesh, double faces_a_cell = 2) : mesh_(mesh) {
        for (const Triangle& t : mesh.triangle) {
            for (const uint32_t v : t) {
                min_ = glm::min(min_, Vec3d(mesh.position[v]));
                max_ = glm::max(max_, Vec3d(mesh.position[v]));
            }
        }
        const Vec3d size = max_ - min_ + 1.0;
        const double area = size.x * size.y + size.y * size.z + size.z * size.x;
        cell_ = std::max(1.0, std::sqrt(area * faces_a_cell / double(mesh.triangle.size())));
        dim_ = Vec3i(size / cell_) + 1;
        first_.assign(size_t(dim_.x) * dim_.y * dim_.z + 1, 0);
        for (const int pass : {0, 1}) {
            for (uint32_t t = 0; t < mesh.triangle.size(); ++t) {
                forCells(t, [&](size_t cell) {
                    if (pass == 0) ++first_[cell];
                    if (pass == 1) item_[--first_[cell]] = t;
                });
            }
            if (pass == 1) break;
            size_t sum = 0;
            for (uint32_t& f : first_) f = uint32_t(sum += f);
            item_.resize(sum);
        }
    }

    struct Hit {
        double distance = std::numeric_limits<double>::max();
        uint32_t triangle = 0;
    };
    /// Or, sooner, any that is no farther than `enough`.
    Hit nearest(const Vec3d& p, double enough = 0) const {
        Hit hit;
        const Vec3i home = glm::clamp(Vec3i(glm::floor((p - min_) / cell_)), Vec3i(0), dim_ - 1);
        const double outside = glm::length(p - glm::clamp(p, min_, max_));
        const int far = std::max({dim_.x, dim_.y, dim_.z});
        for (int ring = 0; ring <= far; ++ring) {
            if (hit.distance <= std::max(enough, (ring - 1) * cell_ - outside)) break;
            const Vec3i lo = glm::max(home - ring, Vec3i(0)), hi = glm::min(home + ring, dim_ - 1);
            for (int z = lo.z; z <= hi.z; ++z) {
                for (int y = lo.y; y <= hi.y; ++y) {
                    const bool face = std::abs(z - home.z) == ring || std::abs(y - home.y) == ring;
                    for (int x = lo.x; x <= hi.x; ++x) {
                        if (!face && std::abs(x - home.x) != ring) continue;
                        visit(p, (size_t(z) * dim_.y + y) * dim_.x + x, hit);
                    }
                }
            }
        }
        return hit;
    }

    static double distance(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
        const Vec3d n = glm::cross(b - a, c - a);
        if (glm::dot(glm::cross(n, b - a), p - a) >= 0 &&
            glm::dot(glm::cross(n, c - b), p - b) >= 0 &&
            glm::dot(glm::cross(n, a - c), p - c) >= 0 && glm::dot(n, n) > 0) {
            return std::abs(glm::dot(n, p - a)) / glm::length(n);
        }
        const auto segment = [&](const Vec3d& from, const Vec3d& to) {
            const Vec3d e = to - from;
            const double l = glm::dot(e, e);
            const double t = l > 0 ? std::clamp(glm::dot(p - from, e) / l, 0.0, 1.0) : 0.0;
            return glm::length(p - from - t * e);
        };
        return std::min({segment(a, b), segment(b, c), segment(c, a)});
    }

private:
    template <class F>
    void forCells(uint32_t t, F&& f) const {
        Vec3d lo(max_), hi(min_);
        for (const uint32_t v : mesh_.triangle[t]) {
            lo = glm::min(lo, Vec3d(mesh_.position[v]));
            hi = glm::max(hi, Vec3d(mesh_.position[v]));
        }
        const Vec3i l((lo - min_) / cell_), h((hi - min_) / cell_);
        for (int z = l.z; z <= h.z; ++z) {
            for (int y = l.y; y <= h.y; ++y) {
                for (int x = l.x; x <= h.x; ++x) f((size_t(z) * dim_.y + y) * dim_.x + x);
            }
        }
    }
    void visit(const Vec3d& p, size_t cell, Hit& hit) const {
        for (uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
            const Triangle& t = mesh_.triangle[item_[i]];
            const double d = distance(p, Vec3d(mesh_.position[t[0]]), Vec3d(mesh_.position[t[1]]),
                                      Vec3d(mesh_.position[t[2]]));
            if (d < hit.distance || (d == hit.distance && item_[i] < hit.triangle)) {
                hit = {d, item_[i]};
            }
        }
    }

    const Mesh& mesh_;
    Vec3d min_{1e300}, max_{-1e300};
    double cell_ = 1;
    Vec3i dim_{1};
    std::vector<uint32_t> first_, item_;
};

/// Calls sample(point, triangle) for points of each triangle, at most `spacing` apart, corners
/// included.
template <class F>
void samplePoints(const Mesh& mesh, double spacing, F&& sample) {
    for (uint32_t t = 0; t < mesh.triangle.size(); ++t) {
        const Vec3d a(mesh.position[mesh.triangle[t][0]]), b(mesh.position[mesh.triangle[t][1]]),
            c(mesh.position[mesh.triangle[t][2]]);
        const double longest =
            std::max({glm::length(a - b), glm::length(b - c), glm::length(c - a)});
        const int n = std::clamp(int(std::ceil(longest / spacing)), 1, 64);
        for (int i = 0; i <= n; ++i) {
            for (int j = 0; i + j <= n; ++j) {
                sample(a + (b - a) * (double(i) / n) + (c - a) * (double(j) / n), t);
            }
        }
    }
}

// ---- real meshes
// -------------------------------------------------------------------------------------

/// The folder of shared data, empty if there is none.
inline std::filesystem::path sharedData() {
    const char* given = std::getenv("PIETRA_SHARED");
    for (std::filesystem::path root :
         {std::filesystem::path(given ? given : ""),
          std::filesystem::path(__FILE__).parent_path() / "../../../shared",
          std::filesystem::path(__FILE__).parent_path() / "../../../../shared"}) {
        if (!root.empty() && std::filesystem::exists(root / "data")) return root / "data";
    }
    return {};
}

/// Quantises to `bits` bits an axis and welds.
inline Mesh toLattice(const std::vector<Vec3d>& point, const std::vector<Triangle>& triangle,
                      int bits) {
    Vec3d min(1e300), max(-1e300);
    for (const Vec3d& p : point) {
        min = glm::min(min, p);
        max = glm::max(max, p);
    }
    const Vec3d size = max - min;
    const double scale = (double(1 << bits) - 2) / std::max({size.x, size.y, size.z});
    Mesh mesh;
    std::map<std::array<int32_t, 3>, uint32_t> seen;
    std::vector<uint32_t> map;
    for (const Vec3d& p : point) {
        const Vec3i q(glm::round((p - min) * scale));
        const auto [it, added] = seen.try_emplace({q.x, q.y, q.z}, uint32_t(mesh.position.size()));
        if (added) mesh.position.push_back(q);
        map.push_back(it->second);
    }
    for (const Triangle& t : triangle) {
        const Triangle m{map[t[0]], map[t[1]], map[t[2]]};
        if (m[0] != m[1] && m[1] != m[2] && m[2] != m[0]) mesh.triangle.push_back(m);
    }
    return mesh;
}

/// A small OBJ of triangles ("f 1/.. 2/.. 3/..") or binary or ascii PLY with float positions first
/// and triangles only. Anything else: an empty mesh.
inline Mesh readSimpleMesh(const std::filesystem::path& path, int bits) {
    std::vector<Vec3d> point;
    std::vector<Triangle> triangle;
    std::ifstream in(path, std::ios::binary);
    std::string line;
    if (path.extension() == ".obj") {
        while (std::getline(in, line)) {
            Vec3d p;
            Triangle t;
            if (std::sscanf(line.c_str(), "v %lf %lf %lf", &p.x, &p.y, &p.z) == 3)
                point.push_back(p);
            if (line.rfind("f ", 0) != 0) continue;
            const char* s = line.c_str() + 2;
            for (uint32_t& v : t) {
                char* end;
                v = uint32_t(std::strtol(s, &end, 10) - 1);
                for (s = end; *s && *s != ' ';) ++s;
            }
            triangle.push_back(t);
        }
        return toLattice(point, triangle, bits);
    }
    size_t vertices = 0, faces = 0, stride = 0;
    bool ascii = false, big = false, in_vertex = false;
    while (std::getline(in, line) && line.rfind("end_header", 0) != 0) {
        if (line.rfind("format ascii", 0) == 0) ascii = true;
        if (line.rfind("format binary_big", 0) == 0) big = true;
        if (line.rfind("element", 0) == 0) in_vertex = line.rfind("element vertex", 0) == 0;
        std::sscanf(line.c_str(), "element vertex %zu", &vertices);
        std::sscanf(line.c_str(), "element face %zu", &faces);
        if (in_vertex && line.rfind("property float", 0) == 0) stride += 4;
        if (in_vertex && line.rfind("property uchar", 0) == 0) stride += 1;
    }
    const auto swapped = [&](uint32_t x) { return big ? __builtin_bswap32(x) : x; };
    std::vector<char> row(std::max<size_t>(stride, 13));
    for (size_t v = 0; v < vertices; ++v) {
        Vec3d p;
        if (ascii) {
            std::getline(in, line);
            std::sscanf(line.c_str(), "%lf %lf %lf", &p.x, &p.y, &p.z);
        } else {
            in.read(row.data(), std::streamsize(stride));
            for (int k = 0; k < 3; ++k) {
                uint32_t raw;
                std::copy_n(row.data() + 4 * k, 4, reinterpret_cast<char*>(&raw));
                raw = swapped(raw);
                float value;
                std::copy_n(reinterpret_cast<char*>(&raw), 4, reinterpret_cast<char*>(&value));
                p[k] = value;
            }
        }
        point.push_back(p);
    }
    for (size_t f = 0; f < faces && in; ++f) {
        Triangle t;
        if (ascii) {
            std::getline(in, line);
            if (std::sscanf(line.c_str(), "3 %u %u %u", &t[0], &t[1], &t[2]) != 3) return {};
        } else {
            in.read(row.data(), 13);
            if (row[0] != 3) return {};
            for (int k = 0; k < 3; ++k) {
                std::copy_n(row.data() + 1 + 4 * k, 4, reinterpret_cast<char*>(&t[k]));
                t[k] = swapped(t[k]);
            }
        }
        triangle.push_back(t);
    }
    return toLattice(point, triangle, bits);
}

}  // namespace pietra::testing
