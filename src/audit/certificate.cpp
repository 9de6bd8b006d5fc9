#include "audit/certificate.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>

#include "audit/sample_index.h"
#include "base/check.h"
#include "base/hash.h"
#include "base/parallel.h"
#include "multires/forest.h"

namespace pietra {

namespace {

TriangleCorners cornersOf(const Mesh& mesh, const Triangle& t) {
    return {Vec3d(mesh.position[t[0]]), Vec3d(mesh.position[t[1]]), Vec3d(mesh.position[t[2]])};
}

/// The triangles of a patch in doubles. Scratch, one a thread.
std::span<const TriangleCorners> cornersOf(const Mesh& mesh,
                                           std::vector<TriangleCorners>& scratch) {
    scratch.clear();
    for (const Triangle& t : mesh.triangle) scratch.push_back(cornersOf(mesh, t));
    return scratch;
}

/// Numbers the triangles of all patches apart.
uint64_t firstNumber(NodeIndex node) {
    return uint64_t(node) << 32;
}

double toUnit(uint64_t bits) {
    return double(bits >> 11) * 0x1p-53;
}

/// A point of the triangle that depends on `bits` alone: one in four is a corner, where the
/// distance of a fine surface to a coarse one is largest; the others are spread evenly.
Vec3d pointOf(const TriangleCorners& t, uint64_t bits) {
    if (bits % 4 == 0) return t[bits / 4 % 3];
    double u = toUnit(mixBits(bits + 1)), v = toUnit(mixBits(bits + 2));
    if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
    }
    return t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
}

/// Takes `rate` samples a triangle on average, as a function of the seed and the triangle's number.
class Sampler {
public:
    Sampler(uint64_t seed, double rate) : seed_(mixBits(seed)), rate_(rate) {}

    void sampleRun(uint64_t first, std::span<const TriangleCorners> run, double reach,
                   uint64_t owner) {
        std::vector<Sample>& samples = samples_.local();
        for (size_t k = 0; k < run.size(); ++k) {
            uint64_t bits = mixBits(seed_ + mixBits(first + k));
            for (double left = rate_ + toUnit(bits); left >= 1; --left) {
                bits = mixBits(bits + 0x9e3779b97f4a7c15ULL);
                samples.push_back({pointOf(run[k], bits), reach, owner});
            }
        }
    }

    /// All samples, in no particular order; SampleIndex has its own.
    void moveTo(std::vector<Sample>& all) {
        for (std::vector<Sample>& part : samples_) {
            all.insert(all.end(), part.begin(), part.end());
            part = {};
        }
    }

private:
    uint64_t seed_;
    double rate_;
    PerThread<std::vector<Sample>> samples_;
};

bool lessByPosition(const Vec3d& a, const Vec3d& b) {
    return std::tuple(a.x, a.y, a.z) < std::tuple(b.x, b.y, b.z);
}

/// What the samples say about one cut, gathered by group.
class CutFindings {
public:
    CutFindings(const Forest& forest, const std::vector<uint16_t>& heights)
        : forest_(forest), heights_(heights) {}

    /// `allowed`: of that node, if any.
    void add(DirectionReport& direction, const SampleIndex& index, size_t i, NodeIndex node,
             double allowed) {
        const float ratio = index.ratio(i);
        ++direction.samples;
        direction.worst_ratio = std::max<double>(direction.worst_ratio, ratio);
        if (ratio > 1) {
            ++direction.violations;
            const Vec3d& p = index.sample(i).position;
            if (!report.first_violation || lessByPosition(p, *report.first_violation))
                report.first_violation = p;
        }
        if (node == kNoNode) return;
        GroupTightness& group = groups_[forest_.groupOf(node)];
        ++group.samples;
        group.measured = std::max(group.measured, double(ratio) * allowed);
    }

    CertificateReport finish() {
        for (const auto& [g, found] : groups_) {
            const Node& node = forest_.node(forest_.members(g).front());
            report.groups.push_back(found);
            report.groups.back().group = node.group;
            report.groups.back().height = heights_[g];
            report.groups.back().stated = node.error;
        }
        return std::move(report);
    }

