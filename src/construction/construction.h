#pragma once
// What the constructions of all methods have in common: threads, memory and temporary data within
// the settings; the output, made before any work; the input's leaves; what report and model say of
// all that.

#include "base/parallel.h"
#include "coarsen/input_leaves.h"
#include "multires/method.h"
#include "store/model_writer.h"

namespace pietra {

class Construction {
public:
    /// What a method does differently.
    struct Kind {
        const char* name;
        int stages;  ///< of progress, between the leaves and writing
        bool mark_irregular = false;
    };
    /// Reads the input. All must outlive this. Throws what a build throws.
    Construction(TriangleSource& source, const BuildSettings& settings, const Kind& kind,
                 Progress& progress);

    /// Of the input; what the method made of it is to be added.
    BuildReport report() const;
    ModelInfo info() const;
    /// After the writer has finished: sizes are added.
    void finish(BuildReport& report) const;

private:
    TriangleSource& source_;
    const BuildSettings& settings_;
    const Kind kind_;
    const ThreadLimit threads_;
    const MemoryPlan plan_;
    Budget budget_;

public:
    TempSpace space;
    /// Made first: an output that exists or cannot be written is known before any work.
    ModelWriter writer;
    InputLeaves input;
};

}  // namespace pietra
