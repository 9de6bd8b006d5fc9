#pragma once
// All that `check` examines once the pages have been read: hierarchy, patches, seeded cuts and the
// certificate, without the input or with it. For every method, from outside: only the node table
// and the patches are seen.
//
// Bounded memory: takes what it needs from the budget, in turn, and spills what does not fit to
// unnamed files. Fewer samples are taken where the budget is small; all else is the same for any
// budget, and everything is the same for any number of threads.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "audit/certificate.h"
#include "audit/cracks.h"
#include "audit/patch_check.h"
#include "audit/patch_stream.h"
#include "base/budget.h"
#include "base/progress.h"
#include "io/triangle_source.h"
#include "multires/forest.h"
#include "multires/node.h"

namespace pietra {

/// An open model, as far as the audit is concerned. What it refers to must outlive the audit.
struct AuditedModel {
    std::span<const Node> nodes;
    ModelInfo info;
    PatchStream stream;
};

struct AuditOptions {
    int cuts = 8;  ///< seeded random ones, beside the finest and the coarsest
    uint64_t seed = 1;
    uint64_t samples = 1'000'000;  ///< of the certificate, at most; 0: no certificate
    bool tightness = false;        ///< audit one cut a height as well, for the table
    std::string temp_dir = "/tmp";
};

/// Sums over all cuts.
struct CutsReport {
    uint64_t checked = 0;
    uint64_t invalid = 0;        ///< not one node a path, or a torn group
    uint64_t cracked_edges = 0;  ///< with the input: also borders that are not the input's
    uint64_t overlapping_edges = 0;
    uint64_t other_edges = 0;  ///< miscounted or disagreeing (CrackReport)
    uint64_t degenerate_triangles = 0;
};

/// How the finest cut compares with the input.
struct InputComparison {
    uint64_t degenerate = 0;  ///< in the input, left out
    uint64_t duplicate = 0;   ///< in the input, kept once
    bool same_surface = false;
};

struct AuditReport {
    ForestReport forest;
    PatchReport patches;
    CutsReport cuts;
    std::vector<CertificateReport>
        certificates;  ///< one for each cut audited, empty if there is none
    std::vector<TightnessRow> tightness;
    std::optional<InputComparison> input;
    std::string first_fault;  ///< one sentence, empty if all is well

    bool ok() const { return first_fault.empty(); }
    uint64_t samples() const;
    uint64_t violations() const;
    double worstRatio() const;
};

/// `input` may be null. Throws what the stream and the source throw, MemoryError, Interrupted. A
/// node table with bad links is not examined further. Progress counts patches, and triangles of the
/// input.
AuditReport auditModel(const AuditedModel& model, TriangleSource* input,
                       const AuditOptions& options, Budget& budget, Progress& progress);

}  // namespace pietra
