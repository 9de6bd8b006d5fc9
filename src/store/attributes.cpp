#include "store/attributes.h"

#include <fmt/format.h>

#include "base/check.h"
#include "store/byte_stream.h"
#include "store/page_codec.h"

namespace pietra {

namespace {

enum Kind : uint8_t { kNormal = 1, kColour = 2, kScalar = 3 };
constexpr uint8_t kGivenFlag = 1;  // comes from the input, was not computed
constexpr uint32_t kMaxName = 1024;

void writeAttribute(ByteWriter& writer, Kind kind, bool given, const std::string& name) {
    writer.fixed(uint8_t(kind));
    writer.fixed(uint8_t(given ? kGivenFlag : 0));
    const size_t length = std::min(name.size(), size_t(kMaxName));
    writer.varint(length);
    writer.raw(name.data(), length);
}

}  // namespace

std::vector<std::byte> encodeAttributes(const AttributeSchema& schema) {
    CHECK_LE(schema.scalars.size(), size_t(kMaxScalars));
    std::vector<std::byte> bytes;
    ByteWriter writer(bytes);
    writer.varint(1 + size_t(schema.colours) + schema.scalars.size());
    writeAttribute(writer, kNormal, schema.normals_given, "");
    if (schema.colours) writeAttribute(writer, kColour, true, "");
    for (const std::string& name : schema.scalars) writeAttribute(writer, kScalar, true, name);
    return bytes;
}

bool decodeAttributes(std::span<const std::byte> bytes, AttributeSchema& schema,
                      std::string& fault) {
    schema = {};
    ByteReader reader(bytes);
    const uint32_t count = reader.varintUpTo(2 + kMaxScalars);
    for (uint32_t i = 0; i < count; ++i) {
        const auto kind = reader.fixed<uint8_t>();
        const auto flags = reader.fixed<uint8_t>();
        const std::span<const std::byte> text = reader.take(reader.varintUpTo(kMaxName));
        if (!reader.ok()) break;
        switch (kind) {
            case kNormal:
                schema.normals_given = (flags & kGivenFlag) != 0;
                break;
            case kColour:
                schema.colours = true;
                break;
            case kScalar:
                schema.scalars.emplace_back(reinterpret_cast<const char*>(text.data()),
                                            text.size());
                break;
            default:
                fault = fmt::format("attribute kind {} is unknown to this version", kind);
                return false;
        }
    }
    if (!reader.ok() || reader.remaining() != 0 || schema.scalars.size() > kMaxScalars) {
        fault = "the list of attributes is damaged";
        return false;
    }
    return true;
}

}  // namespace pietra
