#pragma once
// The run-time side of models whose pages are operations on one mesh (adaptive_model.h): that mesh,
// adapted to a view frame by frame, with the pages that there are. A method makes one from an open
// file (method.h).
//
// A frame: pages that others have read arrive(), then adapt(), then chunks() are drawn, and of
// requests() and prefetch() some are read. Whatever has arrived, the mesh is valid and crack-free;
// nothing here touches a file, and no page, however damaged, makes it throw.
//
// One thread calls, but for decode().

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "geometry/bounds.h"
#include "geometry/mesh.h"
#include "multires/seen_depth.h"
#include "multires/view.h"

namespace pietra {

class ModelReader;

/// A page as the method keeps it.
class LivePage {
public:
    virtual ~LivePage() = default;
};

/// A part of the mesh that is drawn, by itself: vertices on its border are in others, too.
struct LiveChunk {
    Mesh mesh;
    Box3i box;             ///< of its vertices, lattice units
    Sphere bounds;         ///< likewise
    uint64_t version = 0;  ///< another one when the mesh has changed; 0: it is empty
    /// The largest error that is stated of a part of it and not refined any more, and its sphere.
    float error = 0;
    Sphere saturated;
    bool closed = false;  ///< as Node::closed: may be culled by its cone, drawn one-sided
    NormalCone cone;      ///< of its triangles' normals, if it is closed
    uint16_t level = 0;   ///< by how many halvings of the error it is finer than the coarsest
};

/// What lies between `low` and `high` along two axes, lattice units: of triangles their middles,
/// `high` excluded.
struct LiveColumn {
    std::array<int, 2> axis{0, 1};
    std::array<int32_t, 2> low{}, high{};
    bool holds(const Vec3i& a, const Vec3i& b, const Vec3i& c) const {
        for (size_t i = 0; i < 2; ++i) {
            const int64_t sum = int64_t(a[axis[i]]) + int64_t(b[axis[i]]) + int64_t(c[axis[i]]);
            if (sum < 3 * int64_t(low[i]) || sum >= 3 * int64_t(high[i])) return false;
        }
        return true;
    }
};

struct LiveTask {
    const View* view = nullptr;
    const SeenDepth* seen = nullptr;  ///< what it hides may be coarser; null: nothing is hidden
    double pixels = 1;                ///< what shows as more is refined; 0: all is
    /// With 0 pixels: all that has to do with what lies in there, and no more than that needs.
    const LiveColumn* column = nullptr;
    /// For adaption, about; some is always done.
    double milliseconds = std::numeric_limits<double>::infinity();
    bool only_look = false;     ///< nothing is adapted; but what is needed is found
    size_t most_bytes = 0;      ///< at least what it holds
    size_t arriving_bytes = 0;  ///< beside these: of pages on their way, whose room is kept
    uint64_t most_triangles = std::numeric_limits<uint64_t>::max();
};

/// What a frame did.
struct LiveFrame {
    uint32_t operations = 0;
    bool busy = false;  ///< there was not enough time for all that could be done
    /// Something that is needed does not fit most_bytes or most_triangles, and nothing else can be
    /// done.
    bool short_of_memory = false, short_of_triangles = false;
    size_t missing = 0;       ///< pages that are needed, and not known to be damaged
    size_t needed_bytes = 0;  ///< of what it holds, or asks for, what this view uses
    double largest_px = 0;    ///< of error in the picture; infinite in a sphere not refined
    uint64_t triangles = 0;
};

class LiveModel {
public:
    virtual ~LiveModel() = default;

    /// Thread-safe. Null for damaged bytes, with a sentence in `fault`; never throws.
    virtual std::unique_ptr<LivePage> decode(uint32_t page, std::span<const std::byte> bytes,
                                             std::string& fault) const = 0;
    /// A page that was asked for; null: it cannot be had, and will not be asked for again. False,
    /// and nothing done, if there is no room for it, or it is not to be had before another one.
    [[nodiscard]] virtual bool arrive(uint32_t page, const LivePage* decoded) = 0;

    virtual const LiveFrame& adapt(const LiveTask& task) = 0;
    /// Valid until the next adapt().
    virtual std::span<const LiveChunk> chunks() const = 0;
    /// Pages that are needed, at most so many, the most urgent first.
    virtual std::vector<uint32_t> requests(size_t most) const = 0;
    /// At most so many that another view may need, those first that others depend on; none that
    /// would drive out what was used lately.
    virtual std::vector<uint32_t> prefetch(const View& view, double pixels, size_t most) = 0;

    /// What it holds, and what a page adds to that, at most.
    virtual size_t bytes() const = 0;
    virtual size_t pageBytes() const = 0;
    /// Lets go of about so many bytes that the last frame did not need. Of how many?
    virtual size_t release(size_t bytes) = 0;
    /// Sentences about what was found to be damaged since it was made, pages apart.
    virtual std::span<const std::string> faults() const = 0;
};

/// Of a model whose pages are not patches; the reader must outlive it. Throws InputError.
using OpenLive = std::unique_ptr<LiveModel> (*)(const ModelReader& reader);

}  // namespace pietra
