#include "methods/tetra/build.h"

#include "methods/tetra/levels.h"

namespace pietra::tetra {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    Construction work(source, settings, {.name = "tetra", .stages = 1}, progress);
    const VertexTable& vertices = work.input.vertices;
    const LevelSettings level_settings{
        settings.patch_triangles, vertices.lattice().shift,     source.schema(),
        vertices.scalarRanges(),  vertices.quantisationError(), settings.jobs};
    BuildReport report = work.report();
    const LevelCounts counts = buildLevels(work, level_settings, progress);
    report.levels = counts.levels;
    report.stored_triangles = counts.triangles;
    report.nodes = work.writer.nodeCount();

    progress.beginStage("write", 0);
    work.writer.finish(work.info());
    progress.endStage();
    work.finish(report);
    return report;
}

}  // namespace pietra::tetra
