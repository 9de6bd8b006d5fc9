#include "io/stl_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "io/stl_facets.h"

namespace pietra {

namespace {

class StlSource : public TriangleSource {
public:
    StlSource(std::unique_ptr<ByteReader> reader, std::unique_ptr<StlFacets> facets)
        : reader_(std::move(reader)),
          facets_(std::move(facets)),
          place_(facets_->start()),
          facet_count_(facets_->count()),
          // A triangle takes some bytes, so a small file needs no large batch.
          batch_corners_(
              3 * size_t(std::min<uint64_t>(kBatchFacets, reader_->source().lengthBound()))) {
        reader_->release();
    }

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return 3 * facetCount(); }
    uint64_t triangleCountHint() override {
        return facet_count_ ? *facet_count_ : reader_->source().storedBytes() / kUsualTextBytes + 1;
    }
    uint64_t inputBytes() const override { return reader_->source().storedBytes(); }
    bool cheapToReread() const override {
        return facets_->count() && !reader_->source().isCompressed();
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
    /// Few enough that a batch stays in the processor's cache while it is used.
    static constexpr uint64_t kBatchFacets = 2048;
    static_assert(3 * kBatchFacets <= kMaxBatch);
    /// About as many bytes as writers spend on a facet of a text.
    static constexpr uint64_t kUsualTextBytes = 260;

    size_t readBlock(StlPlace& place, std::vector<Vec3d>& corners);
    uint64_t facetCount();

    std::unique_ptr<ByteReader> reader_;
    std::unique_ptr<StlFacets> facets_;
    AttributeSchema schema_;
    StlPlace place_;  ///< of the vertices read next
    std::optional<uint64_t> facet_count_;
    size_t batch_corners_;
    uint64_t triangles_read_ = 0;
};

/// Returns how many facets `corners` then holds, none at the end.
size_t StlSource::readBlock(StlPlace& place, std::vector<Vec3d>& corners) {
    corners.resize(batch_corners_);
    const size_t facets = facets_->read(place, corners);
    corners.resize(3 * facets);
    if (facet_count_ && (facets == 0 ? place.facet != *facet_count_ : place.facet > *facet_count_))
        throw InputError(reader_->path(), "", "has changed while it was read");
    if (facets == 0) {
        if (place.facet == 0)
            throw InputError(reader_->path(), "", "has no triangles: nothing to show");
        facet_count_ = place.facet;
    }
    return facets;
}

uint64_t StlSource::facetCount() {
    std::vector<Vec3d> dropped;
    if (!facet_count_)
        for (StlPlace place = facets_->start(); readBlock(place, dropped) > 0;) continue;
    return *facet_count_;
}

bool StlSource::readVertices(VertexBatch& batch) {
    // note: the positions stay, as clearing them first would take as long as decoding.
    std::vector<Vec3d> position = std::move(batch.position);
    batch.restart(3 * place_.facet);
    batch.position = std::move(position);
    return readBlock(place_, batch.position) > 0;
}

bool StlSource::readTriangles(TriangleBatch& batch) {
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

bool isStl(const FileSigns& signs) {
    return beginsAsStlText(signs.head) || signs.name.ends_with(".stl") ||
           isBinaryStlSize(signs.head, signs.bytes);
}

std::unique_ptr<TriangleSource> openStl(std::unique_ptr<ByteReader> reader) {
    auto facets = isStlText(*reader) ? openTextStl(*reader) : openBinaryStl(*reader);
    return std::make_unique<StlSource>(std::move(reader), std::move(facets));
}

}  // namespace pietra
