#include "io/stl_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <type_traits>

#include "base/error.h"
#include "io/stl_facets.h"

namespace pietra {

namespace {

template <class Real>
class StlSource : public TriangleSource {
public:
    StlSource(std::unique_ptr<ByteReader> reader, std::unique_ptr<StlFacets<Real>> facets)
        : reader_(std::move(reader)),
          facets_(std::move(facets)),
          place_(facets_->start()),
          facet_count_(facets_->count()) {
        reader_->release();
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return 3 * facetCount(); }
    uint64_t triangleCountHint() override {
        return facet_count_ ? *facet_count_ : reader_->source().storedBytes() / kUsualTextBytes + 1;
    }
    uint64_t inputBytes() const override { return reader_->source().storedBytes(); }
    bool cheapToReread() const override {
        return std::is_same_v<Real, float> && !reader_->source().isCompressed();
    }
    std::vector<std::string> notes() const override { return facets_->notes(); }

    void rewindVertices() override {
        place_ = facets_->start();
        reader_->release();
    }
    bool readVertices(VertexBatch& batch) override;
    void rewindTriangles() override { triangles_read_ = 0; }
    bool readTriangles(TriangleBatch& batch) override;

private:
    static constexpr size_t kBlockFacets = 2048;
    static_assert(3 * kBlockFacets <= kMaxBatch);
    /// About as many bytes as writers spend on a facet of a text.
    static constexpr uint64_t kUsualTextBytes = 260;

    size_t readBlock(StlPlace& place);
    uint64_t facetCount();

    std::unique_ptr<ByteReader> reader_;
    std::unique_ptr<StlFacets<Real>> facets_;
    AttributeSchema schema_;
    StlPlace place_;  ///< of the vertices read next
    std::optional<uint64_t> facet_count_;
    std::vector<glm::vec<3, Real>> block_;
    uint64_t triangles_read_ = 0;
};

/// Fills block_; returns how many facets it holds, none at the end.
template <class Real>
size_t StlSource<Real>::readBlock(StlPlace& place) {
    // A triangle takes some bytes, so a small file needs no large block.
    block_.resize(3 * size_t(std::min<uint64_t>(kBlockFacets, reader_->source().lengthBound())));
    const size_t facets = facets_->read(place, block_);
    if (facets == 0) {
        if (place.facet == 0)
            throw InputError(reader_->path(), "", "has no triangles: nothing to show");
        facet_count_ = place.facet;
    }
    return facets;
}

template <class Real>
uint64_t StlSource<Real>::facetCount() {
    if (!facet_count_)
        for (StlPlace place = facets_->start(); readBlock(place) > 0;) continue;
    return *facet_count_;
}

template <class Real>
bool StlSource<Real>::readVertices(VertexBatch& batch) {
    batch.first = 3 * place_.facet;
    batch.position.clear();
    batch.normal.clear();
    batch.colour.clear();
    batch.scalar.clear();
    while (batch.position.size() + 3 * kBlockFacets <= kMaxBatch) {
        const size_t corners = 3 * readBlock(place_), begin = batch.position.size();
        if (corners == 0) break;
        batch.position.resize(begin + corners);
        std::copy_n(block_.begin(), corners, batch.position.begin() + ptrdiff_t(begin));
    }
    return !batch.position.empty();
}

template <class Real>
bool StlSource<Real>::readTriangles(TriangleBatch& batch) {
    batch.first = triangles_read_;
    const uint64_t end = std::min(triangles_read_ + kMaxBatch, facetCount());
    batch.triangle.resize(size_t(end - triangles_read_));
    uint64_t corner = 3 * triangles_read_;
    for (auto& t : batch.triangle) {
        t = {corner, corner + 1, corner + 2};
        corner += 3;
    }
    triangles_read_ = end;
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
