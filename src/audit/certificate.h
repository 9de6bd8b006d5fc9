#pragma once
// Audits the errors that a model states, against the truth: the finest cut, or the input itself.
//
// The claim: every point of the truth lies within the stated error of some drawn node from that
// node's patch, and every point of a patch within its node's error from the truth. Both directions
// are sampled, and distances to the other surface are exact; a sample outside is a violation, and
// one is enough to disprove the model. A sample's distance cannot exceed the maximum, so the
// measured error of a group is a lower bound of its true one, and stated / measured an upper bound
// of how idle the bound is.
//
// Against the finest cut, the quantisation counts as part of the stated error, as in ERROR.md's
// proof. Against the input, triangles that collapse on the lattice are passed over: the builder
// drops and reports them.
//
// Samples are spread evenly over the triangles, a quarter of them at corners; all is a function of
// the surfaces, the seed and the numbers asked for, not of threads or of the order of patches.
// Memory: SampleIndex::bytesFor() of the samples, twice. Time: about the decoding of the truth
// twice and of each cut once, and a fraction of a microsecond a triangle.

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "audit/input_triangles.h"
#include "audit/patch_stream.h"
#include "geometry/triangle_distance.h"
#include "base/budget.h"
#include "multires/cut.h"

namespace pietra {

/// The surface that errors are measured against, in lattice coordinates. Streams may be repeated.
struct Truth {
    /// `first`: a number for the first triangle, which the others of the run continue, and which no
    /// other run has; `node`: the finest node they belong to, or kNoNode.
    using Visitor =
        std::function<void(uint64_t first, NodeIndex node, std::span<const TriangleCorners>)>;
    /// Calls the visitor, which is thread-safe, on all triangles.
    std::function<void(const Visitor&)> stream;
    uint64_t triangles = 0;  ///< about how many there are: for the density of samples
    /// What positions may be off by, in lattice units, for numeric reasons: counted as no
    /// violation.
    double numeric_error = 1e-8;
};

/// The finest cut of the model itself.
Truth truthOfFinestCut(std::span<const Node> nodes, const PatchStream& stream);
/// The input, from its own coordinates. `triangles` as in ModelInfo::input_triangles; what is
/// passed must outlive the truth.
Truth truthOfInput(InputTriangles& input, const Lattice& lattice, uint64_t triangles);

struct CertificateOptions {
    uint64_t seed = 1;
    /// Samples aimed at, on the truth and on all cuts together; at most `per_triangle` each
    /// triangle.
    uint64_t samples = 1'000'000;
    double per_triangle = 64;
    /// Part of the stated error that is left to rounding; what exceeds it is a violation.
    double relative_slack = 5e-7;
};

/// One direction of one cut.
struct DirectionReport {
    uint64_t samples = 0;
    uint64_t violations = 0;
    /// Largest distance / stated error. Exact up to 1.25; 1.25 stands for all that is larger.
    double worst_ratio = 0;
};

/// One group of nodes, as drawn in one cut.
struct GroupTightness {
    uint32_t group = 0;    ///< as in Node::group
    uint16_t height = 0;   ///< Forest::groupHeights()
    float stated = 0;      ///< lattice units
    double measured = 0;   ///< largest distance found in both directions; at most 1.25 * stated
    uint64_t samples = 0;  ///< points of the truth below it and points on it
};

struct CertificateReport {
    DirectionReport truth_to_cut;
    DirectionReport cut_to_truth;
    std::vector<GroupTightness> groups;    ///< those drawn that got samples, by group number
    std::optional<Vec3d> first_violation;  ///< the least position, lattice coordinates
    uint64_t samples() const { return truth_to_cut.samples + cut_to_truth.samples; }
    uint64_t violations() const { return truth_to_cut.violations + cut_to_truth.violations; }
    double worstRatio() const {
        return truth_to_cut.worst_ratio > cut_to_truth.worst_ratio ? truth_to_cut.worst_ratio
                                                                   : cut_to_truth.worst_ratio;
    }
};

/// Audits each cut; one report a cut. The truth is read twice, each cut once. Where the truth is
/// the input it is not known which group a point of it lies below: it then counts for none.
std::vector<CertificateReport> auditCertificate(std::span<const Node> nodes,
                                                std::span<const Cut> cuts,
                                                const PatchStream& stream, const Truth& truth,
                                                const CertificateOptions& options, Budget& budget);

/// Of all groups of one height: how much larger than measured the stated errors are.
struct TightnessRow {
    uint16_t height = 0;
    uint64_t groups = 0;
    double least = 0, median = 0, p95 = 0, worst = 0;  ///< of stated / measured
};

/// One row a height, increasing, from reports of cuts by height; groups with fewer samples than
/// `min_samples`, or without any error, are left out.
std::vector<TightnessRow> tightnessTable(std::span<const CertificateReport> reports,
                                         uint64_t min_samples = 32);

}  // namespace pietra
