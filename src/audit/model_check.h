#pragma once
// Everything that `check` does, as one function: the file alone (store/verify.h), seeded cuts and
// their cracks, and the certificate, against the finest cut or against the input.
//
// Where there is an input, the finest cut must also have its triangles, no more and no less, and
// border edges of cuts must lie along its border. Memory: the budget; beside it, the decoded pages
// of visitPatches(). Deterministic in file, input and settings.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "audit/certificate.h"
#include "base/budget.h"
#include "base/progress.h"
#include "store/verify.h"

namespace pietra {

struct ModelCheckSettings {
    uint64_t cuts = 8;  ///< seeded ones: thresholds, cameras, arbitrary choices
    uint64_t seed = 1;
    uint64_t samples = 1'000'000;    ///< of the certificate, as memory allows; 0: no certificate
    std::vector<std::string> input;  ///< mesh files; empty: none
    std::string temp_dir;
};

/// Sums over all cuts.
struct CutsReport {
    uint64_t checked = 0, triangles = 0;
    uint64_t invalid = 0;  ///< no valid cut at all
    uint64_t cracked_edges = 0, overlapping_edges = 0;
    uint64_t miscounted_edges = 0, disagreeing_edges = 0, degenerate_triangles = 0;  ///< cracks.h
    uint64_t faults() const {
        return invalid + cracked_edges + overlapping_edges + miscounted_edges + disagreeing_edges +
               degenerate_triangles;
    }
};

struct CertificateSummary {
    bool against_input = false;  ///< else against the finest cut
    uint64_t cuts = 0, samples = 0, violations = 0;
    double worst_ratio = 0;  ///< largest distance / stated error
    std::vector<TightnessRow> tightness;
};

/// The input, and what became of it.
struct InputReport {
    uint64_t triangles = 0;  ///< without degenerate and duplicate ones
    uint64_t degenerate = 0, duplicate = 0;
    uint64_t border_edges = 0;
    bool same_surface = false;  ///< the finest cut has just these triangles
    bool same_drops = false;    ///< the header says how many were dropped
    bool ok() const { return same_surface && same_drops; }
};

struct ModelCheckReport {
    VerifyReport file;
    std::optional<InputReport> input;
    CutsReport cuts;  ///< nothing was checked where pages or links of nodes are bad; likewise below
    CertificateSummary certificate;
    std::vector<std::string> faults;  ///< sentences, beside those of `file`
    bool ok() const {
        return file.ok() && (!input || input->ok()) && cuts.faults() == 0 &&
               certificate.violations == 0;
    }
};

/// Sets and begins the stages of `progress`. Throws what opening and reading the input throws,
/// IoError, MemoryError, Interrupted.
ModelCheckReport checkModel(const ModelReader& model, const ModelCheckSettings& settings,
                            Budget& budget, Progress& progress);

}  // namespace pietra
