// Triangles of the cut at a tolerance beside those that an in-core simplification of what the view
// sees needs for the same measured image error.
//
//   bench_visible MODEL.pietra [PIXELS=1] [VIEWS=8] [PATH=orbit]
//
// The rival simplifies, with meshoptimizer, those triangles of the full mesh that lie in the
// picture and, in closed parts, face the eye, as few as still show no more error than the cut. The
// error is `compare`'s against the full mesh at 1280x1024: the 99th percentile of depth, in pixels.
// Printed for each view: triangles of both, their ratio, both errors; and the medians.

#include <meshoptimizer.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <unordered_map>

#include "audit/picture_compare.h"
#include "base/progress.h"
#include "multires/cut.h"
#include "render/offline/offline_picture.h"
#include "render/raster/rasteriser.h"
#include "runtime/patch_reader.h"
#include "runtime/standard_paths.h"

namespace {

using namespace pietra;

constexpr PictureSize kSize{1280, 1024};
constexpr int kHalvings = 12;

/// The finest cut, welded by position.
struct FullMesh {
    Mesh mesh;
    std::vector<uint8_t> closed;  // a triangle

    explicit FullMesh(const ModelReader& model) {
        std::unordered_map<uint64_t, uint32_t> index;
        std::mutex mutex;
        visitPatches(model, finestCut(model.nodes()).nodes, [&](NodeIndex i, const Mesh& patch) {
            const std::lock_guard lock(mutex);
            std::vector<uint32_t> to;
            for (size_t v = 0; v < patch.vertexCount(); ++v) {
                const auto next = uint32_t(mesh.vertexCount());
                const auto [at, fresh] = index.try_emplace(latticeKey(patch.position[v]), next);
                to.push_back(at->second);
                if (!fresh) continue;
                mesh.position.push_back(patch.position[v]);
                mesh.normal.push_back(patch.normal[v]);
            }
            for (const Triangle& t : patch.triangle) {
                mesh.triangle.push_back({to[t[0]], to[t[1]], to[t[2]]});
                closed.push_back(model.nodes()[i].closed);
            }
        });
    }

    /// Those whose three corners are not all beyond one side of the picture.
    std::vector<Triangle> seen(const View& view) const {
        std::vector<uint8_t> beyond(mesh.vertexCount());
        for (size_t v = 0; v < beyond.size(); ++v) {
            const Vec3d off = Vec3d(mesh.position[v]) - view.eye();
            const double depth = -glm::dot(off, view.back());
            const double x = glm::dot(off, view.right()) * view.focal_px();
            const double y = glm::dot(off, view.up()) * view.focal_px();
            const double w = depth * kSize.width / 2, h = depth * kSize.height / 2;
            beyond[v] =
                uint8_t((depth <= 0) | (x < -w) << 1 | (x > w) << 2 | (y < -h) << 3 | (y > h) << 4);
        }
        std::vector<Triangle> out;
        for (size_t i = 0; i < mesh.triangleCount(); ++i) {
            const Triangle& t = mesh.triangle[i];
            if (beyond[t[0]] & beyond[t[1]] & beyond[t[2]]) continue;
            const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
            if (closed[i] && glm::dot(glm::cross(b - a, c - a), view.eye() - a) <= 0) continue;
            out.push_back(t);
        }
        return out;
    }
};

class Rival {
public:
    Rival(const FullMesh& full, const View& view, const Lattice& lattice, const Picture& wanted)
        : full_(full), view_(view), lattice_(lattice), wanted_(wanted), seen_(full.seen(view)) {
        for (const Vec3i& p : full.mesh.position)
            for (int k = 0; k < 3; ++k) place_.push_back(float(p[k]));
    }

    /// As few triangles as show at most this error; 0 where not even all of them do.
    size_t fewest(double error) {
        size_t low = 0, high = seen_.size(), fewest = 0;
        for (int i = 0; i < kHalvings; ++i) {
            const size_t middle = i == 0 ? high : (low + high) / 2;
            const auto [triangles, shown] = simplified(middle);
            (shown > error ? low : high) = middle;
            if (shown <= error) fewest = triangles;
        }
        return fewest;
    }

private:
    /// To so many triangles, or what can be reached: how many, and the error that shows.
    std::pair<size_t, double> simplified(size_t triangles) const {
        Mesh mesh = full_.mesh;
        mesh.triangle.resize(seen_.size());
        float reached = 0;
        const size_t corners = meshopt_simplify(
            mesh.triangle.data()->data(), seen_.data()->data(), 3 * seen_.size(), place_.data(),
            full_.mesh.vertexCount(), 3 * sizeof(float), 3 * triangles, 1.0f, 0, &reached);
        mesh.triangle.resize(corners / 3);
        DrawPatch patch;
        patch.mesh = &mesh;
        Rasteriser rasteriser(view_, lattice_, 1, {});
        const ModelPatches list{view_, &lattice_, {&patch, 1}};
        rasteriser.draw({&list, 1}, false);
        return {mesh.triangleCount(), compare(rasteriser.finish(), wanted_).depth_px.p99};
    }

    const FullMesh& full_;
    const View& view_;
    const Lattice& lattice_;
    const Picture& wanted_;
    std::vector<Triangle> seen_;
    std::vector<float> place_;
};

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values.empty() ? 0 : values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) return std::fprintf(stderr, "usage: bench_visible MODEL [PIXELS VIEWS PATH]\n");
    const double pixels = argc > 2 ? std::atof(argv[2]) : 1;
    const int views = argc > 3 ? std::atoi(argv[3]) : 8;
    const auto path_kind = parseStandardPath(argc > 4 ? argv[4] : "orbit");
    const ModelReader model(argv[1]);
    const ModelReader* models[] = {&model};
    const FullMesh full(model);
    const CameraPath path = standardPath(path_kind.value_or(StandardPath::kOrbit),
                                         coarseSurface(models, nullptr), UpAxis::kZ, kSize);
    Progress progress;
    std::vector<double> ratios;
    for (int i = 0; i < views; ++i) {
        const Camera camera = path.at(path.seconds * (i + 0.5) / views);
        const View view(camera, kSize, model.info().lattice);
        OfflineSettings settings;
        settings.pixels = 0;
        const Picture wanted = drawModels(models, camera, kSize, settings, progress).picture;
        settings.pixels = pixels;
        settings.culling = {true, true, true, true};
        const OfflinePicture cut = drawModels(models, camera, kSize, settings, progress);
        const PictureDifference shown = compare(cut.picture, wanted);
        const size_t fewest =
            Rival(full, view, model.info().lattice, wanted).fewest(shown.depth_px.p99);
        const double ratio = double(cut.statistics.triangles) / double(std::max<size_t>(fewest, 1));
        std::printf(
            "view %d: %zu triangles, %zu by meshoptimizer, ratio %.2f; depth p99 %.3f px, "
            "largest %.2f px\n",
            i, size_t(cut.statistics.triangles), fewest, ratio, shown.depth_px.p99,
            shown.largestPx());
        if (fewest > 0) ratios.push_back(ratio);
    }
    std::printf("median ratio %.2f\n", median(ratios));
    return 0;
}
