// Progressive meshes on the GPU: what it costs to adapt one by compute shaders.
//
//   bench_pmesh_gpu MESH|KIND:TRIANGLES [groups=N] [PIXELS...]
//
// e.g.  cmake -B build -DCMAKE_BUILD_TYPE=Release -DPIETRA_BENCH=ON && cmake --build build -t
//       bench_pmesh_gpu && build/bench_pmesh_gpu dragon.ply 0.25 0.1
//       for n in 256 512 1024 2048; do build/bench_pmesh_gpu dragon.ply groups=$n 0.1; done
// or    bench_pmesh_gpu statue:4000000 0.1 (a synthetic mesh, of `pietra synth`, in /tmp)
//
// MESH is built in memory and uploaded. Printed: whether the arrays are the CPU's after refining
// all and after a flight; refining all of it from its base and coarsening it again; for each
// tolerance in pixels a camera that rushes to and fro, frames of one, four and sixteen passes and
// until nothing is left to do; and one that hardly moves. Times are the GPU's (timer queries) and,
// where it says so, the clock's.

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <string>

#include "base/stopwatch.h"
#include "gpu/context.h"
#include "io/synth.h"
#include "methods/pmesh/gl/gl_adaption.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/whole_mesh.h"
#include "pmesh_views.h"

