#include "construction/construction.h"

#include <fmt/format.h>

#include <filesystem>

namespace pietra {
namespace {

/// What decides the bytes of the model, and the files that it comes from.
std::string identityOf(const BuildSettings& settings, const char* method) {
    if (settings.input_identity.empty()) return "";
    return fmt::format("{}\n{} {} {} {} {}", settings.input_identity, method,
                       int(settings.precision.kind), settings.precision.step,
                       settings.leaf_triangles, settings.patch_triangles);
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
      checkpoint(settings.temp_dir, identityOf(settings, kind.name), settings.resume,
                 settings.checkpoint_seconds),
      space{settings.temp_dir, &budget_, plan_.work, checkpoint.folder()},
      writer(settings.output, settings.force, settings.temp_dir, budget_, checkpoint.folder()),
      input(readInput(progress)) {
    trimHeap();  // of large batches and buckets; what comes is smaller, and would go between
    if (checkpoint.isDue()) saveInput();
}

InputLeaves Construction::readInput(Progress& progress) {
    if (checkpoint.resumes()) {
        input_saved_ = true;
        progress.setStages(kind_.stages + 1);
        StateReader state = *checkpoint.load(Checkpoint::kFirst);
        notes_.resize(state.get<size_t>());
        for (std::string& note : notes_) state.get(note);
        return InputLeaves(source_.schema(), space, state);
    }
    progress.setStages(InputLeaves::kStages + kind_.stages + 1);
    return InputLeaves(source_,
                       {settings_.input_name, settings_.precision, settings_.leaf_triangles,
                        kind_.mark_irregular, kind_.shape},
                       plan_, space, progress);
}

/// Once.
void Construction::saveInput() {
    if (input_saved_) return;
    notes_ = source_.notes();
    StateWriter state;
    state.put(notes_.size());
    for (const std::string& note : notes_) state.put(note);
    input.save(state);
    checkpoint.save(Checkpoint::kFirst, state);
    input_saved_ = true;
}

BuildReport Construction::report() const {
    BuildReport report;
    report.input_triangles = input.inputTriangles();
    report.input_vertices = input.vertices.size();
    report.dropped_degenerate = input.degenerate;
    report.dropped_duplicate = input.leaves.duplicates;
    report.border_edges = input.leaves.edges.border;
    report.non_manifold_edges = input.leaves.edges.non_manifold;
    report.inconsistent_edges = input.leaves.edges.inconsistent;
    report.notes = checkpoint.resumes() ? notes_ : source_.notes();
    report.resumed = checkpoint.resumes();
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

void Construction::finish(BuildReport& report) {
    checkpoint.finish();
    report.output_bytes = std::filesystem::file_size(settings_.output);
    report.temp_bytes_peak = space.peak_bytes;
}

}  // namespace pietra
