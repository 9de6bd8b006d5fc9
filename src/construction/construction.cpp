#include "construction/construction.h"

#include <filesystem>

namespace pietra {
namespace {

Progress& withStages(Progress& progress, int stages) {
    progress.setStages(InputLeaves::kStages + stages + 1);
    return progress;
}

}  // namespace

Construction::Construction(TriangleSource& source, const BuildSettings& settings, const Kind& kind,
                           Progress& progress)
    : source_(source),
      settings_(settings),
      kind_(kind),
      threads_(settings.jobs),
      plan_(settings.memory_bytes, settings.jobs, VertexRecord(source.schema()).bytes),
      budget_(plan_.budget),
      space{settings.temp_dir, &budget_, plan_.work},
      writer(settings.output, settings.force, settings.temp_dir, budget_),
      input(source,
            {settings.input_name, settings.precision, settings.leaf_triangles, kind.mark_irregular},
            plan_, space, withStages(progress, kind.stages)) {}

BuildReport Construction::report() const {
    BuildReport report;
    report.input_triangles = input.inputTriangles();
    report.input_vertices = input.vertices.size();
    report.dropped_degenerate = input.degenerate;
    report.dropped_duplicate = input.leaves.duplicates;
    report.border_edges = input.leaves.edges.border;
    report.non_manifold_edges = input.leaves.edges.non_manifold;
    report.inconsistent_edges = input.leaves.edges.inconsistent;
    report.notes = source_.notes();
    return report;
}

ModelInfo Construction::info() const {
    ModelInfo info;
    info.method = kind_.name;
    info.lattice = input.vertices.lattice();
    info.schema = source_.schema();
    info.input_triangles = input.inputTriangles();
    info.input_vertices = input.vertices.size();
    info.input_files = settings_.input_files;
    info.dropped_degenerate = input.degenerate;
    info.dropped_duplicate = input.leaves.duplicates;
    info.quantisation_error = input.vertices.quantisationError();
    info.bounds = input.vertices.bounds();
    return info;
}

void Construction::finish(BuildReport& report) const {
    report.output_bytes = std::filesystem::file_size(settings_.output);
    report.temp_bytes_peak = space.peak_bytes;
}

}  // namespace pietra
