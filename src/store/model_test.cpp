#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>

#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/parallel.h"
#include "base/scratch_directory.h"
#include "store/model_reader.h"
#include "store/model_writer.h"
#include "store/node_block.h"
#include "store/test_meshes.h"
#include "store/verify.h"

namespace pietra {
namespace {

using namespace pietra::testing;
namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

/// A directory of its own for each test, removed afterwards.
class ModelTest : public ::testing::Test {
protected:
    std::string pathTo(const std::string& name) const { return scratch_.file(name); }
    std::string directory() const { return scratch_.path(); }

    static Bytes load(const std::string& path) {
        Bytes bytes(fs::file_size(path));
        std::ifstream(path, std::ios::binary)
            .read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()));
        return bytes;
    }
    static void save(const std::string& path, std::span<const std::byte> bytes) {
        std::ofstream(path, std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    }

private:
    const ScratchDirectory scratch_;
};

/// A model to be written: a binary tree of small sheets, four nodes a page, groups of two.
struct Plan {
    uint32_t levels = 4;
    AttributeSchema schema;
    int columns = 5;
    bool face_sizes = true;
    std::function<void(Node&, uint32_t index)> change;  ///< spoils nodes before they are written
    std::function<void(Mesh&, uint32_t index)> change_patch;
};

Sphere enclosing(const Mesh& mesh) {
    Box3i box;
    for (const Vec3i& p : mesh.position) box.add(p);
    const Vec3d low(box.min), high(box.max);
    return {Vec3f((low + high) * 0.5), float(glm::length(high - low) * 0.5 + 1)};
}

Node describe(const Mesh& mesh, uint32_t level, uint32_t index, uint32_t levels) {
    Node node;
    node.bounds = enclosing(mesh);
    node.saturated = {Vec3f(400000), 600000 + 1000 * float(levels - level)};
    node.error = 100 / float(1u << level);
    node.face_size = 200 / float(1u << level);
    node.cone = {{0, 0, 1}, -1};
    node.group = (1u << level) + index / 2;
    node.triangles = uint32_t(mesh.triangleCount());
    node.vertices = uint32_t(mesh.vertexCount());
    node.closed = index % 3 == 0;
    return node;
}

PageSettings settingsOf(const AttributeSchema& schema) {
    return {1, schema.colours, int(schema.scalars.size()), 10};
}

ModelInfo infoOf(const Plan& plan) {
    ModelInfo info;
    info.method = "tetra";
    info.face_sizes = plan.face_sizes;
    info.lattice = {{1.5, -2e6, 3}, 0.125, 1};
    info.schema = plan.schema;
    info.input_triangles = 12345;
    info.input_vertices = 6789;
    info.input_files = 2;
    info.dropped_degenerate = 3;
    info.dropped_duplicate = 4;
    info.quantisation_error = 0.9f;
    info.bounds.add(Vec3i(7, 8, 9));
    info.bounds.add(Vec3i(1000, 2000, 3000));
    return info;
}

void writeModel(const std::string& path, const std::string& temp_dir, const Plan& plan,
                bool force = false) {
    Budget budget(64 << 20);
    ModelWriter writer(path, force, temp_dir, budget);
    Random random(11);
    uint32_t global = (1u << plan.levels) - 1;
    for (uint32_t level = plan.levels; level-- > 0;) {
        writer.beginLevel(level);
        const uint32_t count = 1u << level;
        global -= count;
        for (uint32_t first = 0; first < count; first += 4) {
            std::vector<Mesh> meshes;
            std::vector<Node> nodes;
            for (uint32_t i = first; i < std::min(first + 4, count); ++i) {
                meshes.push_back(
                    makeSheet(plan.columns, 3 + int(i % 5), settingsOf(plan.schema), random));
                if (plan.change_patch) plan.change_patch(meshes.back(), global + i);
                nodes.push_back(describe(meshes.back(), level, i, plan.levels));
                if (level + 1 < plan.levels) {
                    nodes.back().child[0] = 2 * i;
                    nodes.back().child[1] = 2 * i + 1;
                }
                if (plan.change) plan.change(nodes.back(), global + i);
            }
            std::vector<const Mesh*> pointers;
            for (const Mesh& mesh : meshes) pointers.push_back(&mesh);
            writer.addPage(encodePage(pointers, settingsOf(plan.schema), PageCodec::kPlain), nodes);
        }
    }
    writer.finish(infoOf(plan), {17, 18, 19});
}

std::string messageOf(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.what();
    }
    return "nothing was thrown";
}

