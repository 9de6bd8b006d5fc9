#include "methods/cluster/build.h"

#include "methods/cluster/layer_builder.h"

namespace pietra::cluster {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    BuildSettings own = settings;
    own.leaf_triangles *= 2;  // leaves have a quarter of it at least, not half
    Construction work(source, own, {.name = "cluster", .stages = 3, .shape = CellShape::kCubes},
                      progress);
    const VertexTable& vertices = work.input.vertices;
    BuilderSettings builder;
    builder.leaf_triangles = own.leaf_triangles;
    builder.shift = vertices.lattice().shift;
    builder.schema = source.schema();
    builder.quantisation_error = vertices.quantisationError();
    builder.jobs = settings.jobs;
    BuildReport report = work.report();
    const BuilderCounts counts = buildLayers(work, builder, progress);
    report.levels = counts.levels;
    report.stored_triangles = counts.triangles;
    report.nodes = work.writer.nodeCount();

    progress.beginStage("write", 0);
    ModelInfo info = work.info();
    info.face_sizes = true;
    work.writer.finish(info);
    progress.endStage();
    work.finish(report);
    return report;
}

}  // namespace pietra::cluster
