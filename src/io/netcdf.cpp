#include "io/netcdf.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <limits>

#include "base/check.h"
#include "base/error.h"

namespace pietra {

namespace {

constexpr uint32_t kDimensionTag = 10, kVariableTag = 11, kAttributeTag = 12;

size_t sizeOf(NetcdfFile::Type type) {
    constexpr size_t sizes[] = {0, 1, 1, 2, 4, 4, 8};
    return sizes[size_t(type)];
}

uint64_t bigEndian(const uint8_t* p, size_t bytes) {
    uint64_t value = 0;
    for (size_t i = 0; i < bytes; ++i) value = value << 8 | p[i];
    return value;
}

double decode(const uint8_t* p, NetcdfFile::Type type) {
    const uint64_t bits = bigEndian(p, sizeOf(type));
    switch (type) {
        case NetcdfFile::Type::kByte:
            return int8_t(bits);
        case NetcdfFile::Type::kShort:
            return int16_t(bits);
        case NetcdfFile::Type::kInt:
            return int32_t(bits);
        case NetcdfFile::Type::kFloat:
            return std::bit_cast<float>(uint32_t(bits));
        case NetcdfFile::Type::kDouble:
            return std::bit_cast<double>(bits);
        default:
            return 0;
    }
}

}  // namespace

NetcdfFile::NetcdfFile(const std::string& path)
    : file_(path, File::Mode::kRead), size_(file_.size()) {
    readHeader();
}

void NetcdfFile::fail(const std::string& what) const {
    throw InputError::atByte(file_.path(), at_, what);
}

uint64_t NetcdfFile::takeNumber(size_t bytes) {
    uint8_t data[8];
    file_.readAt(at_, data, bytes);
    at_ += bytes;
    return bigEndian(data, bytes);
}

void NetcdfFile::skip(uint64_t bytes) {
    if (bytes > size_ - at_) fail("a length in the header goes beyond the end of the file");
    at_ += bytes;
}

/// The tag and length of a list; an absent list is two zeros.
uint64_t NetcdfFile::takeCount(uint32_t tag) {
    const uint64_t found = takeNumber(4), count = takeNumber(4);
    if (found == 0 && count == 0) return 0;
    if (found != tag) fail(fmt::format("the header has tag {} where {} is expected", found, tag));
    // Every entry of a list takes eight bytes at least.
    if (count > (size_ - at_) / 8) fail("a list in the header is longer than the file");
    return count;
}

std::string NetcdfFile::takeName() {
    const uint64_t length = takeNumber(4);
    if (length > 256) fail(fmt::format("a name of {} characters", length));
    std::string name(length, '\0');
    file_.readAt(at_, name.data(), length);
    skip((length + 3) / 4 * 4);
    return name;
}

void NetcdfFile::skipAttributes() {
    for (uint64_t left = takeCount(kAttributeTag); left > 0; --left) {
        takeName();
        const uint64_t type = takeNumber(4), count = takeNumber(4);
        if (type < 1 || type > 6) fail(fmt::format("an attribute of the unknown type {}", type));
        skip((count * sizeOf(Type(type)) + 3) / 4 * 4);
    }
}

void NetcdfFile::readHeader() {
    uint8_t magic[4] = {};
    file_.readSomeAt(0, magic, 4);
    if (std::memcmp(magic, "CDF", 3) != 0 || (magic[3] != 1 && magic[3] != 2))
        throw InputError(file_.path(), "", "is no netCDF file of the classic kind");
    const size_t offset_bytes = magic[3] == 1 ? 4 : 8;
    at_ = 8;  // behind the number of records
    for (uint64_t left = takeCount(kDimensionTag); left > 0; --left) {
        std::string name = takeName();
        dimensions_.push_back({std::move(name), takeNumber(4)});
    }
    skipAttributes();
    for (uint64_t left = takeCount(kVariableTag); left > 0; --left) {
        Variable v;
        v.name = takeName();
        const uint64_t rank = takeNumber(4);
        if (rank > 1024) fail(fmt::format("a variable of {} dimensions", rank));
        v.count = 1;
        for (uint64_t k = 0; k < rank; ++k) {
            v.dimensions.push_back(takeNumber(4));
            if (v.dimensions.back() >= dimensions_.size())
                fail("a variable of an unknown dimension");
            const uint64_t length = dimensions_[v.dimensions.back()].length;
            if (length > 0 && v.count > size_ / length) fail("a variable larger than the file");
            v.count *= length;
        }
        skipAttributes();
        const uint64_t type = takeNumber(4);
        if (type < 1 || type > 6) fail(fmt::format("a variable of the unknown type {}", type));
        v.type = Type(type);
        takeNumber(4);  // its size, which is redundant
        v.offset = takeNumber(offset_bytes);
        variables_.push_back(std::move(v));
    }
}

const NetcdfFile::Variable* NetcdfFile::find(const std::string& name) const {
    for (const Variable& v : variables_)
        if (v.name == name) return &v;
    return nullptr;
}

void NetcdfFile::read(const Variable& variable, uint64_t first, size_t count,
                      std::vector<double>& out) const {
    CHECK(variable.type != Type::kChar);
    CHECK(first <= variable.count && count <= variable.count - first);
    const size_t bytes = sizeOf(variable.type);
    std::vector<uint8_t> raw(count * bytes);
    if (variable.offset > size_)
        throw InputError::atByte(path(), size_, "the file ends before variable " + variable.name);
    file_.readAt(variable.offset + first * bytes, raw.data(), raw.size());
    out.resize(count);
    for (size_t i = 0; i < count; ++i) out[i] = decode(&raw[i * bytes], variable.type);
}

}  // namespace pietra
