#pragma once
// State of a long job on its way to a file and back, for the same program on the same machine:
// plain values as they lie in memory. Whoever stores the bytes sees to it that they are whole; what
// does not fit them is a bug here.

#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/check.h"

namespace pietra {

class StateWriter {
public:
    template <class T>
    void put(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        append(&value, sizeof value);
    }
    template <class T>
    void put(const std::vector<T>& values) {
        static_assert(std::is_trivially_copyable_v<T>);
        put(values.size());
        append(values.data(), values.size() * sizeof(T));
    }
    void put(const std::string& text) { put(std::vector<char>(text.begin(), text.end())); }
    std::span<const std::byte> bytes() const { return bytes_; }

private:
    void append(const void* data, size_t size) {
        const size_t begin = bytes_.size();
        bytes_.resize(begin + size);
        if (size > 0) std::memcpy(bytes_.data() + begin, data, size);
    }
    std::vector<std::byte> bytes_;
};

class StateReader {
public:
    explicit StateReader(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}
    template <class T>
    void get(T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        take(&value, sizeof value);
    }
    template <class T>
    void get(std::vector<T>& values) {
        values.resize(get<size_t>());
        take(values.data(), values.size() * sizeof(T));
    }
    void get(std::string& text) {
        std::vector<char> characters;
        get(characters);
        text.assign(characters.begin(), characters.end());
    }
    template <class T>
    T get() {
        T value;
        get(value);
        return value;
    }

private:
    void take(void* data, size_t size) {
        CHECK_LE(size, bytes_.size() - at_);
        if (size > 0) std::memcpy(data, bytes_.data() + at_, size);
        at_ += size;
    }
    std::vector<std::byte> bytes_;
    size_t at_ = 0;
};

}  // namespace pietra