VerifyReport verify(const std::string& path) {
    const ModelReader reader(path);
    Progress progress;
    return verifyModel(reader, progress);
}

TEST_F(ModelTest, comesBackAsItWasWritten) {
    Plan plan;
    plan.levels = 6;
    plan.schema = {true, true, {"quality", "intensity"}};
    std::vector<Node> written(63);
    plan.change = [&](Node& node, uint32_t index) { written[index] = node; };
    writeModel(pathTo("a.pietra"), directory(), plan);

    const ModelReader reader(pathTo("a.pietra"));
    const ModelInfo &info = reader.info(), expected = infoOf(plan);
    EXPECT_EQ(info.method, "tetra");
    EXPECT_EQ(info.lattice.origin, expected.lattice.origin);
    EXPECT_EQ(info.lattice.step, 0.125);
    EXPECT_EQ(info.lattice.shift, 1);
    EXPECT_EQ(info.schema, plan.schema);
    EXPECT_EQ(info.input_triangles, 12345u);
    EXPECT_EQ(info.input_vertices, 6789u);
    EXPECT_EQ(info.input_files, 2u);
    EXPECT_EQ(info.dropped_degenerate, 3u);
    EXPECT_EQ(info.dropped_duplicate, 4u);
    EXPECT_EQ(info.quantisation_error, 0.9f);
    EXPECT_EQ(info.bounds.min, expected.bounds.min);
    EXPECT_EQ(info.bounds.max, expected.bounds.max);
    EXPECT_EQ(info.levels, 6u);
    EXPECT_EQ(reader.identity(), (ModelIdentity{17, 18, 19}));
    EXPECT_EQ(reader.fileBytes(), fs::file_size(pathTo("a.pietra")));

    ASSERT_EQ(reader.nodes().size(), 63u);
    EXPECT_EQ(reader.pageCount(), 1u + 1 + 1 + 2 + 4 + 8);
    for (uint32_t i = 0; i < 63; ++i) {
        const Node &node = reader.nodes()[i], &was = written[i];
        const LevelRange level = reader.level(node.level);
        EXPECT_GE(i, level.first);
        EXPECT_LT(i, level.first + level.count);
        EXPECT_EQ(node.bounds.centre, was.bounds.centre);
        EXPECT_EQ(node.bounds.radius, was.bounds.radius);
        EXPECT_EQ(node.saturated.centre, was.saturated.centre);
        EXPECT_EQ(node.saturated.radius, was.saturated.radius);
        EXPECT_EQ(node.error, was.error);
        EXPECT_EQ(node.face_size, was.face_size);
        EXPECT_EQ(node.group, was.group);
        EXPECT_EQ(node.triangles, was.triangles);
        EXPECT_EQ(node.vertices, was.vertices);
        EXPECT_EQ(node.closed, was.closed);
        EXPECT_EQ(node.level, i == 0 ? 0 : 31 - std::countl_zero(i + 1));
        if (node.level < 5) {
            EXPECT_EQ(node.child[0], 2 * i + 1);
            EXPECT_EQ(node.child[1], 2 * i + 2);
        } else {
            EXPECT_TRUE(node.isLeaf());
        }
        const PageInfo& page = reader.page(node.page);
        EXPECT_EQ(page.first_node + node.patch, i);
        EXPECT_LT(node.patch, page.node_count);
    }
    uint64_t triangles = 0;
    std::vector<Mesh> patches;
    for (uint32_t page = 0; page < reader.pageCount(); ++page) {
        reader.decode(page, patches);
        for (const Mesh& mesh : patches) triangles += mesh.triangleCount();
    }
    EXPECT_EQ(triangles, info.triangles_stored);
}

