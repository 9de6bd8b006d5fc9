#pragma once
// What the constructions of all methods have in common: threads, memory and temporary data within
// the settings; the output, made before any work; the input's leaves; what report and model say of
// all that.

#include "base/parallel.h"
#include "coarsen/input_leaves.h"
#include "construction/checkpoint.h"
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
        CellShape shape = CellShape::kTetrahedra;
    };
    /// Reads the input, or takes up what an interrupted build left of it. All must outlive this.
    /// Throws what a build throws.
    Construction(TriangleSource& source, const BuildSettings& settings, const Kind& kind,
                 Progress& progress);

    /// Of the input; what the method made of it is to be added.
    BuildReport report() const;
    ModelInfo info() const;
    /// After the writer has finished: sizes are added.
    void finish(BuildReport& report);
    /// From where the method is in its work, should it be interrupted; where it is not worth it, or
    /// nothing is kept, does nothing. Spills that `write` saves have been given names: that of
    /// `spill` goes when the next state is saved, which must have another.
    template <class Write>
    void saveState(const std::string& spill, Write&& write) {
        if (!checkpoint.isDue()) return;
        saveInput();
        StateWriter state;
        state.put(spill);
        write(state);
        checkpoint.save(kMethodPart, state);
        if (!saved_spill_.empty()) checkpoint.remove(saved_spill_);
        saved_spill_ = spill;
    }
    std::optional<StateReader> stateToResume() {
        auto state = checkpoint.load(kMethodPart);
        if (state) state->get(saved_spill_);
        return state;
    }

private:
    static constexpr const char* kMethodPart = "method";
    InputLeaves readInput(Progress& progress);
    void saveInput();

    TriangleSource& source_;
    const BuildSettings& settings_;
    const Kind kind_;
    const ThreadLimit threads_;
    const MemoryPlan plan_;
    Budget budget_;
    std::vector<std::string> notes_;  ///< of the source
    bool input_saved_ = false;
    std::string saved_spill_;  ///< what the last state that was saved means

public:
    Checkpoint checkpoint;
    TempSpace space;
    /// Made first: an output that exists or cannot be written is known before any work.
    ModelWriter writer;
    InputLeaves input;
};

}  // namespace pietra