    CertificateReport report;

private:
    const Forest& forest_;
    const std::vector<uint16_t>& heights_;
    std::map<uint32_t, GroupTightness> groups_;
};

class Audit {
public:
    Audit(std::span<const Node> nodes, std::span<const Cut> cuts, const PatchStream& stream,
          const Truth& truth, const CertificateOptions& options, Budget& budget)
        : forest_(nodes),
          heights_(forest_.groupHeights()),
          cuts_(cuts),
          stream_(stream),
          truth_(truth),
          options_(options),
          budget_(budget) {
        for (size_t c = 0; c < cuts.size(); ++c) findings_.emplace_back(forest_, heights_);
    }

    std::vector<CertificateReport> run() {
        std::vector<Sample> on_cuts;
        {
            SampleIndex on_truth(sampleTruth(), budget_);
            for (uint32_t c = 0; c < cuts_.size(); ++c) measureTruth(on_truth, c, on_cuts);
        }
        measureCuts(std::move(on_cuts));
        std::vector<CertificateReport> reports;
        for (CutFindings& findings : findings_) reports.push_back(findings.finish());
        return reports;
    }

private:
    /// What counts as within the stated error of a node.
    double allowed(NodeIndex node) const {
        return double(forest_.node(node).error) * (1 + options_.relative_slack) +
               truth_.numeric_error;
    }

    double rate(double samples, uint64_t triangles) const {
        return std::min(options_.per_triangle, samples / double(std::max<uint64_t>(1, triangles)));
    }

    std::vector<Sample> sampleTruth() {
        Sampler sampler(options_.seed, rate(double(options_.samples) / 2, truth_.triangles));
        truth_.stream([&](uint64_t first, NodeIndex node, std::span<const TriangleCorners> run) {
            sampler.sampleRun(first, run, 1, node);
        });
        std::vector<Sample> samples;
        sampler.moveTo(samples);
        return samples;
    }

    /// One reading of cut c: measures the truth's samples against it and takes samples on it.
    void measureTruth(SampleIndex& on_truth, uint32_t c, std::vector<Sample>& on_cuts) {
        const double wanted = double(options_.samples) / 2 / double(cuts_.size());
        Sampler sampler(mixBits(options_.seed + 1 + c), rate(wanted, cuts_[c].triangles));
        PerThread<std::vector<TriangleCorners>> scratch;
        on_truth.restart();
        stream_(cuts_[c].nodes, [&](NodeIndex node, const Mesh& mesh) {
            const std::span<const TriangleCorners> run = cornersOf(mesh, scratch.local());
            on_truth.visit(run, allowed(node), node);
            sampler.sampleRun(firstNumber(node), run, allowed(node), uint64_t(c) << 32 | node);
        });
        sampler.moveTo(on_cuts);
        const std::vector<NodeIndex> above = drawnAbove(cuts_[c]);
        for (size_t i = 0; i < on_truth.size(); ++i) {
            NodeIndex node = on_truth.tag(i);
            // Nobody vouches for it: the node above it is to blame, where that is known.
            if (node == SampleIndex::kNoTag && on_truth.sample(i).owner != kNoNode)
                node = above[on_truth.sample(i).owner];
            findings_[c].add(findings_[c].report.truth_to_cut, on_truth, i, node,
                             node == kNoNode ? 0 : allowed(node));
        }
    }

    /// Of each node at or below the cut the drawn one above it, else kNoNode.
    std::vector<NodeIndex> drawnAbove(const Cut& cut) const {
        std::vector<NodeIndex> above(forest_.nodes().size(), kNoNode);
        std::vector<NodeIndex> stack;
        for (const NodeIndex drawn : cut.nodes) {
            stack.push_back(drawn);
            while (!stack.empty()) {
                const NodeIndex i = stack.back();
                stack.pop_back();
                above[i] = drawn;
                forest_.node(i).forEachChild([&](NodeIndex child) { stack.push_back(child); });
            }
        }
        return above;
    }

    void measureCuts(std::vector<Sample> samples) {
        SampleIndex on_cuts(std::move(samples), budget_);
        truth_.stream([&](uint64_t, NodeIndex, std::span<const TriangleCorners> run) {
            on_cuts.visit(run, 1, 0);
        });
        for (size_t i = 0; i < on_cuts.size(); ++i) {
            CutFindings& findings = findings_[on_cuts.sample(i).owner >> 32];
            const auto node = NodeIndex(on_cuts.sample(i).owner);
            findings.add(findings.report.cut_to_truth, on_cuts, i, node, allowed(node));
        }
    }

