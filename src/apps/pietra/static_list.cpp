#include "apps/pietra/static_list.h"

#include <meshoptimizer.h>

#include <map>

namespace pietra {
namespace {

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
    to.insert(to.end(), from.begin(), from.end());
}

void appendMesh(Mesh& all, const Mesh& mesh) {
    const auto first = uint32_t(all.vertexCount());
    for (const Triangle& t : mesh.triangle)
        all.triangle.push_back({t[0] + first, t[1] + first, t[2] + first});
    append(all.position, mesh.position);
    append(all.normal, mesh.normal);
    append(all.colour, mesh.colour);
    append(all.scalar, mesh.scalar);
}

template <class T>
void remapVertices(std::vector<T>& stream, const std::vector<unsigned>& remap, size_t count) {
    if (stream.empty()) return;
    const size_t width = stream.size() / remap.size();
    std::vector<T> out(count * width);
    meshopt_remapVertexBuffer(out.data(), stream.data(), remap.size(), width * sizeof(T),
                              remap.data());
    stream = std::move(out);
}

void remapAll(Mesh& mesh, const std::vector<unsigned>& remap, size_t count) {
    uint32_t* indices = mesh.triangle.data()->data();
    meshopt_remapIndexBuffer(indices, indices, 3 * mesh.triangleCount(), remap.data());
    remapVertices(mesh.position, remap, count);
    remapVertices(mesh.normal, remap, count);
    remapVertices(mesh.colour, remap, count);
    remapVertices(mesh.scalar, remap, count);
}

void weld(Mesh& mesh) {
    std::vector<meshopt_Stream> streams{{mesh.position.data(), sizeof(Vec3i), sizeof(Vec3i)},
                                        {mesh.normal.data(), sizeof(OctNormal), sizeof(OctNormal)}};
    if (!mesh.colour.empty()) streams.push_back({mesh.colour.data(), sizeof(Rgba8), sizeof(Rgba8)});
    const size_t width = mesh.scalar.size() / mesh.vertexCount() * sizeof(float);
    if (width > 0) streams.push_back({mesh.scalar.data(), width, width});
    std::vector<unsigned> remap(mesh.vertexCount());
    const size_t count = meshopt_generateVertexRemapMulti(
        remap.data(), mesh.triangle.data()->data(), 3 * mesh.triangleCount(), remap.size(),
        streams.data(), streams.size());
    remapAll(mesh, remap, count);
}

void order(Mesh& mesh) {
    uint32_t* indices = mesh.triangle.data()->data();
    const size_t corners = 3 * mesh.triangleCount();
    meshopt_optimizeVertexCache(indices, indices, corners, mesh.vertexCount());
    std::vector<unsigned> remap(mesh.vertexCount());
    const size_t count =
        meshopt_optimizeVertexFetchRemap(remap.data(), indices, corners, mesh.vertexCount());
    remapAll(mesh, remap, count);
}

}  // namespace

StaticList::StaticList(const ModelReader& model, std::span<const DrawPatch> patches, PageKey key,
                       PageSink* sink)
    : key_(key), sink_(sink) {
    std::map<uint32_t, std::vector<Mesh>> pages;
    Mesh both[2];
    for (const DrawPatch& patch : patches) {
        if (patch.mesh == nullptr && !pages.contains(patch.page.page))
            model.decode(patch.page.page, pages[patch.page.page]);
        appendMesh(both[patch.one_sided],
                   patch.mesh ? *patch.mesh : pages[patch.page.page][patch.patch]);
    }
    for (const bool one_sided : {false, true}) {
        if (both[one_sided].triangle.empty()) continue;
        weld(both[one_sided]);
        order(both[one_sided]);
        DrawPatch patch{.one_sided = one_sided};
        patch.page = key;
        patch.patch = uint32_t(mesh_.size());
        patches_.push_back(patch);
        mesh_.push_back(std::move(both[one_sided]));
    }
    for (size_t i = 0; i < mesh_.size(); ++i) patches_[i].mesh = &mesh_[i];
    if (sink_ != nullptr) drawable_ = sink_->upload(key_, mesh_);
}

StaticList::~StaticList() {
    if (sink_ != nullptr && drawable_) sink_->release(key_);
}

}  // namespace pietra
