#include "runtime/live_uploads.h"

#include <algorithm>

namespace pietra {
namespace {

/// What a triangle of a chunk takes, about: half a vertex, some of them twice, and its indices.
constexpr double kTriangleBytes = 16;

}  // namespace

LiveUploads::~LiveUploads() {
    for (uint32_t i = 0; i < models_.size(); ++i)
        for (uint32_t c = 0; c < models_[i].version.size(); ++c) release(i, c);
}

uint64_t LiveUploads::mostTriangles(uint32_t i) const {
    if (sink_ == nullptr) return ~uint64_t(0);
    const size_t own = i < models_.size() ? models_[i].bytes : 0;
    const size_t free =
        sink_->capacityBytes() - std::min(sink_->capacityBytes(), sink_->usedBytes());
    return uint64_t(kUsable * double(own + free) / kTriangleBytes);
}

bool LiveUploads::beginFrame() {
    if (sink_ == nullptr) return true;
    ahead_bytes_ -= std::min(ahead_bytes_, kFrameBytes);
    if (ahead_bytes_ > 0 || !sink_->mayUpload(std::min(last_bytes_, kFrameBytes))) return false;
    last_bytes_ = 0;
    return true;
}

bool LiveUploads::upload(uint32_t i, uint32_t chunk, const LiveChunk& from) {
    const size_t before = sink_->usedBytes();
    if (!sink_->upload({first_model_ + i, chunk}, {&from.mesh, 1})) return false;
    models_[i].version[chunk] = from.version;
    const size_t bytes = sink_->usedBytes() - before;
    for (size_t* sum : {&models_[i].bytes, &bytes_, &last_bytes_, &ahead_bytes_}) *sum += bytes;
    return true;
}

void LiveUploads::release(uint32_t i, uint32_t chunk) {
    if (models_[i].version[chunk] == 0) return;
    const size_t before = sink_->usedBytes();
    sink_->release({first_model_ + i, chunk});
    models_[i].version[chunk] = 0;
    models_[i].bytes -= before - sink_->usedBytes();
    bytes_ -= before - sink_->usedBytes();
}

bool LiveUploads::uploadChanged(uint32_t i, std::span<const LiveChunk> chunks) {
    const auto changed = [&](uint32_t c) { return models_[i].version[c] != chunks[c].version; };
    for (uint32_t c = 0; c < chunks.size(); ++c)
        if (changed(c)) release(i, c);
    bool all = true;
    for (uint32_t c = 0; c < chunks.size(); ++c)
        if (changed(c)) all &= upload(i, c, chunks[c]);
    return all;
}

bool LiveUploads::update(uint32_t i, std::span<const LiveChunk> chunks) {
    if (sink_ == nullptr) return true;
    if (models_.size() <= i) models_.resize(i + 1);
    std::vector<uint64_t>& version = models_[i].version;
    for (auto c = uint32_t(chunks.size()); c < version.size(); ++c) release(i, c);
    version.resize(chunks.size(), 0);
    if (uploadChanged(i, chunks)) return true;
    for (uint32_t c = 0; c < chunks.size(); ++c) release(i, c);
    return uploadChanged(i, chunks);
}

}  // namespace pietra
