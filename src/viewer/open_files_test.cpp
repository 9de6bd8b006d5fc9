#include "viewer/open_files.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/error.h"
#include "base/scratch_directory.h"

namespace pietra {
namespace {

namespace fs = std::filesystem;

class OpenFilesTest : public testing::Test {
protected:
    OpenFilesTest() { scratch_.write("mesh.ply", "a mesh"); }

    std::string path(const std::string& name) const { return scratch_.file(name); }
    /// A program that does as the script says when asked to build.
    std::string program(const std::string& script) {
        scratch_.write("program", "#!/bin/sh\n" + script);
        ::chmod(path("program").c_str(), 0755);
        return path("program");
    }
    /// Until no build runs.
    static void finish(OpenFiles& files) {
        while (!files.builds().empty()) {
            files.poll();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }

    const ScratchDirectory scratch_;
};

TEST_F(OpenFilesTest, aMeshIsOfferedAndBuiltWhenAccepted) {
    OpenFiles files(
        program("echo \"$@\" > " + path("words") + "\necho 'pietra: no good' >&2\nexit 3"));
    files.open(path("mesh.ply"), false);
    ASSERT_EQ(files.offers().size(), 1u);
    EXPECT_TRUE(files.builds().empty());
    files.acceptOffers();
    EXPECT_TRUE(files.offers().empty());
    finish(files);
    EXPECT_EQ(files.faults(), std::vector<std::string>{"no good"});
    std::string words;
    std::getline(std::ifstream(path("words")), words);
    EXPECT_EQ(words, "build " + path("mesh.ply") + " -o " + path("mesh.pietra") +
                         " --force --progress json");
}

TEST_F(OpenFilesTest, progressIsTold) {
    OpenFiles files(program(
        R"(echo '{"stage":2,"stages":4,"name":"sort","done":5,"total":20}' >&2; exec sleep 60)"));
    files.open(path("mesh.ply"), true);
    const BackgroundBuild& build = *files.builds().at(0);
    while (build.fraction() == 0) files.poll();
    EXPECT_EQ(build.text(), "stage 2 of 4, sort");
    EXPECT_FLOAT_EQ(build.fraction(), 0.25f);
    files.stopBuild(&build);  // does not wait for the sleep to end
    EXPECT_TRUE(files.builds().empty());
}

TEST_F(OpenFilesTest, whatCannotBeOpenedThrows) {
    OpenFiles files("/nowhere");
    EXPECT_THROW(files.open(path("none.ply"), true), IoError);
    EXPECT_THROW(files.open(scratch_.path(), true), IoError);
    EXPECT_THROW(files.open(path("mesh.ply"), true), IoError);
}

TEST_F(OpenFilesTest, modelsLieBesideTheirMeshesOrInTheCache) {
    EXPECT_EQ(modelPathOf(path("scan.ply.gz")), path("scan.pietra"));
    EXPECT_EQ(modelPathOf(path("v1.2.obj")), path("v1.2.pietra"));
    ::setenv("XDG_CACHE_HOME", scratch_.path().c_str(), 1);
    const std::string cached = modelPathOf("/nowhere/a.ply");
    EXPECT_TRUE(cached.starts_with(path("pietra/"))) << cached;
    EXPECT_NE(cached, modelPathOf("/elsewhere/a.ply"));
}

}  // namespace
}  // namespace pietra