TEST_F(ModelTest, faceSizesAreInModelsThatHaveThemAlone) {
    Plan plan;
    for (const bool face_sizes : {true, false}) {
        plan.face_sizes = face_sizes;
        writeModel(pathTo("a.pietra"), directory(), plan, true);
        const ModelReader reader(pathTo("a.pietra"));
        EXPECT_EQ(reader.info().face_sizes, face_sizes);
        EXPECT_EQ(reader.formatVersion(), face_sizes ? 2u : 1u);
        EXPECT_EQ(reader.nodes()[0].face_size, face_sizes ? 200 : 0);
        EXPECT_TRUE(verify(pathTo("a.pietra")).ok());
    }
}

TEST_F(ModelTest, sameBytesEachTimeAndForAnyPath) {
    writeModel(pathTo("a.pietra"), directory(), {});
    writeModel(pathTo("another-name.pietra"), "/tmp", {});
    EXPECT_EQ(load(pathTo("a.pietra")), load(pathTo("another-name.pietra")));
}

TEST_F(ModelTest, pagesOfALevelLieTogetherCoarseToFine) {
    Plan plan;
    plan.levels = 9;
    plan.columns = 140;  // more than the front holds
    writeModel(pathTo("a.pietra"), directory(), plan);
    const ModelReader reader(pathTo("a.pietra"));
    ASSERT_GT(reader.fileBytes(), kFrontBytes + 100000);
    for (uint32_t p = 1; p < reader.pageCount(); ++p)
        EXPECT_GE(reader.page(p).offset, reader.page(p - 1).offset + reader.page(p - 1).bytes);
    const LevelRange coarse = reader.level(4);
    const PageInfo& last = reader.page(reader.nodes()[coarse.first + coarse.count - 1].page);
    EXPECT_LT(last.offset + last.bytes, kFrontBytes);
    EXPECT_TRUE(verify(pathTo("a.pietra")).ok());
}

TEST_F(ModelTest, nodesTakeFewBytes) {
    Random random(12);
    std::vector<Node> nodes;
    for (uint32_t i = 0; i < 2048; ++i) {
        const Vec3f centre(float(below(random, 1 << 21)), float(below(random, 1 << 21)),
                           float(below(random, 1 << 21)));
        Node node;
        node.bounds = {centre, 1000 + float(below(random, 1 << 16)) / 16};
        node.group = i / 4;
        node.saturated = i % 4 ? nodes.back().saturated
                               : Sphere{centre + Vec3f(0.3f), node.bounds.radius * 1.37f};
        node.error = i % 4 ? nodes.back().error : float(random()) * 0x1p-32f;
        node.face_size = i % 4 ? nodes.back().face_size : float(random()) * 0x1p-32f;
        node.cone = {glm::normalize(centre), float(below(random, 1000)) / 1000};
        node.child[0] = 5000 + 2 * i;
        node.child[1] = 5001 + 2 * i;
        node.triangles = 1000 + below(random, 3000);
        node.vertices = node.triangles / 2 + below(random, 200);
        nodes.push_back(node);
    }
    const std::vector<PageRecord> pages(512, PageRecord{0x123456789abcdef0, 20000, 4});
    EXPECT_LT(double(encodeNodeBlock(nodes, pages, false).size()) / double(nodes.size()), 40);
    EXPECT_LT(double(encodeNodeBlock(nodes, pages, true).size()) / double(nodes.size()), 41);
}