    const Forest forest_;
    const std::vector<uint16_t> heights_;
    const std::span<const Cut> cuts_;
    const PatchStream& stream_;
    const Truth& truth_;
    const CertificateOptions& options_;
    Budget& budget_;
    std::vector<CutFindings> findings_;
};

/// Distances below this, in lattice units, may be rounding: no ratio is formed with them.
constexpr double kNoMeasure = 1e-6;

/// Corners in lattice coordinates of all triangles that do not collapse on the lattice.
void toLattice(std::span<const InputTriangles::Corners> input, const Lattice& lattice,
               std::vector<TriangleCorners>& out) {
    out.clear();
    for (const InputTriangles::Corners& t : input) {
        const Vec3i a = lattice.snap(t[0]), b = lattice.snap(t[1]), c = lattice.snap(t[2]);
        if (a == b || b == c || c == a) continue;
        out.push_back({lattice.toLattice(t[0]), lattice.toLattice(t[1]), lattice.toLattice(t[2])});
    }
}

}  // namespace

Truth truthOfFinestCut(std::span<const Node> nodes, const PatchStream& stream) {
    Truth truth;
    const Cut finest = finestCut(nodes);
    truth.triangles = finest.triangles;
    truth.stream = [finest, &stream](const Truth::Visitor& visit) {
        PerThread<std::vector<TriangleCorners>> scratch;
        stream(finest.nodes, [&](NodeIndex node, const Mesh& mesh) {
            visit(firstNumber(node), node, cornersOf(mesh, scratch.local()));
        });
    };
    return truth;
}

Truth truthOfInput(InputTriangles& input, const Lattice& lattice, uint64_t triangles) {
    Truth truth;
    truth.triangles = triangles;
    // Doubles of the input's size are off by 2^-53 of it, and by as much again once shifted.
    const Vec3d corner = glm::abs(lattice.origin) + lattice.step * double(1 << kLatticeBits);
    const double largest = std::max({corner.x, corner.y, corner.z});
    truth.numeric_error += 4 * largest * 0x1p-52 / lattice.step;
    truth.stream = [&input, lattice](const Truth::Visitor& visit) {
        constexpr size_t kRun = 4096;
        PerThread<std::vector<TriangleCorners>> scratch;
        input.forEachBatch([&](uint64_t first, std::span<const InputTriangles::Corners> batch) {
            parallelFor((batch.size() + kRun - 1) / kRun, [&](size_t r) {
                const size_t begin = r * kRun;
                std::vector<TriangleCorners>& run = scratch.local();
                toLattice(batch.subspan(begin, std::min(kRun, batch.size() - begin)), lattice, run);
                visit(first + begin, kNoNode, run);
            });
        });
    };
    return truth;
}

std::vector<CertificateReport> auditCertificate(std::span<const Node> nodes,
                                                std::span<const Cut> cuts,
                                                const PatchStream& stream, const Truth& truth,
                                                const CertificateOptions& options, Budget& budget) {
    return Audit(nodes, cuts, stream, truth, options, budget).run();
}

std::vector<TightnessRow> tightnessTable(std::span<const CertificateReport> reports,
                                         uint64_t min_samples) {
    std::map<std::pair<uint16_t, uint32_t>, double> worst;  // of a group that several cuts draw
    for (const CertificateReport& report : reports)
        for (const GroupTightness& group : report.groups) {
            if (group.samples < min_samples || !(group.measured > kNoMeasure)) continue;
            double& idle = worst.try_emplace({group.height, group.group}, 1e300).first->second;
            idle = std::min(idle, group.stated / group.measured);
        }
    std::vector<TightnessRow> rows;
    for (auto it = worst.begin(); it != worst.end();) {
        TightnessRow row;
        row.height = it->first.first;
        std::vector<double> ratios;
        for (; it != worst.end() && it->first.first == row.height; ++it)
            ratios.push_back(it->second);
        std::sort(ratios.begin(), ratios.end());
        row.groups = ratios.size();
        row.least = ratios.front();
        row.median = ratios[ratios.size() / 2];
        row.p95 = ratios[(ratios.size() - 1) * 95 / 100];
        row.worst = ratios.back();
        rows.push_back(row);
    }
    return rows;
}

}  // namespace pietra
