#pragma once
// Numbers in text, fast. Reals are correctly rounded, as std::from_chars does it, which takes the
// rare hard ones; unlike it, a leading '+' is allowed. No locale.

#include <charconv>
#include <cstdint>

namespace pietra {

inline bool isDigit(char c) {
    return unsigned(c) - '0' < 10;
}

namespace detail {
/// Powers of ten that a double holds exactly.
inline constexpr double kExactPower[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                         1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                         1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
inline constexpr int kLargestExactPower = 22;

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

/// Parses a real number at `p` ("-1.5e-3", "nan", "inf" too); returns the character after it, or
/// null if there is none. `end` is where the text ends; the byte there must be no digit. Too large
/// or too small a number becomes infinite or zero.
inline const char* parseReal(const char* p, const char* end, double& value) {
    const char* const start = *p == '+' ? p + 1 : p;
    p = start;
    const bool negative = *p == '-';
    if (negative) ++p;
    const char* const digits = p;
    uint64_t mantissa = 0;
    for (; isDigit(*p); ++p) mantissa = mantissa * 10 + uint64_t(*p - '0');
    int64_t count = p - digits, exponent = 0;
    if (*p == '.') {
        const char* const fraction = ++p;
        for (; isDigit(*p); ++p) mantissa = mantissa * 10 + uint64_t(*p - '0');
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