TEST_F(ModelTest, conesOnlyWiden) {
    Random random(13);
    std::normal_distribution<double> normal;
    double widest = 0;
    for (int i = 0; i < 100000; ++i) {
        const Vec3d axis = glm::normalize(Vec3d(normal(random), normal(random), normal(random)));
        const double angle = double(below(random, 3141592)) / 1e6;
        const NormalCone stored = storedCone({Vec3f(axis), float(std::cos(angle))});
        const double stored_angle = std::acos(std::max(-1.0, double(stored.cos_angle)));
        const Vec3d turned(stored.axis);
        const double turn =
            std::atan2(glm::length(glm::cross(axis, turned)), glm::dot(axis, turned));
        EXPECT_GE(stored_angle + 1e-5, std::min(angle + turn, std::numbers::pi));
        widest = std::max(widest, stored_angle - angle);
    }
    EXPECT_LT(widest, 0.025);
    EXPECT_EQ(storedCone({{0, 0, 1}, -1}).cos_angle, -1);
    EXPECT_EQ(storedCone({{0, 0, 0}, 0.5f}).cos_angle, -1);
    EXPECT_GT(storedCone({{0, 0, 1}, 1}).cos_angle, 0.9999f);
}

TEST_F(ModelTest, refusesAnOutputThatExists) {
    save(pathTo("a.pietra"), {});
    EXPECT_EQ(messageOf([&] { writeModel(pathTo("a.pietra"), directory(), {}); }),
              pathTo("a.pietra") + ": exists; --force overwrites it");
    writeModel(pathTo("a.pietra"), directory(), {}, true);
    EXPECT_TRUE(verify(pathTo("a.pietra")).ok());
}

TEST_F(ModelTest, writerLeavesNothingBehindWhenAbandoned) {
    {
        Budget budget(64 << 20);
        ModelWriter writer(pathTo("a.pietra"), false, directory(), budget);
        writer.beginLevel(0);
        EXPECT_GT(budget.used(), 0u);
    }
    EXPECT_TRUE(fs::is_empty(directory()));
    Budget none(1000);
    EXPECT_THROW(ModelWriter(pathTo("a.pietra"), false, directory(), none), MemoryError);
}

TEST_F(ModelTest, fullDiskIsAnIoErrorAndLeavesNothingBehind) {
    // A limit on the size of files stands for a full disk: write() fails in the same way.
    struct rlimit before {};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    Plan plan;
    plan.levels = 8;
    writeModel(pathTo("a.pietra"), directory(), plan);
    const rlim_t size = fs::file_size(pathTo("a.pietra"));
    fs::remove(pathTo("a.pietra"));
    for (const rlim_t limit : {rlim_t(1000), size / 2, size - 100}) {
        const struct rlimit small { limit, before.rlim_max };
        ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
        const std::string message =
            messageOf([&] { writeModel(pathTo("a.pietra"), directory(), plan); });
        setrlimit(RLIMIT_FSIZE, &before);
        EXPECT_TRUE(message.ends_with(": cannot write: File too large")) << message;
        EXPECT_TRUE(fs::is_empty(directory()));
    }
    std::signal(SIGXFSZ, handler);
    writeModel(pathTo("a.pietra"), directory(), plan);
    EXPECT_EQ(fs::file_size(pathTo("a.pietra")), size);
}

TEST_F(ModelTest, writerChecksTheOrderOfCalls) {
    Budget budget(64 << 20);
    Node node;
    const Bytes page = encodePage({}, {});
    ModelWriter writer(pathTo("a.pietra"), false, directory(), budget);
    EXPECT_THROW(writer.addPage(page, std::span(&node, 1)), BugError);
    EXPECT_THROW(writer.finish({}), BugError);
    writer.beginLevel(2);
    EXPECT_THROW(writer.beginLevel(1), BugError);  // level 2 has no page
    node.child[0] = 0;
    EXPECT_THROW(writer.addPage(page, std::span(&node, 1)), BugError);  // nothing is finer
    node.child[0] = kNoNode;
    writer.addPage(page, std::span(&node, 1));
    EXPECT_THROW(writer.beginLevel(0), BugError);
    EXPECT_THROW(writer.finish({}), BugError);  // no root
}

