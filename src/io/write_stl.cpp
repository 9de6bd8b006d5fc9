// Binary STL: every triangle carries its corners. Positions wait in a temporary file, read back
// through a cache of blocks: neighbouring triangles share them, so most corners are there already.

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "io/mesh_writers.h"

namespace pietra {

namespace {

/// Positions on disk, appended and read at random.
class PositionSpool {
public:
    explicit PositionSpool(File file) : file_(std::move(file)), out_(file_), blocks_(kBlocks) {}

    void append(const Vec3f& p) { store(out_.put(sizeof p), p); }

    Vec3f at(uint64_t index) {
        const uint64_t number = index / kBlockPoints;
        Block& block = blocks_[number % kBlocks];
        if (block.number != number || index % kBlockPoints >= block.count) load(block, number);
        return block.points[index % kBlockPoints];
    }

private:
    static constexpr size_t kBlockPoints = 1024;
    static constexpr size_t kBlocks = 2048;  // 24 MiB in all
    struct Block {
        uint64_t number = std::numeric_limits<uint64_t>::max();
        size_t count = 0;
        std::vector<Vec3f> points;
    };

    void load(Block& block, uint64_t number) {
        out_.flush();
        block.number = number;
        block.points.resize(kBlockPoints);
        block.count = file_.readSomeAt(number * kBlockPoints * sizeof(Vec3f), block.points.data(),
                                       kBlockPoints * sizeof(Vec3f)) /
                      sizeof(Vec3f);
    }

    File file_;
    OutputBuffer out_;
    std::vector<Block> blocks_;
};

Vec3f unitNormal(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const Vec3d n = glm::cross(Vec3d(b) - Vec3d(a), Vec3d(c) - Vec3d(a));
    const double length = std::sqrt(glm::dot(n, n));
    return length > 0 ? Vec3f(n / length) : Vec3f(0, 0, 0);
}

class StlWriter : public MeshWriter {
public:
    StlWriter(const std::string& path, bool force, const MeshOutput& output)
        : MeshWriter(output),
          path_(path),
          file_(path, force),
          out_(file_.file()),
          positions_(temporaryBeside(path)) {
        checkCounts(output.expected_vertices, output.expected_triangles);
        // note: a binary file must not begin with "solid", or it is taken for a text.
        out_.write(std::string(kHeaderBytes + 4, '\0'));
    }

    void finish() override {
        out_.flush();
        std::string header = "binary STL";
        header.resize(kHeaderBytes, ' ');
        file_.file().writeAt(0, header.data(), header.size());
        const auto count = uint32_t(triangleCount());
        file_.file().writeAt(kHeaderBytes, &count, sizeof count);
        file_.commit();
    }

    std::vector<std::string> notes() const override {
        std::vector<std::string> notes;
        if (output_.double_positions) notes.push_back("an STL file rounds positions to floats");
        if (output_.schema.normals_given || output_.schema.colours ||
            !output_.schema.scalars.empty())
            notes.push_back("an STL file holds no attributes of vertices: they are left out");
        return notes;
    }

protected:
    void checkCounts(uint64_t, uint64_t triangles) const override {
        if (triangles > UINT32_MAX)
            throw UsageError(path_ + ": an STL file holds at most 2^32 - 1 triangles");
    }

    void putVertices(const VertexBatch& batch) override {
        for (const Vec3d& p : batch.position) positions_.append(Vec3f(p));
    }

    void putTriangles(std::span<const std::array<uint64_t, 3>> triangles) override {
        for (const auto& t : triangles) {
            const Vec3f a = positions_.at(t[0]), b = positions_.at(t[1]), c = positions_.at(t[2]);
            uint8_t* out = store(out_.put(50), unitNormal(a, b, c));
            for (const Vec3f& p : {a, b, c}) out = store(out, p);
            store(out, uint16_t(0));
        }
    }

private:
    static constexpr size_t kHeaderBytes = 80;
    std::string path_;
    AtomicFile file_;
    OutputBuffer out_;
    PositionSpool positions_;
};

}  // namespace

std::unique_ptr<MeshWriter> createStl(const std::string& path, bool force,
                                      const MeshOutput& output) {
    return std::make_unique<StlWriter>(path, force, output);
}

}  // namespace pietra
