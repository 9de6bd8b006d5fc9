#pragma once
// What `check` finds out from a model file alone, whatever its method: every page matches its
// checksum and decodes, every node's children form a forest, bounds are nested, errors monotone and
// equal within a group, and cones hold the normals of their triangles.
//
// Streams: pages are read and decoded in parallel, one at a time a thread; beside the reader's node
// table it takes some twelve bytes a node. The result does not depend on the number of threads.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "store/model_reader.h"

namespace pietra {

struct VerifyReport {
    struct {
        uint64_t checked = 0;
        uint64_t bad = 0;  ///< damaged, do not decode, or hold other counts than their nodes say
    } pages;
    struct {
        uint64_t checked = 0;
        uint64_t bad = 0;  ///< nodes that are not the child of exactly one node (roots: of none)
    } nodes;
    struct {
        uint64_t checked = 0;  ///< nodes
        uint64_t not_nested =
            0;  ///< patch outside of bounds, bounds or children outside of saturated
    } bounds;
    struct {
        uint64_t checked = 0;       ///< nodes
        uint64_t not_monotone = 0;  ///< below a child's, or not that of the rest of the group
    } errors;
    struct {
        uint64_t checked = 0;  ///< nodes
        uint64_t bad = 0;      ///< some triangle's normal is outside
    } cones;
    /// One sentence each with the file's name and, for pages, the byte offset; the first
    /// kMaxFaultTexts in the order of nodes.
    std::vector<std::string> faults;

    bool ok() const {
        return pages.bad + nodes.bad + bounds.not_nested + errors.not_monotone + cones.bad == 0;
    }
};
inline constexpr size_t kMaxFaultTexts = 20;

/// Empty, or a sentence about what is wrong with a page, whose checksum is good; thread-safe.
using PageCheck = std::function<std::string(uint32_t page)>;

/// `check_page`: for models whose pages are not patches (ModelReader::hasPatches).
/// Ticks `progress` (a stage the caller has begun) once a page. Throws Interrupted and IoError
/// only.
VerifyReport verifyModel(const ModelReader& model, Progress& progress,
                         const PageCheck& check_page = {});

}  // namespace pietra