TEST_F(ModelTest, everyTruncationIsReported) {
    writeModel(pathTo("a.pietra"), directory(), {});
    const Bytes bytes = load(pathTo("a.pietra"));
    const std::string cut = pathTo("cut.pietra");
    save(cut, bytes);
    for (size_t length = bytes.size(); length-- > 0;) {
        fs::resize_file(cut, length);
        const std::string expected =
            length < 8 ? cut + ": byte 0: this is no Pietra model"
            : length < 512
                ? fmt::format("{}: byte {}: the file ends early, within its header", cut, length)
                : fmt::format("{}: byte {}: the file ends early, {} bytes short", cut, length,
                              bytes.size() - length);
        ASSERT_EQ(messageOf([&] { ModelReader reader(cut); }), expected);
    }
    Bytes longer = bytes;
    longer.resize(bytes.size() + 3);
    save(cut, longer);
    EXPECT_EQ(messageOf([&] { ModelReader reader(cut); }),
              fmt::format("{}: byte {}: 3 bytes too many follow the model", cut, bytes.size()));
}

TEST_F(ModelTest, everyFlippedBitIsFound) {
    writeModel(pathTo("a.pietra"), directory(), {});
    const Bytes bytes = load(pathTo("a.pietra"));
    const std::string path = pathTo("flipped.pietra");
    save(path, bytes);
    std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
    const auto put = [&](size_t i, std::byte value) {
        file.seekp(std::streamoff(i)).put(char(value)).flush();
    };
    Random random(14);
    for (size_t i = 0; i < bytes.size(); i += 1 + below(random, 4)) {
        const std::byte flipped = bytes[i] ^ std::byte(1u << below(random, 8));
        put(i, flipped);
        std::string message;
        try {
            const VerifyReport report = verify(path);
            ASSERT_FALSE(report.ok()) << "byte " << i;
            ASSERT_EQ(report.pages.bad, 1u);
            message = report.faults.at(0);
            EXPECT_TRUE(message.ends_with("is damaged (checksum)")) << message;
        } catch (const InputError& error) {
            message = error.what();
        }
        EXPECT_TRUE(message.starts_with(path + ": byte ")) << message;
        put(i, bytes[i]);
    }
    EXPECT_TRUE(verify(path).ok());
}

TEST_F(ModelTest, damagedPagesAreNamed) {
    writeModel(pathTo("a.pietra"), directory(), {});
    uint64_t offset;
    {
        const ModelReader reader(pathTo("a.pietra"));
        offset = reader.page(2).offset;
    }
    Bytes bytes = load(pathTo("a.pietra"));
    bytes[offset + 10] ^= std::byte(4);
    save(pathTo("b.pietra"), bytes);
    const ModelReader reader(pathTo("b.pietra"));
    std::vector<Mesh> patches;
    const std::string expected =
        fmt::format("{}: byte {}: page 2 is damaged (checksum)", pathTo("b.pietra"), offset);
    EXPECT_EQ(messageOf([&] { reader.decode(2, patches); }), expected);
    EXPECT_EQ(messageOf([&] { reader.decode(1, patches); }), "nothing was thrown");
    Bytes page;
    std::string fault;
    EXPECT_FALSE(reader.tryReadPage(2, page, fault));
    EXPECT_EQ(fault, "page 2 is damaged (checksum)");
    const VerifyReport report = verify(pathTo("b.pietra"));
    EXPECT_EQ(report.pages.checked, 5u);
    EXPECT_EQ(report.pages.bad, 1u);
    EXPECT_EQ(report.faults, std::vector<std::string>{expected});
}

/// Changes bytes of the header and makes its checksum right again.
std::string messageWithHeader(const std::string& path, Bytes bytes, size_t offset, uint32_t value) {
    std::memcpy(&bytes[offset], &value, sizeof value);
    const uint64_t checksum = hashBytes(bytes.data(), offsetof(FileHeader, checksum));
    std::memcpy(&bytes[offsetof(FileHeader, checksum)], &checksum, sizeof checksum);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    return messageOf([&] { ModelReader reader(path); });
}

