#pragma once
// Numbers in text, fast. Reals are correctly rounded, as std::from_chars does it, which takes the
// rare hard ones; unlike it, a leading '+' is allowed. No locale.

#include <emmintrin.h>

#include <array>
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>

namespace pietra {

inline bool isDigit(char c) {
    return unsigned(c) - '0' < 10;
}

namespace detail {
/// The number that eight digits make; bytes from 0 to 9, the first digit lowest.
constexpr uint64_t joinDigits(uint64_t digits) {
    digits = (digits * 10 + (digits >> 8)) & 0x00ff00ff00ff00ff;
    digits = (digits * 100 + (digits >> 16)) & 0x0000ffff0000ffff;
    return uint32_t(digits * 10000 + (digits >> 32));
}

/// Moves over the digits at `p` and appends them to `value`, modulo 2^64: up to 16 at once, as the
/// processor seldom guesses where the digits of a fraction end. `end`: as for parseReal().
inline const char* takeDigits(const char* p, const char* end, uint64_t& value) {
    constexpr auto kPower = [] {
        std::array<uint64_t, 17> powers{1};
        for (size_t i = 1; i < powers.size(); ++i) powers[i] = 10 * powers[i - 1];
        return powers;
    }();
    if (end - p >= 16) {
        const __m128i text = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
        const __m128i digits = _mm_xor_si128(text, _mm_set1_epi8('0'));
        const __m128i are_digits = _mm_cmpeq_epi8(_mm_min_epu8(digits, _mm_set1_epi8(9)), digits);
        const int count = std::countr_one(uint32_t(_mm_movemask_epi8(are_digits)));
        if (count == 0) return p;
        // Zeros go before the digits.
        const auto all = std::bit_cast<unsigned __int128>(digits) << 8 * (16 - count);
        value = value * kPower[size_t(count)] + joinDigits(uint64_t(all)) * kPower[8] +
                joinDigits(uint64_t(all >> 64));
        p += count;
        if (count < 16) return p;
    }
    for (; isDigit(*p); ++p) value = value * 10 + uint64_t(*p - '0');
    return p;
}

/// Powers of ten that a double holds exactly.
inline constexpr double kExactPower[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                         1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                         1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
inline constexpr int kLargestExactPower = 22;

/// Powers of five that 64 bits hold.
inline constexpr int kLargestPowerOfFive = 27;
inline constexpr auto kPowerOfFive = [] {
    std::array<uint64_t, kLargestPowerOfFive + 1> powers{1};
    for (size_t i = 1; i < powers.size(); ++i) powers[i] = 5 * powers[i - 1];
    return powers;
}();

/// mantissa / 10^power, correctly rounded; mantissa > 0, power in [0, kLargestPowerOfFive].
inline double divideByPowerOfTen(uint64_t mantissa, int power) {
    using Wide = unsigned __int128;
    const uint64_t divisor = kPowerOfFive[size_t(power)];
    const int up = std::countl_zero(mantissa), divisor_up = std::countl_zero(divisor);
    // With both top bits set and the numerator halved, the quotient has 63 or 64 bits: more than
    // ten below the last one of the result, of which the lowest tells whether anything is left.
    const Wide numerator = Wide(mantissa << up) << 63;
    const uint64_t normalised = divisor << divisor_up;
    const auto quotient = uint64_t(numerator / normalised);
    const bool rest = Wide(quotient) * normalised != numerator;
    const int exponent = divisor_up - up - 63 - power;
    // The conversion rounds once; the power of two is exact, as the result is far from the ends.
    return double(quotient | uint64_t(rest)) *
           std::bit_cast<double>(uint64_t(1023 + exponent) << 52);
}

/// The power of ten of the first digit that is not zero, in an unsigned number.
inline int64_t decimalExponent(const char* p, const char* end) {
    int64_t power = -1, first = 0;
    bool found = false, fraction = false;
    for (; p < end && (isDigit(*p) || *p == '.'); ++p) {
        if (*p == '.') {
            fraction = true;
            continue;
        }
        if (!fraction)
            ++power;
        else if (!found)
            --first;
        found = found || *p != '0';
        // Before the point, zeros in front do not count.
        if (!found && !fraction) --power;
    }
    int64_t exponent = 0;
    if (p < end && (*p == 'e' || *p == 'E')) {
        ++p;
        if (p < end && *p == '+') ++p;
        if (std::from_chars(p, end, exponent).ec == std::errc::result_out_of_range)
            exponent = *p == '-' ? -(int64_t(1) << 40) : int64_t(1) << 40;
    }
    return (power >= 0 ? power : first) + exponent;
}
}  // namespace detail

/// Parses a whole number at `p`; returns the character after it, or null if there is none or it
/// does not fit. [p, end) must be followed by a byte that is no digit.
inline const char* parseInteger(const char* p, int64_t& value) {
    const bool negative = *p == '-';
    if (*p == '-' || *p == '+') ++p;
    if (!isDigit(*p)) return nullptr;
    uint64_t magnitude = 0;
    const char* const first = p;
    for (; isDigit(*p); ++p) magnitude = magnitude * 10 + uint64_t(*p - '0');
    if (p - first > 18) {  // may have wrapped; leading zeros are rare enough to be refused with it
        return nullptr;
    }
    value = negative ? -int64_t(magnitude) : int64_t(magnitude);
    return p;
}

/// Parses a real number at `text` ("-1.5e-3", "nan", "inf" too); returns the character after it, or
/// null if there is none. `end` is where the text ends; the byte there must be no digit. Too large
/// or too small a number becomes infinite or zero.
inline const char* parseReal(const char* text, const char* end, double& value) {
    const char* const start = *text == '+' ? text + 1 : text;
    const char* p = start;
    const bool negative = *p == '-';
    if (negative && start != text) return nullptr;
    if (negative) ++p;
    const char* const digits = p;
    uint64_t mantissa = 0;
    for (; isDigit(*p); ++p) mantissa = mantissa * 10 + uint64_t(*p - '0');
    int64_t count = p - digits, exponent = 0;
    if (*p == '.') {
        const char* const fraction = ++p;
        p = detail::takeDigits(p, end, mantissa);
        exponent = -(p - fraction);
        count -= exponent;
    }
    if (count > 0 && count <= 19) {
        if (*p == 'e' || *p == 'E') {
            const char* q = p + 1;
            const bool down = *q == '-';
            if (*q == '-' || *q == '+') ++q;
            if (isDigit(*q)) {
                int64_t power = 0;
                for (; isDigit(*q); ++q)
                    if (power < 100000) power = power * 10 + (*q - '0');
                exponent += down ? -power : power;
                p = q;
            }
        }
        // Both the mantissa and the power of ten are exact, so one rounding gives the right result
        // (Clinger 1990).
        if (mantissa <= uint64_t(1) << 53 && exponent >= -detail::kLargestExactPower &&
            exponent <= detail::kLargestExactPower) {
            const double m = double(mantissa);
            const double magnitude = exponent < 0 ? m / detail::kExactPower[-exponent]
                                                  : m * detail::kExactPower[exponent];
            value = negative ? -magnitude : magnitude;
            return p;
        }
        if (mantissa > 0 && exponent <= 0 && exponent >= -detail::kLargestPowerOfFive) {
            const double magnitude = detail::divideByPowerOfTen(mantissa, int(-exponent));
            value = negative ? -magnitude : magnitude;
            return p;
        }
    }
    const auto [rest, fault] = std::from_chars(start, end, value);
    if (fault == std::errc::invalid_argument) return nullptr;
    if (fault == std::errc::result_out_of_range) {
        // from_chars leaves the value alone and does not say which way it went.
        const bool small = detail::decimalExponent(digits, rest) < 0;
        const double magnitude = small ? 0.0 : __builtin_huge_val();
        value = negative ? -magnitude : magnitude;
    }
    return rest;
}

}  // namespace pietra
