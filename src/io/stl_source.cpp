#include "io/stl_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <type_traits>

#include "base/error.h"
#include "io/stl_facets.h"
#include "io/vertex_window.h"

namespace pietra {

namespace {

template <class Real>
class StlSource : public TriangleSource {
public:
    StlSource(std::unique_ptr<ByteReader> reader, std::unique_ptr<StlFacets<Real>> facets)
        : reader_(std::move(reader)), facets_(std::move(facets)) {
        // A triangle takes some bytes, so a small file needs no large block.
        const uint64_t most = reader_->source().lengthBound();
        block_.resize(3 * size_t(std::min<uint64_t>(kBlockFacets, most)));
        rewindVertices();
        rewindTriangles();
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override {
        if (!vertex_count_) {
            Stream stream{facets_->start(), {}};
            std::vector<uint64_t> index(block_.size());
            std::vector<Vec3d> fresh(block_.size());
            while (const size_t corners = readBlock(stream))
                stream.window.weld({block_.data(), corners}, index.data(), fresh.data());
        }
        return *vertex_count_;
    }
    uint64_t triangleCountHint() override {
        return facet_count_ ? *facet_count_ : facets_->countHint();
    }
    uint64_t inputBytes() const override { return reader_->source().storedBytes(); }
    bool cheapToReread() const override {
        return std::is_same_v<Real, float> && !reader_->source().isCompressed();
    }
    std::vector<std::string> notes() const override { return facets_->notes(); }

    void rewindVertices() override { rewind(vertices_); }
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override { rewind(triangles_); }
    bool readTriangles(TriangleBatch& batch) override;

private:
    static constexpr size_t kBlockFacets = 2048;

    struct Stream {
        StlPlace place;
        VertexWindow<Real> window;
    };

    void rewind(Stream& stream) {
        stream.place = facets_->start();
        stream.window.clear();
        reader_->release();
    }

    /// Returns how many corners there are now in block_; none at the end.
    size_t readBlock(Stream& stream) {
        const size_t facets = facets_->read(stream.place, block_);
        if (facets == 0) {
            if (stream.place.facet == 0)
                throw InputError(reader_->path(), "", "has no triangles: nothing to show");
            facet_count_ = stream.place.facet;
            vertex_count_ = stream.window.vertexCount();
        }
        return 3 * facets;
    }

    std::unique_ptr<ByteReader> reader_;
    std::unique_ptr<StlFacets<Real>> facets_;
    AttributeSchema schema_;
    std::optional<uint64_t> facet_count_, vertex_count_;
    std::vector<glm::vec<3, Real>> block_;
    std::vector<uint64_t> index_;  ///< of its corners, where only the positions are wanted
    std::vector<Vec3d> fresh_;     ///< its new positions, where only the indices are wanted
    Stream vertices_, triangles_;
};

template <class Real>
bool StlSource<Real>::readVertices(VertexBatch& batch) {
    batch.first = vertices_.window.vertexCount();
    batch.normal.clear();
    batch.colour.clear();
    batch.scalar.clear();
    batch.position.clear();
    index_.resize(block_.size());
    while (batch.position.size() + block_.size() <= kMaxBatch) {
        const size_t corners = readBlock(vertices_), begin = batch.position.size();
        if (corners == 0) break;
        batch.position.resize(begin + corners);
        const size_t fresh = vertices_.window.weld({block_.data(), corners}, index_.data(),
                                                   batch.position.data() + begin);
        batch.position.resize(begin + fresh);
    }
    return !batch.position.empty();
}

template <class Real>
bool StlSource<Real>::readTriangles(TriangleBatch& batch) {
    batch.first = triangles_.place.facet;
    batch.triangle.clear();
    fresh_.resize(block_.size());
    while (batch.triangle.size() + block_.size() / 3 <= kMaxBatch) {
        const size_t corners = readBlock(triangles_), begin = batch.triangle.size();
        if (corners == 0) break;
        batch.triangle.resize(begin + corners / 3);
        triangles_.window.weld({block_.data(), corners}, batch.triangle[begin].data(),
                               fresh_.data());
    }
    return !batch.triangle.empty();
}

}  // namespace

bool isStl(std::span<const uint8_t> head, const std::string& name) {
    return beginsAsStlText(head) || name.ends_with(".stl");
}

std::unique_ptr<TriangleSource> openStl(std::unique_ptr<ByteReader> reader) {
    if (isStlText(*reader)) {
        auto facets = openTextStl(*reader);
        return std::make_unique<StlSource<double>>(std::move(reader), std::move(facets));
    }
    auto facets = openBinaryStl(*reader);
    return std::make_unique<StlSource<float>>(std::move(reader), std::move(facets));
}

}  // namespace pietra
