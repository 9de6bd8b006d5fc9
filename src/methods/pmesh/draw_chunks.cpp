#include "methods/pmesh/draw_chunks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"

namespace pietra::pmesh {
namespace {

/// Triangles of a chunk. Fewer cost more vertices on borders, more mean more to make anew.
constexpr size_t kMost = 2048, kFew = 128;
constexpr uint32_t kNone = ~0u;
/// What rounding may take from the cosine of a cone.
constexpr float kConeSlack = 1e-5f;

/// Damage may take a vertex anywhere; renderers rely on 21 bits. Rounding alone takes none so far
/// off the lattice.
Vec3i drawnPosition(const Vertex& v, int shift) {
    constexpr int32_t kOff = 1 << (kMaxLatticeShift - 1);
    return glm::clamp(v.position() * (1 << shift), -kOff, kLatticeMax + kOff - 1);
}

/// Where the vertices of a chunk are put: a table of its own, small enough for a cache, as one for
/// all vertices of the mesh would be large, and one a thread.
class Places {
public:
    /// kNone if v is new; then it must be set.
    uint32_t& operator[](uint32_t v) {
        size_t slot = v * 0x9e3779b1u >> (32 - kBits);
        while (slot_[slot].place != kNone && slot_[slot].vertex != v)
            slot = (slot + 1) % slot_.size();
        slot_[slot].vertex = v;
        return slot_[slot].place;
    }
    void clear() { slot_.fill({}); }

private:
    static constexpr int kBits = 13;
    static_assert(3 * kMost < 1 << kBits);
    struct Slot {
        uint32_t vertex = 0, place = kNone;
    };
    std::array<Slot, 1 << kBits> slot_;
};

float distance(const Vec3f& a, const Vec3i& b) {
    return glm::length(a - Vec3f(b));
}

/// Around the mean direction; wide open where that is no direction of all.
NormalCone coneOf(const Mesh& mesh) {
    thread_local std::vector<Vec3f> normal;
    normal.clear();
    Vec3f sum(0);
    for (const Triangle& t : mesh.triangle) {
        const Vec3f a(mesh.position[t[0]]);
        const Vec3f n = glm::cross(Vec3f(mesh.position[t[1]]) - a, Vec3f(mesh.position[t[2]]) - a);
        const float squared = glm::dot(n, n);
        if (!(squared > 0)) continue;  // no area, not drawn
        normal.push_back(n / std::sqrt(squared));
        sum += normal.back();
    }
    NormalCone cone;
    if (!(glm::dot(sum, sum) > 0)) return cone;
    cone.axis = glm::normalize(sum);
    float least = 1;
    for (const Vec3f& n : normal) least = std::min(least, glm::dot(n, cone.axis));
    cone.cos_angle = std::max(least - kConeSlack, -1.0f);
    return cone;
}

/// Without room for more, and without what it had once.
template <class T>
void resizeTight(std::vector<T>& elements, size_t count) {
    if (elements.capacity() < count || elements.capacity() > count + count / 4) {
        std::vector<T>().swap(elements);
        elements.reserve(count);
    }
    elements.resize(count);
}

template <class T>
size_t bytesOf(const std::vector<T>& elements) {
    return elements.capacity() * sizeof(T);
}

}  // namespace

size_t DrawChunks::bytes() const {
    size_t bytes = bytesOf(chunk_) + bytesOf(face_) + bytesOf(slice_) + bytesOf(unused_);
    for (const LiveChunk& chunk : chunk_)
        bytes += bytesOf(chunk.mesh.position) + bytesOf(chunk.mesh.normal) +
                 bytesOf(chunk.mesh.triangle) + bytesOf(chunk.mesh.colour) +
                 bytesOf(chunk.mesh.scalar);
    for (const auto* lists : {&face_, &slice_})
        for (const std::vector<uint32_t>& list : *lists) bytes += bytesOf(list);
    return bytes;
}

void DrawChunks::update(ActiveMesh& mesh) {
    std::vector<uint8_t>& touched = mesh.chunk_touched;
    if (touched.empty()) {
        touched.assign(2, 1);
        chunk_.resize(2);
        chunk_[1].closed = true;
    }
    chunk_.resize(touched.size());
    face_.resize(touched.size());
    if (std::find(touched.begin(), touched.end(), 1) == touched.end()) return;
    list(mesh);
    bool given = false;
    for (uint32_t c = 0; c < face_.size(); ++c)
        if (touched[c] && !face_[c].empty() && face_[c].size() < kFew) given |= giveAway(mesh, c);
    if (given) list(mesh);
    for (uint32_t c = 0; c < face_.size();)  // which cutting adds to, also before c
        c = face_[c].size() > kMost ? std::min(c, cut(mesh, c)) : c + 1;
    std::vector<uint32_t> changed;
    for (uint32_t c = 0; c < touched.size(); ++c)
        if (touched[c]) changed.push_back(c);
    ++version_;
    parallelFor(changed.size(), [&](size_t i) { make(mesh, changed[i]); });
    for (const uint32_t c : changed)
        if (chunk_[c].version == 0) unused_.push_back(c);
    std::fill(touched.begin(), touched.end(), 0);
    for (const uint32_t c : changed) resizeTight(face_[c], 0);
}

/// The faces of what has changed, in their order.
void DrawChunks::list(const ActiveMesh& mesh) {
    constexpr size_t kSlice = 1 << 14;
    for (auto& faces : face_) faces.clear();
    slice_.resize((mesh.faceCount() + kSlice - 1) / kSlice);
    parallelFor(slice_.size(), [&](size_t i) {
        slice_[i].clear();
        const size_t end = std::min(mesh.faceCount(), (i + 1) * kSlice);
        for (size_t f = i * kSlice; f < end; ++f)
            if (mesh.chunk_touched[mesh.face[f].chunk()]) slice_[i].push_back(uint32_t(f));
    });
    for (auto& faces : slice_) {
        for (const uint32_t f : faces) face_[mesh.face[f].chunk()].push_back(f);
        resizeTight(faces, 0);
    }
}

/// To the first one that it borders on and that has room for it. False if there is none.
bool DrawChunks::giveAway(ActiveMesh& mesh, uint32_t chunk) {
    const size_t room = kMost - face_[chunk].size();
    for (const uint32_t f : face_[chunk])
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t twin = mesh.twinOf(4 * f + k);
            if (twin == kNoCorner) continue;
            const uint32_t other = mesh.face[twin >> 2].chunk();
            if (other == chunk || chunk_[other].mesh.triangleCount() > room) continue;
            for (const uint32_t g : face_[chunk]) mesh.face[g].left[3] = other;
            mesh.chunk_touched[other] = 1;
            return true;
        }
    return false;
}

