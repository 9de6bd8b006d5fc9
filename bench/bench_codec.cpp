// Sizes and speeds of the page codecs on the pages of real models, one core:
//   bench_codec [--bits N] MODEL.pietra...
// For each codec and band of levels: bytes a stored triangle, nanoseconds a triangle to encode,
// million triangles a second to decode (processor time, median of several passes).

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>

#include "base/check.h"
#include "base/error.h"
#include "clock.h"
#include "store/model_reader.h"

namespace pietra {
namespace {

constexpr int kPasses = 5;
constexpr uint64_t kMostTriangles = 200000;  // of a band; more only take time

double medianSeconds(const std::function<void()>& work) {
    std::vector<double> seconds;
    for (int pass = 0; pass < kPasses; ++pass) {
        const double begin = threadSeconds();
        work();
        seconds.push_back(threadSeconds() - begin);
    }
    std::ranges::nth_element(seconds, seconds.begin() + kPasses / 2);
    return seconds[kPasses / 2];
}

struct Band {
    std::string name;
    std::vector<std::vector<Mesh>> pages;
    uint64_t triangles = 0;
};

void load(const ModelReader& model, uint32_t first_level, uint32_t last_level, Band& band) {
    for (uint32_t p = 0; p < model.pageCount(); ++p) {
        const uint16_t level = model.nodes()[model.page(p).first_node].level;
        if (level < first_level || level > last_level || band.triangles > kMostTriangles) continue;
        model.decode(p, band.pages.emplace_back());
        for (const Mesh& mesh : band.pages.back()) band.triangles += mesh.triangleCount();
    }
}

void measure(const Band& band, const PageSettings& settings, PageCodec codec, const char* name) {
    std::vector<std::vector<std::byte>> encoded(band.pages.size());
    uint64_t bytes = 0, chosen = 0;
    const double encode_s = medianSeconds([&] {
        for (size_t i = 0; i < band.pages.size(); ++i) {
            std::vector<const Mesh*> patches;
            for (const Mesh& mesh : band.pages[i]) patches.push_back(&mesh);
            encoded[i] = encodePage(patches, settings, codec);
        }
    });
    for (const auto& page : encoded) {
        bytes += page.size();
        chosen += uint8_t(page[0]) == uint8_t(codec);
    }
    std::vector<Mesh> patches;
    std::string fault;
    const double decode_s = medianSeconds([&] {
        for (const auto& page : encoded) CHECK(decodePage(page, settings, patches, fault));
    });
    const auto n = double(band.triangles);
    fmt::print("| {:28} | {:5} | {:6.3f} | {:6.1f} | {:6.1f} | {}/{} |\n", band.name, name,
               double(bytes) / n, encode_s * 1e9 / n, n / decode_s * 1e-6, chosen, encoded.size());
}

void run(const std::string& path, int bits) {
    const ModelReader model(path);
    PageSettings settings = model.pageSettings();
    settings.normal_bits = bits;
    const std::string name = path.substr(path.rfind('/') + 1);
    const uint32_t last = model.info().levels - 1;
    for (const auto& [from, to] : {std::pair(last, last), std::pair(last - 2, last - 1),
                                   std::pair(0u, last - 3), std::pair(0u, last)}) {
        Band band;
        band.name = fmt::format("{} {}-{}", name, from, to);
        load(model, from, to, band);
        measure(band, settings, PageCodec::kPlain, "plain");
        measure(band, settings, PageCodec::kFront, "front");
    }
}

}  // namespace
}  // namespace pietra

int main(int argc, char** argv) {
    int bits = 10;
    fmt::print("| model, levels | codec | B/tri | encode ns/tri | decode Mtri/s | pages |\n");
    for (int i = 1; i < argc; ++i) try {
            if (std::strcmp(argv[i], "--bits") == 0 && i + 1 < argc)
                bits = std::atoi(argv[++i]);
            else
                pietra::run(argv[i], bits);
        } catch (const pietra::Error& error) {
            fmt::print(stderr, "bench_codec: {}\n", error.what());
            return error.exitCode();
        }
    return 0;
}
