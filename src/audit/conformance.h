#pragma once
// The conformance suite: what every method must keep, whatever it does inside. Include it in one
// test program, describe each method as a ConformanceSubject, and write
//
//     INSTANTIATE_TEST_SUITE_P(Methods, Conformance, testing::ValuesIn(subjects()),
//     conformanceName);
//
// Each subject is built from each input of conformanceInputs() (or inputs of its own) and must
// give: a sound hierarchy (errors monotone, bounds nested), patches as stated, crack-free random
// cuts, a finest cut that equals the input, errors that hold; the same bytes for any number of
// threads and any memory; no more memory than allowed; and it must reject every file that is cut
// short or has a flipped byte. The checks are functions that return a fault or nothing, so that
// they can be tested.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "audit/conformance_inputs.h"
#include "audit/model_audit.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/parallel.h"

namespace pietra {

/// A model file, opened.
struct OpenModel {
    std::vector<Node> nodes;
    ModelInfo info;
    PatchStream stream;  ///< keeps alive what it needs
};

struct ConformanceSubject {
    std::string name;
    /// Writes a model of the source to `path` (overwriting) with at most `memory_bytes` and as many
    /// threads as the ThreadLimit in force allows; returns the peak of its budget.
    std::function<size_t(TriangleSource&, const std::string& path, size_t memory_bytes)> build;
    /// Opens and verifies a file, all pages included. Throws InputError if anything is wrong with
    /// it.
    std::function<OpenModel(const std::string& path)> open;
    std::vector<ConformanceInput> inputs = conformanceInputs();
    size_t memory_bytes = size_t(256) << 20;
};

namespace conformance {

using Bytes = std::vector<char>;

inline Bytes readBytes(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return Bytes(std::istreambuf_iterator<char>(file), {});
}

inline void writeBytes(const std::string& path, const Bytes& bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

/// A name in the temporary directory, of this process alone; the file is removed at the end.
class ScratchFile {
public:
    explicit ScratchFile(const std::string& name)
        : path_((std::filesystem::temp_directory_path() /
                 (name + "-" + std::to_string(getpid()) + ".pietra"))
                    .string()) {}
    ~ScratchFile() { std::filesystem::remove(path_); }
    const std::string& path() const { return path_; }

private:
    std::string path_;
};

/// Audits the model at `path` against its input; empty if all is well.
inline std::string auditFault(const ConformanceSubject& subject, const ConformanceInput& input,
                              const std::string& path) {
    const OpenModel model = subject.open(path);
    const std::unique_ptr<TriangleSource> source = input.open();
    Budget budget(size_t(256) << 20);
    Progress progress;
    AuditOptions options;
    options.cuts = 12;
    options.samples = 100000;
    options.temp_dir = std::filesystem::temp_directory_path().string();
    const AuditReport with_input = auditModel({model.nodes, model.info, model.stream}, source.get(),
                                              options, budget, progress);
    if (!with_input.ok()) return with_input.first_fault;
    // Coarse against finest must hold as well: `check` claims it where there is no input.
    const AuditReport alone =
        auditModel({model.nodes, model.info, model.stream}, nullptr, options, budget, progress);
    return alone.first_fault;
}

/// Builds with 1, 2 and 7 threads, and with a quarter of the memory; empty if all files are equal.
inline std::string sameBytesFault(const ConformanceSubject& subject,
                                  const ConformanceInput& input) {
    Bytes first;
    for (const int jobs : {1, 2, 7})
        for (const size_t memory : {subject.memory_bytes, subject.memory_bytes / 4}) {
            const ScratchFile file("conformance-bytes");
            const ThreadLimit limit(jobs);
            const size_t peak = subject.build(*input.open(), file.path(), memory);
            if (peak > memory)
                return fmt::format("{} jobs: took {} bytes of {}", jobs, peak, memory);
            const Bytes bytes = readBytes(file.path());
            if (bytes.empty()) return fmt::format("{} jobs: no output", jobs);
            if (first.empty()) first = bytes;
            if (bytes != first)
                return fmt::format("{} jobs and {} bytes of memory: other bytes", jobs, memory);
        }
    return {};
}

/// What opening the damaged bytes does: empty if it is refused as it should be.
inline std::string damageFault(const ConformanceSubject& subject, const Bytes& bytes,
                               const std::string& what) {
    const ScratchFile file("conformance-damage");
    writeBytes(file.path(), bytes);
    try {
        subject.open(file.path());
    } catch (const InputError& error) {
        const std::string message = error.what();
        if (message.find(file.path()) != std::string::npos) return {};
        return fmt::format("{}: the message does not name the file: {}", what, message);
    } catch (const std::exception& error) {
        return fmt::format("{}: no InputError: {}", what, error.what());
    }
    return what + ": accepted";
}

/// Cuts the file short at `trials` lengths and flips a bit at as many places, all seeded.
inline std::string anyDamageFault(const ConformanceSubject& subject, const std::string& path,
                                  int trials) {
    const Bytes whole = readBytes(path);
    for (int k = 0; k < trials; ++k) {
        const uint64_t dice = mixBits(uint64_t(k) + 1);
        const size_t length = k == 0 ? 0 : k == 1 ? whole.size() - 1 : dice % whole.size();
        const std::string fault =
            damageFault(subject, Bytes(whole.begin(), whole.begin() + ptrdiff_t(length)),
                        fmt::format("cut to {} of {} bytes", length, whole.size()));
        if (!fault.empty()) return fault;
        Bytes flipped = whole;
        const size_t place = mixBits(dice) % whole.size();
        flipped[place] = char(flipped[place] ^ 1 << (dice % 8));
        const std::string flip_fault = damageFault(
            subject, flipped, fmt::format("bit {} of byte {} flipped", dice % 8, place));
        if (!flip_fault.empty()) return flip_fault;
    }
    return {};
}

}  // namespace conformance

class Conformance : public testing::TestWithParam<ConformanceSubject> {};

inline std::string conformanceName(const testing::TestParamInfo<ConformanceSubject>& info) {
    return info.param.name;
}

TEST_P(Conformance, everyModelPassesItsAudit) {
    for (const ConformanceInput& input : GetParam().inputs) {
        SCOPED_TRACE(input.name);
        const conformance::ScratchFile file("conformance-audit");
        GetParam().build(*input.open(), file.path(), GetParam().memory_bytes);
        EXPECT_EQ(conformance::auditFault(GetParam(), input, file.path()), "");
    }
}

TEST_P(Conformance, sameBytesForAnyThreadsAndMemory) {
    for (const ConformanceInput& input : GetParam().inputs) {
        SCOPED_TRACE(input.name);
        EXPECT_EQ(conformance::sameBytesFault(GetParam(), input), "");
    }
}

TEST_P(Conformance, damageIsNoticed) {
    const ConformanceInput& input = GetParam().inputs.front();
    const conformance::ScratchFile file("conformance-whole");
    GetParam().build(*input.open(), file.path(), GetParam().memory_bytes);
    EXPECT_EQ(conformance::anyDamageFault(GetParam(), file.path(), 64), "");
}

}  // namespace pietra
