// The conformance suite over the toy terrain, and over toys that are broken on purpose.

#include "audit/conformance.h"

#include "audit/audit_testing.h"
#include "audit/input_survey.h"

namespace pietra {
namespace {

using conformance::Bytes;

/// A "model file" that holds the seed of a terrain and a checksum.
void writeToy(const std::string& path, uint64_t seed) {
    Bytes bytes(16);
    const uint64_t words[2] = {seed, mixBits(seed)};
    std::copy_n(reinterpret_cast<const char*>(words), 16, bytes.begin());
    conformance::writeBytes(path, bytes);
}

uint64_t readToy(const std::string& path) {
    const Bytes bytes = conformance::readBytes(path);
    uint64_t words[2] = {0, 0};
    std::copy_n(bytes.begin(), std::min<size_t>(16, bytes.size()), reinterpret_cast<char*>(words));
    if (bytes.size() != 16 || words[1] != mixBits(words[0]))
        throw InputError(path, "", "is damaged");
    return words[0];
}

std::shared_ptr<ToyTerrain> toy(uint64_t seed) {
    return std::make_shared<ToyTerrain>(
        makeToyTerrain({.seed = seed, .quantisation_error = 0.8661f}));
}

const Lattice kLattice{{1, 2, 3}, 0.5, 0};

OpenModel openToy(const std::string& path) {
    const std::shared_ptr<ToyTerrain> model = toy(readToy(path));
    OpenModel open;
    open.nodes = model->nodes;
    open.info.lattice = kLattice;
    open.stream = [model](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
        streamOf(model->patches)(nodes, visit);
    };
    return open;
}

ConformanceInput toyInput(uint64_t seed) {
    return inputs::make("terrain", [seed] { return sourceOf(*toy(seed), kLattice, 0.9); });
}

ConformanceSubject toySubject() {
    ConformanceSubject subject;
    subject.name = "toy";
    subject.build = [](TriangleSource&, const std::string& path, size_t) {
        writeToy(path, 4);
        return size_t(0);
    };
    subject.open = openToy;
    subject.inputs = {toyInput(4)};
    return subject;
}

INSTANTIATE_TEST_SUITE_P(Toys, Conformance, testing::Values(toySubject()), conformanceName);

TEST(ConformanceSuite, findsWhatIsBroken) {
    using namespace conformance;
    const ScratchFile file("conformance-test");
    writeToy(file.path(), 4);
    ConformanceSubject subject = toySubject();
    const ConformanceInput input = subject.inputs[0];
    EXPECT_EQ(auditFault(subject, input, file.path()), "");
    EXPECT_EQ(auditFault(subject, toyInput(5), file.path()), "the finest cut is not the input");
    subject.open = [](const std::string& path) {
        OpenModel open = openToy(path);
        open.nodes[3].saturated.radius *= 0.7f;
        return open;
    };
    EXPECT_NE(auditFault(subject, input, file.path()), "");

    subject = toySubject();
    EXPECT_EQ(sameBytesFault(subject, input), "");
    int runs = 0;
    subject.build = [&runs](TriangleSource&, const std::string& path, size_t) {
        writeToy(path, uint64_t(++runs == 4));
        return size_t(0);
    };
    EXPECT_EQ(sameBytesFault(subject, input), "2 jobs and 67108864 bytes of memory: other bytes");
    subject.build = [](TriangleSource&, const std::string& path, size_t memory_bytes) {
        writeToy(path, 4);
        return memory_bytes + 1;
    };
    EXPECT_EQ(sameBytesFault(subject, input), "1 jobs: took 268435457 bytes of 268435456");

    subject = toySubject();
    EXPECT_EQ(anyDamageFault(subject, file.path(), 40), "");
    subject.open = [](const std::string& path) {
        if (readBytes(path).size() != 16) throw InputError(path, "", "is damaged");
        return OpenModel{};  // no checksum
    };
    EXPECT_NE(anyDamageFault(subject, file.path(), 40).find("flipped: accepted"),
              std::string::npos);
    subject.open = [](const std::string&) -> OpenModel { throw BugError("oops"); };
    EXPECT_EQ(anyDamageFault(subject, file.path(), 40),
              "cut to 0 of 16 bytes: no InputError: oops");
    subject.open = [](const std::string&) -> OpenModel { throw InputError("?", "", "oops"); };
    EXPECT_EQ(anyDamageFault(subject, file.path(), 40),
              "cut to 0 of 16 bytes: the message does not name the file: ?: oops");
}

/// The inputs are what they are called: counted by the survey, on a lattice that fits each.
TEST(ConformanceInputs, areWhatTheyAreCalled) {
    struct Expected {
        const char* name;
        bool border;
        uint64_t degenerate, duplicate;
    };
    const std::vector<Expected> expected = {
        {"ball", false, 0, 0},
        {"sheet with holes", true, 0, 0},
        {"shuffled soup of squares", true, 0, 0},
        {"flat", true, 0, 0},
        {"dust", false, 0, 0},
        {"non-manifold", true, 0, 0},
        {"dirty", true, 52, 78},
        {"one triangle", true, 0, 0},
    };
    const std::vector<ConformanceInput> inputs = conformanceInputs();
    ASSERT_EQ(inputs.size(), expected.size());
    for (size_t k = 0; k < inputs.size(); ++k) {
        SCOPED_TRACE(inputs[k].name);
        const std::unique_ptr<TriangleSource> source = inputs[k].open();
        Budget budget(64 << 20);
        InputTriangles triangles(*source, budget, 8 << 20, tempDir());
        Box3d box;
        triangles.forEachBatch([&](uint64_t, std::span<const InputTriangles::Corners> batch) {
            for (const InputTriangles::Corners& t : batch)
                for (const Vec3d& p : t) box.add(p);
        });
        const Vec3d size = box.max - box.min;
        const Lattice lattice{box.min, std::max({size.x, size.y, size.z}) / kLatticeMax, 0};
        const InputSurvey survey = surveyInput(triangles, lattice, budget, 16 << 20, tempDir());
        EXPECT_EQ(inputs[k].name, expected[k].name);
        EXPECT_EQ(!survey.border.empty(), expected[k].border);
        EXPECT_EQ(survey.degenerate, expected[k].degenerate);
        EXPECT_EQ(survey.duplicate, expected[k].duplicate);
    }
}

}  // namespace
}  // namespace pietra
