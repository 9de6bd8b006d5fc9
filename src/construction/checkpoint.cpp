#include "construction/checkpoint.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "base/hash.h"

namespace pietra {
namespace {

/// Of the states of all methods: to be changed with any of them.
constexpr uint32_t kVersion = 1;
constexpr double kMostCost = 1.0 / 20;
constexpr const char* kLock = "lock";

struct Head {
    uint64_t session = 0;  ///< version and the system's start
    uint64_t hash = 0;     ///< of what follows
};

uint64_t session() {
    std::string boot;
    std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), boot);
    return hashBytes(boot.data(), boot.size(), kVersion);
}

std::string pathOf(const std::string& folder, const std::string& part) {
    return fmt::format("{}/{}.state", folder, part);
}

}  // namespace

Checkpoint::Checkpoint(const std::string& temp_dir, const std::string& identity, bool resume,
                       double seconds)
    : seconds_(seconds) {
    if (identity.empty()) return;
    const std::string folder = fmt::format("{}/pietra-{:016x}.resume", temp_dir,
                                           hashBytes(identity.data(), identity.size()));
    std::error_code failed;
    std::filesystem::create_directory(folder, failed);
    if (failed) throw IoError(folder, "create", failed.value());
    lock_ = File(fmt::format("{}/{}", folder, kLock), File::Mode::kCreate);
    if (::flock(lock_.descriptor(), LOCK_EX | LOCK_NB) != 0) {
        if (resume) throw UsageError("this model is being built by another process");
        return;
    }
    folder_ = folder;
    resumes_ = is_worth_keeping_ = resume && load(kFirst);
    if (resumes_) return;
    for (const auto& file : std::filesystem::directory_iterator(folder))
        if (file.path().filename() != kLock) std::filesystem::remove(file);
}

Checkpoint::~Checkpoint() {
    std::error_code ignored;
    if (!folder_.empty() && !is_worth_keeping_) std::filesystem::remove_all(folder_, ignored);
}

bool Checkpoint::isDue() {
    began_.restart();
    const double least = seconds_ > 0 ? std::max(seconds_, cost_seconds_ / kMostCost) : 0;
    return !folder_.empty() && since_.seconds() >= least;
}

std::optional<StateReader> Checkpoint::load(const std::string& part) const {
    const std::string path = pathOf(folder_, part);
    if (folder_.empty() || !std::filesystem::exists(path)) return {};
    const File file(path, File::Mode::kRead);
    Head head;
    if (file.size() < sizeof head) return {};
    std::vector<std::byte> bytes(size_t(file.size()) - sizeof head);
    file.readAt(0, &head, sizeof head);
    file.readAt(sizeof head, bytes.data(), bytes.size());
    if (head.session != session() || head.hash != hashBytes(bytes.data(), bytes.size())) return {};
    return StateReader(std::move(bytes));
}

void Checkpoint::save(const std::string& part, const StateWriter& state) {
    const std::string path = pathOf(folder_, part);
    const Head head{session(), hashBytes(state.bytes().data(), state.bytes().size())};
    AtomicFile file(path, true);
    file.file().write(&head, sizeof head);
    file.file().write(state.bytes().data(), state.bytes().size());
    file.commit();
    is_worth_keeping_ = true;
    cost_seconds_ = began_.seconds();
    since_.restart();
}

void Checkpoint::remove(const std::string& name) const {
    std::error_code ignored;
    std::filesystem::remove(folder_ + "/" + name, ignored);
}

}  // namespace pietra
