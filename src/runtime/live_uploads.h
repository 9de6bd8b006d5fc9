#pragma once
// Chunks of adapted meshes in a renderer's own memory (multires/page_sink.h), where they are copied
// anew when they have changed. Pages are those of models from a first number on, a chunk each.
//
// A mesh is copied as a whole or not at all: of all that has changed, or there would be cracks. So
// where frames copy too much, or copying would wait, meshes stay as they are for some frames.
//
// Sinks may have room, but not in one piece: then all chunks are taken out and copied again, side
// by side. Whoever adapts meshes keeps them so small that this does: mostTriangles().

#include <cstdint>
#include <span>
#include <vector>

#include "multires/live_model.h"
#include "multires/page_sink.h"

namespace pietra {

class LiveUploads {
public:
    /// Of what is free, as long as it may lie in pieces.
    static constexpr double kUsable = 0.6;

    /// `sink` must outlive this; null: meshes are drawn where they are, and there is nothing to do.
    LiveUploads(PageSink* sink, uint32_t first_model) : sink_(sink), first_model_(first_model) {}
    ~LiveUploads();
    LiveUploads(const LiveUploads&) = delete;
    LiveUploads& operator=(const LiveUploads&) = delete;

    /// Once a frame: whether what is adapted in it may be copied. A frame copies kFrameBytes on
    /// average.
    [[nodiscard]] bool beginFrame();
    static constexpr size_t kFrameBytes = size_t(4) << 20;

    /// What chunks there take now.
    size_t bytes() const { return bytes_; }
    /// Of model i, if others stay as they are.
    uint64_t mostTriangles(uint32_t i) const;
    /// Of model i, as chunks are now. False if not all of them are there: there is no room, and the
    /// mesh must get coarser before it is drawn.
    [[nodiscard]] bool update(uint32_t i, std::span<const LiveChunk> chunks);

private:
    struct Model {
        std::vector<uint64_t> version;  ///< of each chunk there; 0: none
        size_t bytes = 0;
    };
    bool upload(uint32_t i, uint32_t chunk, const LiveChunk& from);
    void release(uint32_t i, uint32_t chunk);
    bool uploadChanged(uint32_t i, std::span<const LiveChunk> chunks);

    PageSink* sink_;
    const uint32_t first_model_;
    std::vector<Model> models_;
    size_t bytes_ = 0;
    size_t last_bytes_ = 0;   // copied by the last frame that did
    size_t ahead_bytes_ = 0;  // copied, of what frames to come may
};

}  // namespace pietra
