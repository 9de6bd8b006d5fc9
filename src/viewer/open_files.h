#pragma once
// The files of a window: models that are open, meshes whose models are being built, and what went
// wrong. One thread calls; nothing waits but opening a model, which reads its node table.

#include <memory>
#include <string>
#include <vector>

#include "store/model_reader.h"
#include "viewer/background_build.h"

namespace pietra {

class OpenFiles {
public:
    /// `program` builds models: the path of this one.
    explicit OpenFiles(std::string program) : program_(std::move(program)) {}

    /// A model is opened. For a mesh, the model made from it is opened if there is one that is
    /// newer; else it is built, if `build`, or offered. Throws what ModelReader throws, and
    /// IoError.
    void open(const std::string& path, bool build);
    /// Builds what is offered, or forgets it.
    void acceptOffers();
    void refuseOffers() { offers_.clear(); }
    /// Opens what has been built.
    void poll();

    std::vector<const ModelReader*> models() const;
    /// Closes all models but the first `count`, saying why.
    void closeAfter(size_t count, const std::string& why);
    const std::vector<std::string>& offers() const { return offers_; }
    const std::vector<std::unique_ptr<BackgroundBuild>>& builds() const { return builds_; }
    void stopBuild(const BackgroundBuild* build);
    void addFault(const std::string& sentence) { faults_.push_back(sentence); }
    /// Sentences about what could not be opened or built.
    const std::vector<std::string>& faults() const { return faults_; }

private:
    void build(const std::string& mesh);

    std::string program_;
    std::vector<std::unique_ptr<ModelReader>> models_;
    std::vector<std::string> offers_;
    std::vector<std::unique_ptr<BackgroundBuild>> builds_;
    std::vector<std::string> faults_;
};

/// Where the model of a mesh lies: beside it, under its name, and where that folder cannot be
/// written, in the user's cache.
std::string modelPathOf(const std::string& mesh);

}  // namespace pietra
