#pragma once
// All collapses of a model, and what remains: what construction hands to the encoder. In temporary
// space; in memory is the base mesh alone.

#include <span>
#include <vector>

#include "base/state.h"
#include "extmem/cached_records.h"
#include "extmem/spill.h"
#include "geometry/mesh.h"
#include "methods/pmesh/recorder.h"

namespace pietra::pmesh {

/// A vertex in the links of a model: its number if it has one only. A vertex that lay on the border
/// of several diamonds when it first came has got a number in each: it is the key of its place in
/// the input, marked.
using VertexId = uint64_t;
inline constexpr VertexId kShared = VertexId(1) << 63;

/// A number of a shared vertex.
struct VertexAlias {
    VertexId vertex;
    uint64_t number;
};

/// Both of a collapse; the third vertices as numbers.
using Wings = std::array<CollapseWing, 2>;

class CollapseStore {
public:
    explicit CollapseStore(TempSpace& space)
        : links_(space, "links"),
          shapes_(space, "shapes"),
          wings_(space, "wings"),
          aliases_(space, "aliases"),
          words_(space, "words") {}

    /// Of one diamond. `number`: of the vertices that the wings mean; in the links, `u` is an id.
    /// `words`: Recorder::words().
    void append(std::span<const CollapseLink> links, std::span<const CollapseRecord> records,
                std::span<const uint32_t> number, std::span<const uint32_t> words = {});
    void append(std::span<const VertexAlias> aliases) { aliases_.append(std::as_bytes(aliases)); }

    uint32_t size() const { return size_; }
    void save(StateWriter& state);
    void restore(StateReader& state);
    uint64_t aliasCount() const { return aliases_.bytes() / sizeof(VertexAlias); }
    /// By record. For one thread each.
    CachedRecords<CollapseLink> links() const { return CachedRecords<CollapseLink>(links_); }
    CachedRecords<CollapseShape> shapes() const { return CachedRecords<CollapseShape>(shapes_); }

    CachedRecords<Wings> wings() const { return CachedRecords<Wings>(wings_); }

    /// Appends those of a collapse.
    void readWords(uint32_t i, WordLayout layout, std::vector<uint32_t>& words) const;

    /// visit(record, Wings), in order.
    template <class Visit>
    void forEachWings(Visit&& visit) const {
        uint32_t record = 0;
        forWindows<Wings>(wings_, [&](std::span<const Wings> window) {
            for (const Wings& wings : window) visit(record++, wings);
            return window.size();
        });
    }
    template <class Visit>
    void forEachAlias(Visit&& visit) const {
        forWindows<VertexAlias>(aliases_, [&](std::span<const VertexAlias> window) {
            for (const VertexAlias& alias : window) visit(alias);
            return window.size();
        });
    }

private:
    /// take() says how many of its argument it has taken.
    template <class T, class Take>
    static void forWindows(const Spill& spill, Take&& take) {
        std::vector<T> window;
        for (uint64_t at = 0, end = spill.bytes() / sizeof(T); at < end;) {
            window.resize(size_t(std::min<uint64_t>(1 << 16, end - at)));
            spill.read(at * sizeof(T), std::as_writable_bytes(std::span(window)));
            at += take(std::span<const T>(window));
        }
    }

    Spill links_, shapes_;
    Spill wings_;
    Spill aliases_;
    Spill words_;
    uint32_t size_ = 0;
};

struct Collapses {
    explicit Collapses(TempSpace& space) : store(space) {}
    CollapseStore store;
    Mesh base;
    std::vector<uint8_t> base_closed;     ///< one a triangle: 1 is surely of a closed component
    std::vector<FaceLeaves> base_leaves;  ///< of its triangles
    std::vector<VertexId> base_vertex;
    std::vector<uint32_t> base_last;  ///< the record each came from last, or kNoSplit
    uint32_t numbers = 0;             ///< of vertices, all are below
    uint32_t largest_height = 0;
    Recorder::Refused refused;
};

}  // namespace pietra::pmesh