namespace {

using namespace pietra;
using namespace pietra::pmesh;

/// Milliseconds of the GPU between the calls of start() and stop().
class GpuTimer {
public:
    GpuTimer() { glCreateQueries(GL_TIMESTAMP, 2, query_); }
    ~GpuTimer() { glDeleteQueries(2, query_); }
    void start() { glQueryCounter(query_[0], GL_TIMESTAMP); }
    double stop() {
        glQueryCounter(query_[1], GL_TIMESTAMP);
        GLuint64 ns[2];
        for (int i = 0; i < 2; ++i) glGetQueryObjectui64v(query_[i], GL_QUERY_RESULT, &ns[i]);
        return double(ns[1] - ns[0]) * 1e-6;
    }

private:
    GLuint query_[2];
};

/// Milliseconds of each kind of step, by timestamps between them.
class StepTimes {
public:
    void operator()(const char* name) {
        GLuint query = 0;
        glCreateQueries(GL_TIMESTAMP, 1, &query);
        glQueryCounter(query, GL_TIMESTAMP);
        mark_.push_back({name, query});
    }
    void print() {
        std::map<std::string, std::pair<double, int>> sum;
        GLuint64 last = 0;
        for (const auto& [name, query] : mark_) {
            GLuint64 now = 0;
            glGetQueryObjectui64v(query, GL_QUERY_RESULT, &now);
            glDeleteQueries(1, &query);
            if (last != 0) sum[name].first += double(now - last) * 1e-3, ++sum[name].second;
            last = now;
        }
        for (const auto& [name, of] : sum)
            std::printf("      %-10s %5d times, %8.1f us each, %8.1f us\n", name.c_str(), of.second,
                        of.first / of.second, of.first);
        mark_.clear();
    }

private:
    std::vector<std::pair<std::string, GLuint>> mark_;
};

struct Scene {
    ProgressiveMesh mesh;
    Box3d box;
    Criterion storm(int frame, double pixels) const {
        return stormView(box, mesh.lattice, frame, pixels);
    }
};

bool isEqual(GlAdaption& gl, const Adaption& cpu) {
    ActiveMesh copy(cpu.mesh().source());
    gl.download(copy);
    const auto same = [](const auto& a, const auto& b) {
        return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
    };
    const ActiveMesh& mesh = cpu.mesh();
    return same(copy.vertex, mesh.vertex) && same(copy.pulse, mesh.pulse) &&
           same(copy.criteria, mesh.criteria) && same(copy.record, mesh.record) &&
           same(copy.face, mesh.face);
}

void compare(const Scene& scene, uint32_t groups) {
    GlAdaption gl(scene.mesh, groups);
    Adaption cpu(scene.mesh);
    const auto told = [&](const char* when) {
        std::printf("  %s: arrays %s\n", when, isEqual(gl, cpu) ? "equal" : "DIFFER");
    };
    gl.settle(criterionOf(-1.0, scene.mesh.lattice));
    cpu.settle(criterionOf(-1.0, scene.mesh.lattice));
    told("all refined");
    for (int i = 0; i < 6; ++i) {
        gl.frame(scene.storm(i, 0.25), 1 + 3 * i);
        cpu.frame(scene.storm(i, 0.25), 1 + 3 * i);
    }
    told("after six frames");
    gl.settle(criterionOf(1e30, scene.mesh.lattice));
    cpu.settle(criterionOf(1e30, scene.mesh.lattice));
    told("all coarsened");
    std::fflush(stdout);
}

void settle(const char* what, GlAdaption& gl, const Criterion& criterion) {
    GpuTimer timer;
    glFinish();
    const Stopwatch clock;
    timer.start();
    const PassCounts counts = gl.settle(criterion);
    const double gpu_ms = timer.stop(), ms = 1e3 * clock.seconds();
    std::printf("  %s: %u operations in %u passes, %.2f ms (clock %.2f): %.1f M/s; %u faces\n",
                what, counts.operations(), counts.passes, gpu_ms, ms,
                counts.operations() / gpu_ms * 1e-3, gl.size().faces);
}

/// `most_passes` 0: until nothing is left to do.
void adapt(GlAdaption& gl, const Criterion& criterion, int most_passes) {
    if (most_passes == 0) {
        gl.settle(criterion);
    } else {
        gl.frame(criterion, most_passes);
    }
}

void storm(const Scene& scene, GlAdaption& gl, double pixels, int most_passes) {
    gl.settle(scene.storm(0, pixels));
    GpuTimer timer;
    double gpu_ms = 0;
    uint64_t operations = 0, passes = 0, vertices = 0;
    uint32_t least = ~0u;
    const int frames = 48;
    for (int i = 1; i <= frames; ++i) {
        timer.start();
        adapt(gl, scene.storm(i, pixels), most_passes);
        gpu_ms += timer.stop();
        const PassCounts counts = gl.lastCounts();
        operations += counts.operations();
        passes += counts.passes;
        vertices += gl.size().vertices;
        least = std::min(least, counts.operations());
    }
    std::printf(
        "  storm at %.2f px, at most %d passes: %llu vertices, %llu operations a frame (at least"
        " %u), %.1f passes: %.3f ms a frame, %.1f M operations/s\n",
        pixels, most_passes, static_cast<unsigned long long>(vertices / frames),
        static_cast<unsigned long long>(operations / frames), least, double(passes) / frames,
        gpu_ms / frames, double(operations) / gpu_ms * 1e-3);
    StepTimes times;
    gl.after_step = std::ref(times);
    for (int i = 1; i <= 8; ++i) adapt(gl, scene.storm(i, pixels), most_passes);
    gl.after_step = {};
    times.print();
    std::fflush(stdout);
}

void hover(const Scene& scene, GlAdaption& gl, double pixels) {
    const auto view = [&](int i) {
        return viewFrom(scene.box, scene.mesh.lattice, 2 + 1e-5 * i, 0.4, pixels);
    };
    gl.settle(view(0));
    GpuTimer timer;
    std::vector<double> ms;
    uint64_t operations = 0;
    for (int i = 1; i <= 50; ++i) {
        timer.start();
        gl.frame(view(i), 1);
        ms.push_back(timer.stop());
        operations += gl.lastCounts().operations();
    }
    std::sort(ms.begin(), ms.end());
    const uint32_t vertices = gl.size().vertices;
    std::printf(
        "  hover at %.2f px: %u vertices, %.1f operations a frame: median %.3f ms, %.3f ns a"
        " vertex\n",
        pixels, vertices, double(operations) / 50, ms[25], ms[25] * 1e6 / vertices);
    StepTimes times;
    gl.after_step = std::ref(times);
    for (int i = 51; i <= 58; ++i) gl.frame(view(i), 1);
    gl.after_step = {};
    times.print();
}

/// The path of a mesh; of one that is made here where `what` is KIND:TRIANGLES.
std::string meshOf(const std::string& what) {
    const size_t colon = what.find(':');
    if (colon == what.npos) return what;
    SynthRequest request;
    request.kind = what.substr(0, colon);
    request.triangles = std::stoull(what.substr(colon + 1));
    Progress progress;
    const std::string path = "/tmp/bench_pmesh_gpu.ply";
    synthesize(request, path, true, progress);
    return path;
}

Scene build(const std::string& path) {
    Budget budget(size_t(48) << 30);
    TempSpace space{"/tmp", &budget, size_t(4) << 30};
    Progress progress;
    const Stopwatch clock;
    WholeMesh whole = readWholeMesh(*openSource({path}), path, {}, space, progress);
    Scene scene;
    for (const Vec3i& p : whole.mesh.position) scene.box.add(whole.lattice.toInput(p));
    std::printf("%s: %zu triangles", path.c_str(), whole.mesh.triangleCount());
    scene.mesh = fromNodes(buildInCore(std::move(whole.mesh), whole.lattice, budget, nullptr));
    std::printf(", built in %.1f s\n", clock.seconds());
    std::fflush(stdout);
    return scene;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fprintf(stderr, "usage: bench_pmesh_gpu MESH|KIND:TRIANGLES [groups=N] [PIXELS...]\n");
        return 2;
    }
    const Scene scene = build(meshOf(argv[1]));
    const GlContext context = GlContext::headless();
    std::printf("  %s, %s\n", context.renderer().c_str(), context.version().c_str());
    const bool is_software = context.renderer().find("llvmpipe") != std::string::npos;
    uint32_t groups = is_software ? 8 : 1024;
    int first = 2;
    if (argc > 2 && std::sscanf(argv[2], "groups=%u", &groups) == 1) ++first;
    const Stopwatch clock;
    compare(scene, groups);
    std::printf("  compared in %.2f s, with the compiler's time\n", clock.seconds());
    GlAdaption gl(scene.mesh, groups);
    std::printf("  %u groups\n", groups);
    for (int i = 0; i < 3; ++i) {
        settle("refine all", gl, criterionOf(-1.0, scene.mesh.lattice));
        settle("coarsen all", gl, criterionOf(1e30, scene.mesh.lattice));
    }
    for (int i = first; i < argc; ++i) {
        const double pixels = std::atof(argv[i]);
        for (const int passes : {1, 4, 16, 0}) storm(scene, gl, pixels, passes);
        hover(scene, gl, pixels);
    }
}