/// Half of it goes to another one, which is returned.
uint32_t DrawChunks::cut(ActiveMesh& mesh, uint32_t chunk) {
    std::vector<uint32_t>& faces = face_[chunk];
    Box3i box;
    for (const uint32_t f : faces) box.add(mesh.vertex[mesh.face[f].vertex[0]].position());
    const Vec3i size = box.max - box.min;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const auto key = [&](uint32_t f) {
        return mesh.vertex[mesh.face[f].vertex[0]].position()[axis];
    };
    const auto middle = faces.begin() + ptrdiff_t(faces.size() / 2);
    std::nth_element(faces.begin(), middle, faces.end(), [&](uint32_t a, uint32_t b) {
        return key(a) != key(b) ? key(a) < key(b) : a < b;
    });
    std::vector<uint32_t> rest(middle, faces.end());
    faces.erase(middle, faces.end());
    std::sort(faces.begin(), faces.end());
    std::sort(rest.begin(), rest.end());
    uint32_t other = uint32_t(chunk_.size());
    if (unused_.empty()) {
        chunk_.emplace_back();
        face_.emplace_back();
        mesh.chunk_touched.push_back(0);
    } else {
        other = unused_.back();
        unused_.pop_back();
    }
    chunk_[other].closed = chunk_[chunk].closed;
    for (const uint32_t f : rest) mesh.face[f].left[3] = other;
    face_[other] = std::move(rest);
    mesh.chunk_touched[other] = 1;
    return other;
}

void DrawChunks::make(const ActiveMesh& mesh, uint32_t index) {
    thread_local Places places;
    thread_local std::vector<uint32_t> used;
    places.clear();
    const int shift = mesh.source().lattice.shift;
    LiveChunk& chunk = chunk_[index];
    chunk.version = face_[index].empty() ? 0 : version_;
    used.clear();
    resizeTight(chunk.mesh.triangle, face_[index].size());
    for (size_t i = 0; i < face_[index].size(); ++i)
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t v = mesh.face[face_[index][i]].vertex[k];
            uint32_t& place = places[v];
            if (place == kNone) {
                place = uint32_t(used.size());
                used.push_back(v);
            }
            chunk.mesh.triangle[i][k] = place;
        }
    resizeTight(chunk.mesh.position, used.size());
    resizeTight(chunk.mesh.normal, used.size());
    const WordLayout layout = mesh.source().layout;
    resizeTight(chunk.mesh.colour, used.size() * layout.colours);
    resizeTight(chunk.mesh.scalar, used.size() * layout.scalars);
    Box3i box;
    for (size_t i = 0; i < used.size(); ++i) {
        const Vertex& v = mesh.vertex[used[i]];
        chunk.mesh.position[i] = drawnPosition(v, shift);
        chunk.mesh.normal[i] = unpackNormal(v.normal);
        if (layout.words() > 0)
            setVertex(mesh.source().wordsOf(mesh.pulse[used[i]].name, mesh.record[used[i]].last),
                      layout, chunk.mesh, i);
        box.add(chunk.mesh.position[i]);
    }
    chunk.box = box;
    const Vec3f centre = 0.5f * (Vec3f(box.min) + Vec3f(box.max));
    uint32_t error = 0;
    chunk.bounds = chunk.saturated = {centre, 0};
    for (size_t i = 0; i < used.size(); ++i) {
        const VertexCriteria& c = mesh.criteria[used[i]];
        const float away = distance(centre, chunk.mesh.position[i]);
        chunk.bounds.radius = std::max(chunk.bounds.radius, away);
        const auto radius = float(decodeRadius(c.split_radius) << shift);
        chunk.saturated.radius = std::max(chunk.saturated.radius, away + radius);
        error = std::max<uint32_t>(error, c.split_error);
    }
    chunk.cone = chunk.closed ? coneOf(chunk.mesh) : NormalCone{};
    chunk.error = float(double(decodeError(error)) * kErrorUnit * double(1 << shift));
    constexpr uint32_t kCodesAnOctave = 8;
    chunk.level = uint16_t((kMaxErrorCode - error) / kCodesAnOctave);
}

}  // namespace pietra::pmesh
