#pragma once
// A box of normals in 24 bits: for each coordinate the least and the largest, in units of 1/7,
// rounded outward. What it encloses has no place where it must not be: boxes nest exactly, so what
// saturation ordered stays in order.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "geometry/vec.h"

namespace pietra::pmesh {

class NormalBox {
public:
    static constexpr int32_t kUnit = 7;
    /// Of all normals, where nothing is known.
    constexpr NormalBox() : NormalBox(-kUnit, kUnit) {}
    /// Of none; encloses nothing, and must not be asked anything else.
    static constexpr NormalBox none() { return {kUnit, -kUnit}; }
    static constexpr NormalBox ofBits(uint32_t bits) {
        NormalBox box;
        for (size_t i = 0; i < 3; ++i) box.byte_[i] = uint8_t(bits >> (8 * i));
        return box;
    }

    /// Coordinate k, 0 to 2; at least -8, at most 7.
    constexpr int32_t low(size_t k) const { return int8_t(byte_[k] << 4) >> 4; }
    constexpr int32_t high(size_t k) const { return int8_t(byte_[k]) >> 4; }
    constexpr void set(size_t k, int32_t low, int32_t high) {
        byte_[k] = uint8_t((low & 15) | (high & 15) << 4);
    }
    constexpr bool empty() const {
        return low(0) > high(0) || low(1) > high(1) || low(2) > high(2);
    }
    constexpr bool encloses(const NormalBox& other) const {
        for (size_t k = 0; k < 3; ++k)
            if (other.low(k) < low(k) || other.high(k) > high(k)) return false;
        return true;
    }
    void add(const NormalBox& other) {
        for (size_t k = 0; k < 3; ++k)
            set(k, std::min(low(k), other.low(k)), std::max(high(k), other.high(k)));
    }
    /// Any length; 0 is no normal.
    void add(const Vec3d& d) {
        const double squared = glm::dot(d, d);
        if (!(squared > 0)) return;
        const Vec3d n = d * (kUnit / std::sqrt(squared));
        for (size_t k = 0; k < 3; ++k) {
            const double x = std::clamp(n[int(k)], -double(kUnit), double(kUnit));
            set(k, std::min(low(k), int32_t(std::floor(x))),
                std::max(high(k), int32_t(std::ceil(x))));
        }
    }

    constexpr uint32_t bits() const { return byte_[0] | byte_[1] << 8 | byte_[2] << 16; }
    /// As criteria have it: above the bits, twice the length of its longest vector, rounded up.
    constexpr uint32_t word() const {
        size_t squared = 0;
        for (size_t k = 0; k < 3; ++k)
            squared += size_t(std::max(low(k) * low(k), high(k) * high(k)));
        return bits() | uint32_t(kTwiceRoot[squared]) << 24;
    }
    constexpr bool operator==(const NormalBox&) const = default;

private:
    constexpr NormalBox(int32_t low, int32_t high) {
        for (size_t k = 0; k < 3; ++k) set(k, low, high);
    }
    static constexpr auto kTwiceRoot = [] {  // rounded up
        std::array<uint8_t, 3 * 8 * 8 + 1> root{};
        for (size_t i = 1; i < root.size(); ++i) {
            root[i] = root[i - 1];
            while (root[i] * root[i] < 4 * int(i)) ++root[i];
        }
        return root;
    }();
    std::array<uint8_t, 3> byte_{};
};
static_assert(sizeof(NormalBox) == 3);

}  // namespace pietra::pmesh
