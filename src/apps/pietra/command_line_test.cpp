#include "apps/pietra/command_line.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <sstream>

#include "base/error.h"

namespace pietra {
namespace {

class PaintVerb : public Verb {
public:
    std::vector<std::string> inputs;
    std::string output;
    double thickness = 0.25;
    std::optional<uint64_t> coats;
    uint64_t memory = 512 << 20;
    std::string colour = "red";
    std::vector<std::string> masks;
    bool dry = false;
    PictureSize size;

    VerbText text() const override {
        return {"paint",
                "paint some walls",
                {"WALL... -o PICTURE [options]"},
                {"Paints every wall named."},
                {{"one wall", "pietra paint north -o north.png"}},
                "Paints",
                {{"red", "a warm one"}}};
    }
    void declare(OptionSet& options) override {
        options.files("WALL", inputs, "The walls.").require();
        options.text("-o,--output", "PICTURE", output, "The picture.").require();
        options.number("--thickness", "MM", thickness, {.min = 0}, "Of the paint, in mm.");
        options.count("--coats", "N", coats, {.min = 1}, "How many coats.").defaultsTo("as needed");
        options.size("--memory", memory, "Limit.");
        options.choice("--colour", colour, {"red", "green"}, "Which paint.");
        options.texts("--mask", "FILE", masks, "Leave these out.");
        options.pictureSize("--size", size, "Of the picture.");
        options.flag("-n,--dry", dry, "Only pretend.");
    }
    int run(const RunContext&) override { return 0; }
};

class CommandLine : public ::testing::Test {
protected:
    CommandLine() {
        verbs.push_back(std::make_unique<PaintVerb>());
        paint = static_cast<PaintVerb*>(verbs[0].get());
    }
    Command parse(const std::string& line) {
        std::istringstream words(line);
        return parseCommandLine({std::istream_iterator<std::string>(words), {}}, verbs, common);
    }
    std::string faultOf(const std::string& line) {
        try {
            parse(line);
        } catch (const UsageError& error) {
            return error.what();
        }
        return "";
    }
    VerbTable verbs;
    PaintVerb* paint;
    CommonOptions common;
};

TEST_F(CommandLine, setsWhatIsGivenAndLeavesTheRest) {
    const Command command =
        parse("paint a b -o c --thickness=1e-2 --coats 3k --memory 1G --size 64x32 --force");
    EXPECT_EQ(command.verb, paint);
    EXPECT_EQ(paint->inputs, (std::vector<std::string>{"a", "b"}));
    EXPECT_EQ(paint->output, "c");
    EXPECT_EQ(paint->thickness, 0.01);
    EXPECT_EQ(paint->coats, 3000u);
    EXPECT_EQ(paint->memory, 1u << 30);
    EXPECT_EQ(paint->size.height, 32);
    EXPECT_EQ(paint->colour, "red");
    EXPECT_FALSE(paint->dry);
    EXPECT_TRUE(common.force);
    EXPECT_FALSE(common.quiet);
    EXPECT_EQ(common.progress, "auto");
}

TEST_F(CommandLine, takesOptionsInAnyOrder) {
    EXPECT_EQ(parse("--quiet paint -o c -n a --mask x y --colour green").verb, paint);
    EXPECT_EQ(paint->inputs, std::vector<std::string>{"a"});
    EXPECT_EQ(paint->masks, (std::vector<std::string>{"x", "y"}));
    EXPECT_TRUE(paint->dry);
    EXPECT_TRUE(common.quiet);
}

TEST_F(CommandLine, theLastOneWinsAndDashesEndOptions) {
    parse("paint -o b -o c -- -a paint");
    EXPECT_EQ(paint->output, "c");
    EXPECT_EQ(paint->inputs, (std::vector<std::string>{"-a", "paint"}));
}

TEST_F(CommandLine, aFileMayBeCalledLikeAVerb) {
    parse("paint paint -o c");
    EXPECT_EQ(paint->inputs, std::vector<std::string>{"paint"});
}

TEST_F(CommandLine, explainsWhatIsWrong) {
    const std::string end = " (see pietra paint --help)";
    EXPECT_EQ(faultOf(""), "no verb given (see pietra --help)");
    EXPECT_EQ(faultOf("--force"), "no verb given (see pietra --help)");
    EXPECT_EQ(faultOf("fly"), "unknown verb 'fly' (see pietra --help)");
    EXPECT_EQ(faultOf("piant a"), "unknown verb 'piant'; did you mean paint? (see pietra --help)");
    EXPECT_EQ(faultOf("--verison"),
              "unknown option '--verison'; did you mean --version? (see pietra --help)");
    EXPECT_EQ(faultOf("paint"), "paint: WALL is missing" + end);
    EXPECT_EQ(faultOf("paint a"), "paint: option --output PICTURE is missing" + end);
    EXPECT_EQ(faultOf("paint a -o c --bogus 3"), "paint: unknown option '--bogus'" + end);
    EXPECT_EQ(faultOf("paint --bogus"), "paint: unknown option '--bogus'" + end);
    EXPECT_EQ(faultOf("paint a -o c --memroy 3"),
              "paint: unknown option '--memroy'; did you mean --memory?" + end);
    EXPECT_EQ(faultOf("paint a -o"), "paint: option --output needs a value" + end);
    EXPECT_EQ(faultOf("paint a -o c --memory 12Q"),
              "paint: --memory: '12Q' is not a size (such as 512M, 1.5G or 1000000)" + end);
    EXPECT_EQ(faultOf("paint a -o c --colour blue"),
              "paint: --colour: 'blue' is none of red, green" + end);
    EXPECT_EQ(faultOf("paint a -o c --thickness -1"),
              "paint: --thickness: '-1' must be at least 0" + end);
    EXPECT_EQ(faultOf("paint a -o c --progress loud"),
              "paint: --progress: 'loud' is none of auto, bar, plain, json, none" + end);
}

TEST_F(CommandLine, helpAndVersionNeedNothingElse) {
    EXPECT_NE(parse("--version").print.find("pietra "), std::string::npos);
    EXPECT_EQ(parse("--version").verb, nullptr);
    const std::string program = parse("--help").print;
    EXPECT_NE(program.find("  paint     paint some walls\n"), std::string::npos);
    for (const char* line : {"paint --help", "paint -h", "help paint", "paint a --help"}) {
        const std::string page = parse(line).print;
        for (const char* part :
             {"pietra paint - paint some walls\n", "  pietra paint WALL... -o PICTURE [options]\n",
              "  -o, --output PICTURE        The picture.\n", "      --coats N",
              "How many coats. (default: as needed)\n", "(default: 0.25)\n",
              "(default: 1280x1024)\n", "  # one wall\n  pietra paint north -o north.png\n",
              "      --colour red|green      Which paint. (default: red)\n",
              "\nPaints:\n  red         a warm one\n", "\nExit status:\n"})
            EXPECT_NE(page.find(part), std::string::npos) << part << "\nin\n" << page;
        std::istringstream lines(page);
        for (std::string l; std::getline(lines, l);) EXPECT_LE(l.size(), 100u) << l;
    }
}

class ConfigFile : public CommandLine {
protected:
    ConfigFile() : path(testing::TempDir() + "pietra_config_test.conf") {}
    ~ConfigFile() override { std::remove(path.c_str()); }
    void write(const std::string& text) { std::ofstream(path) << text; }
    std::string path;
};

TEST_F(ConfigFile, givesOptionsThatTheCommandLineOverrides) {
    write(
        "# for the whole house\nquiet = true\nlog-level = debug\n[paint]\nmemory = \"1G\"\n"
        "thickness = 2\ndry = false\nmask = [\"x\", \"y z\"]\n");
    parse("paint a -o c --thickness 3 --config " + path);
    EXPECT_EQ(paint->memory, 1u << 30);
    EXPECT_EQ(paint->thickness, 3);
    EXPECT_FALSE(paint->dry);
    EXPECT_TRUE(common.quiet);
    EXPECT_EQ(common.log_level, "debug");
    EXPECT_EQ(paint->masks, (std::vector<std::string>{"x", "y z"}));
}

TEST_F(ConfigFile, faultsAreNamed) {
    write("[paint]\nmemroy = 1G\n");
    EXPECT_EQ(faultOf("paint a -o c --config " + path),
              "paint: " + path + ": unknown key 'paint.memroy' (see pietra paint --help)");
    write("[paint]\nmemory = 1Q\n");
    EXPECT_EQ(faultOf("paint a -o c --config " + path),
              "paint: --memory: '1Q' is not a size (such as 512M, 1.5G or 1000000) "
              "(see pietra paint --help)");
    EXPECT_THROW(parse("paint a -o c --config /nonexistent/f"), IoError);
}

}  // namespace
}  // namespace pietra
