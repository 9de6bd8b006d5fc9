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
inline __m128i loadSixteen(const void* from) {
    return _mm_loadu_si128(static_cast<const __m128i*>(from));
}
/// Which of 16 bytes are at most `most`.
inline uint32_t areUpTo(char most, __m128i bytes) {
    const __m128i least = _mm_min_epu8(bytes, _mm_set1_epi8(most));
    return uint32_t(_mm_movemask_epi8(_mm_cmpeq_epi8(least, bytes)));
}
/// Ones in the last `count` of 16 bytes.
inline __m128i lastBytes(int count) {
    alignas(16) static constexpr auto kBytes = [] {
        std::array<uint8_t, 32> bytes{};
        for (size_t i = 16; i < 32; ++i) bytes[i] = 0xff;
        return bytes;
    }();
    return loadSixteen(kBytes.data() + count);
}

/// The number that 16 digits make; bytes from 0 to 9.
inline uint64_t joinSixteen(__m128i digits) {
    const auto weights = [](short first, short second) {
        return _mm_set1_epi32(int(uint32_t(second) << 16 | uint32_t(first)));
    };
    const __m128i zero = _mm_setzero_si128();
    const __m128i twos =
        _mm_packs_epi32(_mm_madd_epi16(_mm_unpacklo_epi8(digits, zero), weights(10, 1)),
                        _mm_madd_epi16(_mm_unpackhi_epi8(digits, zero), weights(10, 1)));
    const __m128i fours = _mm_madd_epi16(twos, weights(100, 1));
    const __m128i eights = _mm_madd_epi16(_mm_packs_epi32(fours, fours), weights(10000, 1));
    const auto both = uint64_t(_mm_cvtsi128_si64(eights));
    return uint32_t(both) * uint64_t(100000000) + (both >> 32);
}

/// Moves over the digits at `p` and appends them to `value`, modulo 2^64: up to 16 at once, as the
/// processor seldom guesses where the digits of a fraction end.
inline const char* takeDigits(const char* p, uint64_t& value) {
    constexpr auto kPower = [] {
        std::array<uint64_t, 17> powers{1};
        for (size_t i = 1; i < powers.size(); ++i) powers[i] = 10 * powers[i - 1];
        return powers;
    }();
    const __m128i zeros = _mm_set1_epi8('0');
    const int count = std::countr_one(areUpTo(9, _mm_xor_si128(loadSixteen(p), zeros)));
    p += count;
    const __m128i digits = _mm_xor_si128(loadSixteen(p - 16), zeros);
    value = value * kPower[size_t(count)] + joinSixteen(_mm_and_si128(lastBytes(count), digits));
    if (count == 16)
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

/// The number after the 'e' at `p` is added to `exponent`; returns the character after it, or `p`
/// where there is none.
inline const char* takeExponent(const char* p, int64_t& exponent) {
    const char* q = p + 1;
    const bool down = *q == '-';
    if (*q == '-' || *q == '+') ++q;
    if (!isDigit(*q)) return p;
    int64_t power = 0;
    for (; isDigit(*q); ++q)
        if (power < 100000) power = power * 10 + (*q - '0');
    exponent += down ? -power : power;
    return q;
}

inline bool hasExactPower(int64_t exponent) {
    return exponent >= -kLargestExactPower && exponent <= kLargestExactPower;
}
/// mantissa * 10^exponent, where hasExactPower(exponent) and the mantissa is at most 2^53: as both
/// are exact, one rounding gives the right result (Clinger 1990).
inline double exactReal(uint64_t mantissa, int64_t exponent, bool negative) {
    const auto m = double(int64_t(mantissa));
    const double magnitude = exponent <= 0 ? m / kExactPower[-exponent] : m * kExactPower[exponent];
    return std::bit_cast<double>(std::bit_cast<uint64_t>(magnitude) | uint64_t(negative) << 63);
}

/// Moves over a number of up to 15 characters at `p`, but not its exponent; null where there is
/// none or a longer one. Where the number ends is found first and by no branch: the next number
/// waits for that alone.
inline const char* takeShortDecimal(const char* p, uint64_t& mantissa, int64_t& exponent) {
    const __m128i head = loadSixteen(p), zeros = _mm_set1_epi8('0');
    // A number consists of what lies from '-' to '9', but for '/'.
    const int size = std::countr_one(areUpTo('9' - '-', _mm_sub_epi8(head, _mm_set1_epi8('-'))));
    const uint32_t here = (uint32_t(1) << size) - 1;
    const uint32_t digits = areUpTo(9, _mm_xor_si128(head, zeros));
    const bool negative = *p == '-';
    const uint32_t point = ~digits & here & ~uint32_t(negative);
    const int whole = std::countr_zero(point | 0x10000);
    const int count = size - negative - (point != 0);
    if (size == 16 || (point & (point - 1)) || (point && p[whole] != '.') || count == 0)
        return nullptr;
    // What stands before the point moves over it.
    const int fraction = point ? size - whole - 1 : 16;
    const __m128i tail = _mm_xor_si128(loadSixteen(p + size - 16), zeros);
    const __m128i stays = lastBytes(fraction);
    const __m128i joined =
        _mm_or_si128(_mm_and_si128(stays, tail), _mm_andnot_si128(stays, _mm_slli_si128(tail, 1)));
    mantissa = joinSixteen(_mm_and_si128(lastBytes(count), joined));
    exponent = point ? -fraction : 0;
    return p + size;
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

/// parseReal() for numbers of any length, in any form.
inline const char* parseAnyReal(const char* text, const char* end, double& value) {
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
        p = takeDigits(p, mantissa);
        exponent = -(p - fraction);
        count -= exponent;
    }
    if (count > 0 && count <= 19) {
        if (*p == 'e' || *p == 'E') p = takeExponent(p, exponent);
        if (mantissa <= uint64_t(1) << 53 && hasExactPower(exponent)) {
            value = exactReal(mantissa, exponent, negative);
            return p;
        }
        if (mantissa > 0 && exponent <= 0 && exponent >= -kLargestPowerOfFive) {
            const double magnitude = divideByPowerOfTen(mantissa, int(-exponent));
            value = negative ? -magnitude : magnitude;
            return p;
        }
    }
    const auto [rest, fault] = std::from_chars(start, end, value);
    if (fault == std::errc::invalid_argument) return nullptr;
    if (fault == std::errc::result_out_of_range) {
        // from_chars leaves the value alone and does not say which way it went.
        const bool small = decimalExponent(digits, rest) < 0;
        const double magnitude = small ? 0.0 : __builtin_huge_val();
        value = negative ? -magnitude : magnitude;
    }
    return rest;
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
/// null if there is none. `end` is where the text ends; the byte there must be no digit. 16 bytes
/// before the number and after `end` are read too. Too large or too small a number becomes infinite
/// or zero.
inline const char* parseReal(const char* text, const char* end, double& value) {
    uint64_t mantissa;
    int64_t exponent;
    const char* p = detail::takeShortDecimal(text, mantissa, exponent);
    if (p && (*p | 0x20) == 'e') p = detail::takeExponent(p, exponent);
    if (p && detail::hasExactPower(exponent)) [[likely]] {
        value = detail::exactReal(mantissa, exponent, *text == '-');
        return p;
    }
    return detail::parseAnyReal(text, end, value);
}

}  // namespace pietra
