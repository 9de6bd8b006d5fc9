#include "runtime/export_cut.h"

#include <algorithm>
#include <bit>

#include "base/hash.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

constexpr uint64_t kUnknown = ~uint64_t(0);

/// Open-addressed table from a vertex (position and attributes) to its number in the output.
class BorderVertices {
public:
    explicit BorderVertices(Budget& budget) : budget_(budget) {
        const size_t size = size_t(1) << 8;
        reserved_ = budget_.reserve(size * sizeof(Slot), "a table of border vertices");
        slots_.assign(size, Slot());
    }

    bool wasDropped() const { return dropped_; }

    /// The number that `key` has, or `number`, which it gets if it has none.
    uint64_t findOrAdd(uint64_t position, uint64_t attributes, uint64_t number) {
        if (2 * used_ >= slots_.size()) makeRoom();
        for (size_t i = mixBits(position ^ attributes);; ++i) {
            Slot& slot = slots_[i & (slots_.size() - 1)];
            if (slot.number == kUnknown) {
                slot = {position, attributes, number};
                ++used_;
                return number;
            }
            if (slot.position == position && slot.attributes == attributes) return slot.number;
        }
    }

private:
    struct Slot {
        uint64_t position = 0, attributes = 0, number = kUnknown;
    };

    void makeRoom() {
        const size_t size = 2 * slots_.size();
        Reservation more = budget_.tryReserve(size * sizeof(Slot));
        if (more.bytes() == 0) {
            dropped_ = true;
            std::fill(slots_.begin(), slots_.end(), Slot());
            used_ = 0;
            return;
        }
        std::vector<Slot> old(size, Slot());
        old.swap(slots_);
        used_ = 0;
        for (const Slot& slot : old)
            if (slot.number != kUnknown) findOrAdd(slot.position, slot.attributes, slot.number);
        reserved_ = std::move(more);
    }

    Budget& budget_;
    Reservation reserved_;
    std::vector<Slot> slots_;
    size_t used_ = 0;
    bool dropped_ = false;
};

/// For each vertex 0 if the triangles of the patch close around it: then the edges opposite to it
/// form cycles, and in the sum of their ends minus their starts everything cancels.
void openness(const Mesh& mesh, std::vector<uint64_t>& open) {
    open.assign(mesh.vertexCount(), 0);
    for (const Triangle& t : mesh.triangle)
        for (int k = 0; k < 3; ++k)
            open[t[k]] += mixBits(t[(k + 2) % 3] + 1) - mixBits(t[(k + 1) % 3] + 1);
}

class Exporter {
public:
    Exporter(const ModelReader& model, MeshWriter& writer, Budget& budget)
        : lattice_(model.info().lattice),
          schema_(model.info().schema),
          writer_(writer),
          border_(budget) {}

    void add(const Mesh& mesh) {
        openness(mesh, open_);
        number_.assign(mesh.vertexCount(), kUnknown);
        triangles_.clear();
        clearBatch();
        next_ = writer_.vertexCount();
        for (const Triangle& t : mesh.triangle)
            triangles_.push_back(
                {numberOf(mesh, t[0]), numberOf(mesh, t[1]), numberOf(mesh, t[2])});
        writer_.addVertices(batch_);
        writer_.addTriangles(triangles_);
    }

    bool repeated() const { return border_.wasDropped(); }

private:
    void clearBatch() {
        batch_.position.clear();
        batch_.normal.clear();
        batch_.colour.clear();
        batch_.scalar.clear();
    }

    uint64_t attributesHash(const Mesh& mesh, uint32_t v) const {
        uint64_t hash = 0;
        if (schema_.normals_given)
            hash = mixBits(uint64_t(uint16_t(mesh.normal[v].x)) << 16 | uint16_t(mesh.normal[v].y));
        if (schema_.colours) hash = mixBits(hash ^ std::bit_cast<uint32_t>(mesh.colour[v]));
        const size_t scalars = schema_.scalars.size();
        for (size_t i = 0; i < scalars; ++i)
            hash = mixBits(hash ^ std::bit_cast<uint32_t>(mesh.scalar[v * scalars + i]));
        return hash;
    }

    uint64_t numberOf(const Mesh& mesh, uint32_t v) {
        if (number_[v] != kUnknown) return number_[v];
        number_[v] = next_;
        if (open_[v] != 0)
            number_[v] =
                border_.findOrAdd(latticeKey(mesh.position[v]), attributesHash(mesh, v), next_);
        if (number_[v] == next_) append(mesh, v);
        return number_[v];
    }

    void append(const Mesh& mesh, uint32_t v) {
        ++next_;
        batch_.position.push_back(lattice_.toInput(mesh.position[v]));
        if (schema_.normals_given) batch_.normal.push_back(decodeNormal(mesh.normal[v]));
        if (schema_.colours) batch_.colour.push_back(mesh.colour[v]);
        const size_t scalars = schema_.scalars.size();
        const auto first = mesh.scalar.begin() + std::ptrdiff_t(v * scalars);
        batch_.scalar.insert(batch_.scalar.end(), first, first + std::ptrdiff_t(scalars));
    }

    const Lattice& lattice_;
    const AttributeSchema& schema_;
    MeshWriter& writer_;
    BorderVertices border_;
    uint64_t next_ = 0;
    std::vector<uint64_t> open_, number_;
    std::vector<std::array<uint64_t, 3>> triangles_;
    VertexBatch batch_;
};

}  // namespace

MeshOutput meshOutputOf(const ModelReader& model, const Cut& cut) {
    const ModelInfo& info = model.info();
    Box3d box;
    box.add(info.lattice.toInput(info.bounds.min));
    box.add(info.lattice.toInput(info.bounds.max));
    MeshOutput output;
    output.schema = info.schema;
    output.double_positions = needsDoubles(box, info.lattice.vertexStep());
    output.centre = 0.5 * (box.min + box.max);
    output.expected_triangles = cut.triangles;
    output.comment = "extracted by pietra";
    return output;
}

ExportReport exportCut(const ModelReader& model, const Cut& cut, MeshWriter& writer, Budget& budget,
                       size_t in_flight, Progress& progress) {
    Exporter exporter(model, writer, budget);
    visitInOrder(model, cut.nodes, in_flight, [&](DecodedRun& run) {
        for (const Mesh& mesh : run.patches) exporter.add(mesh);
        progress.tick(run.patches.size());
    });
    writer.finish();
    return {writer.triangleCount(), writer.vertexCount(), exporter.repeated()};
}

}  // namespace pietra
