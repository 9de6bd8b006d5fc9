#include "store/page_codec.h"

#include <fmt/format.h>

#include "store/front_codec.h"
#include "store/page_format.h"
#include "store/plain_codec.h"

namespace pietra {

namespace {

bool decodeBody(const PageHeader& header, ByteReader& reader, std::vector<Mesh>& patches,
                std::string& fault) {
    patches.resize(header.patches.size());
    switch (PageCodec(header.codec)) {
        case PageCodec::kPlain:
            return decodePlain(header, reader, patches, fault);
        case PageCodec::kFront:
            return decodeFront(header, reader, patches, fault);
        default:
            fault = fmt::format("its codec {} is unknown to this version", header.codec);
            return false;
    }
}

std::vector<std::byte> encodeWith(PageCodec codec, PageHeader& header,
                                  std::span<const Mesh* const> patches) {
    std::vector<std::byte> page;
    ByteWriter writer(page);
    header.codec = uint8_t(codec);
    writePageHeader(header, writer);
    if (codec == PageCodec::kPlain)
        encodePlain(header, patches, writer);
    else if (!encodeFront(header, patches, writer))
        page.clear();
    return page;
}

}  // namespace

std::vector<std::byte> encodePage(std::span<const Mesh* const> patches,
                                  const PageSettings& settings, PageCodec codec) {
    PageHeader header = describePage(patches, settings);
    if (codec != PageCodec::kPlain) {
        std::vector<std::byte> page = encodeWith(PageCodec::kFront, header, patches);
        if (!page.empty()) return page;
    }
    return encodeWith(PageCodec::kPlain, header, patches);
}

bool peekPage(std::span<const std::byte> bytes, PageCounts& counts, std::string& fault) {
    ByteReader reader(bytes);
    PageHeader header;
    if (!readPageHeader(reader, header, fault)) return false;
    counts = {uint32_t(header.patches.size()), header.vertexCount(), header.triangleCount()};
    return true;
}

bool decodePage(std::span<const std::byte> bytes, const PageSettings& settings,
                std::vector<Mesh>& patches, std::string& fault) {
    ByteReader reader(bytes);
    PageHeader header;
    if (!readPageHeader(reader, header, fault)) return false;
    if (header.colours != settings.colours || header.scalar_count != settings.scalar_count) {
        fault = "its attributes are not the model's";
        return false;
    }
    if (header.shift < settings.shift) {
        fault = "its lattice is finer than the model's";
        return false;
    }
    return decodeBody(header, reader, patches, fault);
}

}  // namespace pietra