TEST_F(ModelTest, foreignHeadersAreExplained) {
    writeModel(pathTo("a.pietra"), directory(), {});
    const Bytes bytes = load(pathTo("a.pietra"));
    const std::string p = pathTo("b.pietra");
    EXPECT_EQ(messageWithHeader(p, bytes, offsetof(FileHeader, version), 3),
              p + ": byte 8: format version 3 is unknown, this program reads versions 1 to 2");
    EXPECT_EQ(messageWithHeader(p, bytes, offsetof(FileHeader, endian), 0x04030201),
              p + ": byte 12: the byte order is not little-endian");
    EXPECT_EQ(messageWithHeader(p, bytes, offsetof(FileHeader, shift), 31),
              p + ": byte 0: the header holds impossible numbers");
    EXPECT_EQ(messageWithHeader(p, bytes, offsetof(FileHeader, blocks), 1000000),
              p + ": byte 512: the directory is damaged: its size is wrong");
    EXPECT_EQ(messageWithHeader(p, bytes, offsetof(FileHeader, nodes), 14),
              p + ": byte 512: the directory is damaged: its sums are not the header's");
    EXPECT_EQ(messageWithHeader(p, bytes, offsetof(FileHeader, sections), 9),
              p + ": byte 192: section kind 9 is unknown to this version");
    Bytes flipped = bytes;
    flipped[100] ^= std::byte(1);
    save(p, flipped);
    EXPECT_EQ(messageOf([&] { ModelReader reader(p); }),
              p + ": byte 504: the header is damaged (checksum)");
    save(p, std::as_bytes(std::span("ply\nformat ascii 1.0\n")));
    EXPECT_EQ(messageOf([&] { ModelReader reader(p); }), p + ": byte 0: this is no Pietra model");
    EXPECT_EQ(messageOf([&] { ModelReader reader(pathTo("none")); }),
              pathTo("none") + ": cannot open: No such file or directory");
}

TEST_F(ModelTest, verifyFindsWhatIsWrongWithNodes) {
    struct Case {
        const char* text;
        std::function<void(Node&, uint32_t)> change;
    };
    const Case cases[] = {
        {"node 5 has vertices outside of its bounds",
         [](Node& n, uint32_t i) {
             if (i == 5) n.bounds.radius *= 0.9f;
         }},
        {"node 5 has bounds that stick out of its saturated sphere",
         [](Node& n, uint32_t i) {
             if (i == 5) n.bounds.radius = 650000;
         }},
        {"node 2 has a child whose saturated sphere sticks out of its own",
         [](Node& n, uint32_t i) {
             if (i == 5 || i == 6) n.saturated.radius += 1500;
         }},
        {"node 2 has an error or a face size below that of a child",
         [](Node& n, uint32_t i) {
             if (i == 5 || i == 6) n.error = 60;
         }},
        {"node 2 has an error or a face size below that of a child",
         [](Node& n, uint32_t i) {
             if (i == 5 || i == 6) n.face_size = 101;
         }},
        {"node 6 differs in error, face size or saturated sphere from others of its group",
         [](Node& n, uint32_t i) {
             if (i == 6) n.error *= 0.99f;
         }},
        {"node 6 differs in error, face size or saturated sphere from others of its group",
         [](Node& n, uint32_t i) {
             if (i == 6) n.face_size *= 0.99f;
         }},
        {"node 6 has triangles whose normals lie outside of its cone",
         [](Node& n, uint32_t i) {
             if (i == 6) n.cone = {{0, 0, 1}, 0.9999f};
         }},
        {"node 5 is not the child of exactly one node of the level above",
         [](Node& n, uint32_t i) {
             if (i == 2) n.child[0] = kNoNode;
         }},
        {"node 4 is not the child of exactly one node of the level above",
         [](Node& n, uint32_t i) {
             if (i == 2) n.child[0] = 1;
         }},
    };
    for (const Case& c : cases) {
        Plan plan;
        plan.change = c.change;
        writeModel(pathTo("a.pietra"), directory(), plan, true);
        const VerifyReport report = verify(pathTo("a.pietra"));
        EXPECT_FALSE(report.ok());
        ASSERT_FALSE(report.faults.empty()) << c.text;
        EXPECT_EQ(report.faults[0], pathTo("a.pietra") + ": " + c.text);
    }
}

