#pragma once
// Culls what is hidden, on the GPU alone and without waiting for it: what was seen in the last
// picture is drawn first; then the boxes of all patches are held against the depths there are now,
// and what has come into sight is drawn as well. Nothing that a pixel shows is left out: a patch
// that is not drawn has a box of which no sample is as near as what is drawn.
//
// What was seen is kept for each 256 bytes of the arena, by where a patch's indices begin: where
// two small patches, or one that has gone and one that has come, share them, one may be drawn for
// nothing. Boxes of what is in sight cover the picture many times over, so each of those is looked
// at in one picture of kTurns: what goes out of sight is drawn a little longer. Needs a current
// context.

#include <cstdint>
#include <vector>

#include "gpu/program.h"
#include "render/gl/frame_block.h"

namespace pietra {

/// What the shaders must know of a patch: its box, and where its visibility is kept.
struct CullRecord {
    Vec3i corner;  ///< less the camera's integer part; some room around the patch included
    uint32_t slot;
    Vec3i extent;
    uint32_t always;  ///< not 0: the box is too near the eye to be tested
};
static_assert(sizeof(CullRecord) == 32);

class OcclusionCuller {
public:
    static constexpr size_t kSlotBytes = 256;

    /// For so many draws at a time, and pages in so many bytes. `wait`: the driver's computing does
    /// not wait for its drawing (llvmpipe's does not), so this must.
    OcclusionCuller(size_t draws, size_t arena_bytes, bool wait);

    void nextPicture() { ++turn_; }
    /// Of `count` draws: commands, in a ring, which the records follow; both as bound ranges of
    /// storage, kCommandsBinding and kCullBinding. Leaves in seen() the commands for what was seen
    /// last, others with no instance.
    void begin(size_t count);
    /// After seen() has been drawn; the frame block must be bound. Leaves in found() the commands
    /// for what else is in sight. Changes program, vertex array and depth function; neither depth
    /// nor colour. `all`: looks at everything.
    void end(size_t count, bool all);

    /// Of the last `count` draws: not 0 for those that were not left out. Waits for the GPU: not
    /// for frames.
    std::vector<uint8_t> drawn(size_t count) const;

    /// Buffers of DrawCommand, to draw from.
    GLuint seen() const { return seen_; }
    GLuint found() const { return found_; }

private:
    static constexpr GLuint kTurns = 8;

    void compute(const GlProgram& program, size_t count) const;

    const bool wait_;
    GLuint turn_ = 0;
    GlBuffer seen_, found_, last_, now_;
    GlVertexArray no_vertices_;
    GlProgram begin_, boxes_, end_;
};

}  // namespace pietra
