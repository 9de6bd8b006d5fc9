#include "coarsen/vertex_table.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/parallel.h"

namespace pietra {

namespace {

constexpr size_t kBlockVertices = 1 << 14;  // records resolved together: they stay in the L2 cache

Lattice chooseLattice(const Box3d& box, const std::string& input_name,
                      const PrecisionSetting& precision) {
    const Vec3d span = box.max - box.min;
    const double extent = std::max({span.x, span.y, span.z});
    if (!std::isfinite(extent) || (extent > 0 && extent < 1e-290))
        throw InputError(
            input_name, "",
            fmt::format("the coordinates span {}, which no lattice of 21 bits can hold", extent));
    Lattice lattice;
    lattice.origin = box.min;
    lattice.step = extent > 0 ? extent / kLatticeMax : 1;
    if (precision.kind == PrecisionSetting::Kind::kStep) {
        if (precision.step * kLatticeMax < extent)
            throw UsageError(fmt::format(
                "--precision {}: the model spans {}, so the finest step that 21 bits allow is {}",
                precision.step, extent, extent / kLatticeMax));
        lattice.step = precision.step;
        while (lattice.shift < kMaxLatticeShift && lattice.step / 2 * kLatticeMax >= extent) {
            lattice.step /= 2;
            ++lattice.shift;
        }
    }
    return lattice;
}

int32_t quantise(double x, double origin, double step) {
    return std::clamp(int32_t(std::floor((x - origin) / step + 0.5)), 0, kLatticeMax);
}

}  // namespace

VertexTable::VertexTable(TriangleSource& source, const std::string& input_name,
                         const PrecisionSetting& precision, TempSpace& space, Progress& progress)
    : record_(source.schema()), records_(space) {
    const Box3d box = readBounds(source, progress);
    if (count_ == 0) throw InputError(input_name, "", "there are no vertices");
    lattice_ = chooseLattice(box, input_name, precision);
    writeRecords(source, progress);
}

VertexTable::VertexTable(const AttributeSchema& schema, TempSpace& space, StateReader& state)
    : record_(schema), records_(space) {
    state.get(lattice_);
    state.get(bounds_);
    state.get(count_);
    state.get(scalar_range_);
}

void VertexTable::save(StateWriter& state) const {
    state.put(lattice_);
    state.put(bounds_);
    state.put(count_);
    state.put(scalar_range_);
}

Box3d VertexTable::readBounds(TriangleSource& source, Progress& progress) {
    progress.beginStage("read vertices", source.vertexCount());
    Box3d box;
    std::vector<float> low(record_.scalar_count, HUGE_VALF), high(record_.scalar_count, -HUGE_VALF);
    VertexBatch batch;
    source.rewindVertices();
    while (source.readVertices(batch)) {
        for (const Vec3d& p : batch.position) box.add(p);
        for (size_t i = 0; i < batch.scalar.size(); ++i) {
            if (!std::isfinite(batch.scalar[i])) continue;
            const size_t s = i % record_.scalar_count;
            low[s] = std::min(low[s], batch.scalar[i]);
            high[s] = std::max(high[s], batch.scalar[i]);
        }
        count_ += batch.position.size();
        progress.tick(batch.position.size());
    }
    for (size_t s = 0; s < low.size(); ++s)
        scalar_range_.push_back(low[s] <= high[s] ? high[s] - low[s] : 0);
    return box;
}

void VertexTable::writeRecords(TriangleSource& source, Progress& progress) {
    progress.beginStage("snap vertices", count_);
    VertexBatch batch;
    std::vector<std::byte> out;
    source.rewindVertices();
    while (source.readVertices(batch)) {
        const size_t count = batch.position.size();
        out.resize(count * record_.bytes);
        parallelForSlices(count, 8192, [&](size_t begin, size_t end) {
            for (size_t i = begin; i < end; ++i) {
                std::byte* record = out.data() + i * record_.bytes;
                const Vec3d& p = batch.position[i];
                const Vec3i q{quantise(p.x, lattice_.origin.x, lattice_.step),
                              quantise(p.y, lattice_.origin.y, lattice_.step),
                              quantise(p.z, lattice_.origin.z, lattice_.step)};
                const uint64_t key = latticeKey(q);
                std::memcpy(record, &key, 8);
                if (record_.normals) {
                    const OctNormal normal = encodeNormal(batch.normal[i]);
                    std::memcpy(record + record_.normal_offset, &normal, 4);
                }
                if (record_.colours)
                    std::memcpy(record + record_.colour_offset, &batch.colour[i], 4);
                if (record_.scalar_count)
                    std::memcpy(record + record_.scalar_offset,
                                &batch.scalar[i * record_.scalar_count], 4 * record_.scalar_count);
            }
        });
        for (size_t i = 0; i < count; ++i)
            bounds_.add(latticePoint(VertexRecord::key(out.data() + i * record_.bytes)));
        records_.append(out);
        progress.tick(count);
    }
}

float VertexTable::quantisationError() const {
    // Half a step an axis onto the fine lattice, then half a step of the sub-lattice.
    const double axis = lattice_.shift == 0 ? 0.5 : 0.5 + double(1 << lattice_.shift) / 2;
    return float(std::sqrt(3.0) * axis * (1 + 1e-6));
}

void VertexTable::gather(std::span<const std::array<uint64_t, 3>> index,
                         std::vector<std::byte>& corners, bool keys_only) const {
    const size_t bytes = keys_only ? 8 : record_.bytes;
    const size_t corner_count = 3 * index.size();
    CHECK_LT(corner_count, size_t(1) << 32);
    corners.resize(corner_count * bytes);
    if (index.empty()) return;
    const std::span<const uint64_t> vertex(index.data()->data(), corner_count);
    // Corners in order of the block that they need (a counting sort), then block by block.
    const size_t block_count = size_t((count_ + kBlockVertices - 1) / kBlockVertices);
    std::vector<uint32_t> start(block_count + 1, 0), order(corner_count);
    for (uint64_t v : vertex) ++start[size_t(v / kBlockVertices) + 1];
    std::vector<uint32_t> used;
    for (size_t b = 0; b < block_count; ++b) {
        if (start[b + 1] != 0) used.push_back(uint32_t(b));
        start[b + 1] += start[b];
    }
    {
        std::vector<uint32_t> next(start.begin(), start.end() - 1);
        for (size_t c = 0; c < corner_count; ++c)
            order[next[size_t(vertex[c] / kBlockVertices)]++] = uint32_t(c);
    }
    const int shift = lattice_.shift;
    parallelForSlices(used.size(), 8, [&](size_t begin, size_t end) {
        std::vector<std::byte> block;
        for (size_t u = begin; u < end; ++u) {
            const size_t b = used[u];
            const uint64_t first = uint64_t(b) * kBlockVertices;
            block.resize(size_t(std::min<uint64_t>(kBlockVertices, count_ - first)) *
                         record_.bytes);
            records_.read(first * record_.bytes, block);
            for (uint32_t i = start[b]; i < start[b + 1]; ++i) {
                const uint32_t c = order[i];
                std::byte* to = corners.data() + size_t(c) * bytes;
                std::memcpy(to, block.data() + size_t(vertex[c] - first) * record_.bytes, bytes);
                const uint64_t key =
                    latticeKey(snapToShift(latticePoint(VertexRecord::key(to)), shift));
                std::memcpy(to, &key, 8);
            }
        }
    });
}

}  // namespace pietra