TEST_F(ModelTest, verifyFindsWhatIsFalselyCalledClosed) {
    const auto faultsWith = [&](const std::function<void(Mesh&)>& spoil) {
        Plan plan;
        plan.change = [](Node& n, uint32_t i) { n.closed = i == 6; };
        plan.change_patch = [&](Mesh& mesh, uint32_t i) {
            if (i == 6) spoil(mesh);
        };
        writeModel(pathTo("a.pietra"), directory(), plan, true);
        return verify(pathTo("a.pietra")).cones.bad;
    };
    EXPECT_EQ(faultsWith([](Mesh&) {}), 0u);
    EXPECT_EQ(faultsWith([](Mesh& mesh) { mesh.edge_class[2] = uint8_t(EdgeClass::kBorder); }), 1u);
    EXPECT_EQ(faultsWith([](Mesh& mesh) { std::swap(mesh.triangle[3][0], mesh.triangle[3][1]); }),
              1u);
}

TEST_F(ModelTest, verifyCountsAreTheSameForAnyNumberOfThreads) {
    Plan plan;
    plan.levels = 7;
    plan.change = [](Node& n, uint32_t i) {
        if (i % 3 == 0) n.bounds.radius *= 0.5f;
    };
    writeModel(pathTo("a.pietra"), directory(), plan);
    std::vector<std::string> faults;
    for (const int jobs : {1, 2, 7}) {
        const ThreadLimit limit(jobs);
        const VerifyReport report = verify(pathTo("a.pietra"));
        EXPECT_EQ(report.nodes.checked, 127u);
        EXPECT_EQ(report.bounds.not_nested, 43u);
        EXPECT_EQ(report.faults.size(), kMaxFaultTexts);
        EXPECT_TRUE(faults.empty() || faults == report.faults);
        faults = report.faults;
    }
}

TEST_F(ModelTest, damageBehindGoodChecksumsIsRejected) {
    Random random(15);
    std::vector<Node> nodes(20);
    for (Node& node : nodes) {
        node.triangles = below(random, 1000);
        node.face_size = float(below(random, 1000));
    }
    const std::vector<PageRecord> pages(5, PageRecord{1, 2, 4});
    for (const bool face_sizes : {false, true}) {
        const Bytes block = encodeNodeBlock(nodes, pages, face_sizes);
        const BlockEntry entry{0, 0, 0, 0, uint32_t(block.size()), 0, 0, 20, 0, 5};
        const auto decodes = [&](std::span<const std::byte> damaged, const BlockEntry& e) {
            std::vector<Node> out;
            std::vector<PageRecord> records;
            std::string fault;
            const Bytes exact(damaged.begin(), damaged.end());
            const bool good = decodeNodeBlock(exact, e, face_sizes, out, records, fault);
            EXPECT_NE(good, !fault.empty());
            return good;
        };
        EXPECT_TRUE(decodes(block, entry));
        for (size_t length = 0; length < block.size(); ++length)
            EXPECT_FALSE(decodes(std::span(block).first(length), entry));
        for (int i = 0; i < 3000; ++i) {
            Bytes flipped = block;
            flipped[below(random, uint32_t(block.size()))] ^= std::byte(1u << below(random, 8));
            decodes(flipped, entry);
        }
        BlockEntry more = entry;
        more.node_count = 21;
        EXPECT_FALSE(decodes(block, more));
    }
}

}  // namespace
}  // namespace pietra
