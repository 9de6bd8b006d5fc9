#pragma once
// Memory of a renderer's own, which pages must be copied to before it can draw them: all that a
// runtime sees of such a renderer. One without has no sink; it draws meshes where they are.

#include <cstddef>
#include <span>

#include "geometry/mesh.h"
#include "multires/draw_list.h"

namespace pietra {

class PageSink {
public:
    virtual ~PageSink() = default;
    /// Copies a page's patches; `key` must not be in use. All those with vertices must have the
    /// same attributes, normals among them, and extents below 2^21 lattice units. False where there
    /// is no room for the page, and nothing has changed: free bytes may lie scattered.
    virtual bool upload(PageKey key, std::span<const Mesh> patches) = 0;
    /// Makes room; what was drawn of the page stays in the picture. The key may be used again.
    virtual void release(PageKey key) = 0;
    /// False if uploading so many bytes now would wait, and need not later.
    virtual bool mayUpload(size_t bytes) = 0;
    /// What pages take now, and what there is for them.
    virtual size_t usedBytes() const = 0;
    virtual size_t capacityBytes() const = 0;
};

}  // namespace pietra
