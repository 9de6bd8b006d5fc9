// Camera files and reports.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/pietra/camera_json.h"
#include "apps/pietra/json_report.h"
#include "base/error.h"

namespace pietra {
namespace {

class TemporaryFile {
public:
    explicit TemporaryFile(const std::string& text = "")
        : path(testing::TempDir() + "pietra_files_test") {
        std::ofstream(path) << text;
    }
    ~TemporaryFile() { std::remove(path.c_str()); }
    const std::string path;
};

std::string faultOf(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

TEST(CameraJson, aCameraIsRead) {
    const TemporaryFile file(R"({"eye":[1,2.5,3e2],"target":[0,0,0],"up":[0,1,0],"fovy_deg":30})");
    const Camera camera = readCamera(file.path, {0, 0, 1});
    EXPECT_EQ(camera.eye, Vec3d(1, 2.5, 300));
    EXPECT_EQ(camera.target, Vec3d(0, 0, 0));
    EXPECT_EQ(camera.up, Vec3d(0, 1, 0));
    EXPECT_EQ(camera.fovy_deg, 30);
}

TEST(CameraJson, upAndFieldOfViewHaveDefaults) {
    const TemporaryFile file(R"({"eye":[1,0,0],"target":[0,0,0]})");
    const Camera camera = readCamera(file.path, {0, 0, 1});
    EXPECT_EQ(camera.up, Vec3d(0, 0, 1));
    EXPECT_EQ(camera.fovy_deg, 45);
}

TEST(CameraJson, everyFaultIsNamed) {
    const std::pair<const char*, const char*> cases[] = {
        {"", "byte 0: is not valid JSON here"},
        {R"({"eye":[1,2,}])", "byte 12: is not valid JSON here"},
        {R"({"eye":[1e999,2,3]})", "a number is too large"},
        {"[]", "is not a JSON object"},
        {"{}", "lacks \"eye\""},
        {R"({"eye":[1,2,3]})", "lacks \"target\""},
        {R"({"eye":[1,2],"target":[0,0,0]})", "eye: is not an array of three numbers"},
        {R"({"eye":[1,2,"3"],"target":[0,0,0]})", "eye: is not an array of three numbers"},
        {R"({"eye":[0,0,0],"target":[0,0,0]})", "target: is the same point as \"eye\""},
        {R"({"eye":[1,0,0],"target":[0,0,0],"up":[0,0,0]})", "up: is zero"},
        {R"({"eye":[1,0,0],"target":[0,0,0],"fovy_deg":180})",
         "fovy_deg: must be more than 0 and less than 180"},
        {R"({"eye":[1,0,0],"target":[0,0,0],"fovy_deg":"wide"})", "fovy_deg: is not a number"},
    };
    for (const auto& [text, fault] : cases) {
        const TemporaryFile file(text);
        EXPECT_EQ(faultOf([&] { readCamera(file.path, {0, 0, 1}); }), file.path + ": " + fault);
    }
    EXPECT_EQ(faultOf([&] {
                  readCamera("/nonexistent", {0, 0, 1});
              }),
              "/nonexistent: cannot open: No such file or directory");
}

TEST(CameraJson, aPathIsReadAndItsFaultsAreNamed) {
    const TemporaryFile good(
        R"({"seconds":20,"keys":[{"t":0,"eye":[1,0,0],"target":[0,0,0],"up":[0,1,0],"fovy_deg":40},
            {"t":20,"eye":[3,0,0],"target":[0,0,0]}]})");
    const CameraPath path = readCameraPath(good.path, {0, 0, 1});
    EXPECT_EQ(path.seconds, 20);
    ASSERT_EQ(path.keys.size(), 2u);
    EXPECT_EQ(path.at(10).eye, Vec3d(2, 0, 0));
    EXPECT_EQ(path.keys[0].camera.fovy_deg, 40);
    const std::pair<const char*, const char*> cases[] = {
        {R"({"keys":[]})", "lacks \"seconds\""},
        {R"({"seconds":0,"keys":[]})", "seconds: must be more than 0"},
        {R"({"seconds":1,"keys":[]})", "keys: is not an array of at least one key"},
        {R"({"seconds":1,"keys":[7]})", "keys[0]: is not a JSON object"},
        {R"({"seconds":1,"keys":[{"t":0,"eye":[1,0,0],"target":[0,0,0]},{"t":1}]})",
         "keys[1]: lacks \"eye\""},
        {R"({"seconds":1,"keys":[{"t":0,"eye":[1,0,0],"target":[0,0,0]},
             {"t":0,"eye":[1,0,0],"target":[0,0,0]}]})",
         "keys[1].t: must be later than that of the key before"},
    };
    for (const auto& [text, fault] : cases) {
        const TemporaryFile file(text);
        EXPECT_EQ(faultOf([&] { readCameraPath(file.path, {0, 0, 1}); }), file.path + ": " + fault);
    }
}

TEST(Report, isWrittenWholeAndNeverOverAnother) {
    TemporaryFile file;
    EXPECT_EQ(faultOf([&] {
                  writeReport(file.path, {{"a", 1}}, false);
              }),
              file.path + ": exists; --force overwrites it");
    writeReport(file.path, {{"b", 1}, {"a", "\xff"}}, true);
    std::ostringstream text;
    text << std::ifstream(file.path).rdbuf();
    EXPECT_EQ(text.str(), "{\n  \"b\": 1,\n  \"a\": \"\xef\xbf\xbd\"\n}\n");
    writeReport("", {}, false);
}

TEST(Report, outputsAreCheckedBeforeTheWork) {
    TemporaryFile file;
    checkOutput("", false);
    checkOutput("-", false);
    checkOutput(file.path, true);
    checkOutput(file.path + ".new", false);
    EXPECT_EQ(faultOf([&] { checkOutput(file.path, false); }),
              file.path + ": exists; --force overwrites it");
    EXPECT_EQ(faultOf([&] { checkOutput("/", true); }), "/: cannot write: Is a directory");
    EXPECT_EQ(faultOf([&] { checkOutput("/dev/null", true); }), "/dev/null: is no regular file");
    EXPECT_EQ(faultOf([&] { checkOutput("/nonexistent/x", true); }),
              "/nonexistent/x: cannot create: No such file or directory");
}

}  // namespace
}  // namespace pietra
