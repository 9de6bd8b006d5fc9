// Reals in text: the same bits as std::from_chars gives, for every form of a number.

#include "io/number_parser.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "base/hash.h"

namespace pietra {
namespace {

uint64_t bitsOf(double value) {
    return std::bit_cast<uint64_t>(value);
}

double expected(const std::string& text) {
    double value = 0;
    std::from_chars(text.data() + (text[0] == '+'), text.data() + text.size(), value);
    return value;
}

/// How many characters of `text` parseReal() takes, or -1, where other text stands around it.
ptrdiff_t parse(const std::string& text, double& value) {
    const std::string padded = std::string(16, '9') + text + '\0' + std::string(16, '7');
    const char* const begin = padded.data() + 16;
    const char* const end = parseReal(begin, begin + text.size(), value);
    return end ? end - begin : -1;
}

void expectExact(const std::string& text) {
    double value = 0;
    ASSERT_EQ(parse(text, value), ptrdiff_t(text.size())) << text;
    ASSERT_EQ(bitsOf(value), bitsOf(expected(text))) << text;
}

TEST(NumberParser, roundsAsFromChars) {
    uint64_t state = 1;
    const auto below = [&](uint64_t n) { return mixBits(++state) % n; };
    for (int i = 0; i < 200000; ++i) {
        std::string text = std::to_string(mixBits(++state));
        text.resize(std::min<size_t>(text.size(), 1 + below(20)));
        if (below(4) > 0) text.insert(below(text.size() + 1), ".");
        if (below(4) == 0) text.insert(0, std::string(below(6), '0'));
        if (below(3) == 0) text += "e" + std::to_string(int64_t(below(70)) - 35);
        if (below(2) == 0) text.insert(0, below(4) ? "-" : "+");
        expectExact(text);
    }
}

TEST(NumberParser, roundsTiesToEven) {
    // Just between two doubles, and a little to either side.
    for (const char* text : {"9007199254740993", "9007199254740993.0", "9007199254740992.999",
                             "9007199254740993.001", "4503599627370496.5", "4503599627370497.5",
                             "4503599627370497.499", "4503599627370497.501", "2251799813685248.25",
                             "2251799813685248.75", "1125899906842624.125", "0.5000000000000000555",
                             "1.00000000000000011102", "1.000000000000000111"})
        expectExact(text);
    uint64_t state = 5;
    for (int i = 0; i < 100000; ++i) {
        // A double of 53 bits and a half: 54 bits, as digits with an exact fraction.
        const uint64_t bits = (mixBits(++state) >> 10) | (uint64_t(1) << 53) | 1;
        const char* const fractions[] = {"", ".5", ".25", ".75"};
        expectExact(std::to_string(bits) + fractions[mixBits(state) % 2]);
        expectExact(std::to_string(bits >> 1) + ".5");
        expectExact(std::to_string(bits >> 2) + fractions[2 + i % 2]);
    }
}

TEST(NumberParser, takesWhatPrintfWrites) {
    uint64_t state = 9;
    char text[64];
    for (int i = 0; i < 30000; ++i) {
        const double scale = std::pow(10.0, double(i % 60) - 30);
        const double value = (double(mixBits(++state)) * 0x1p-63 - 1) * scale;
        for (const char* form : {"%.17g", "%.16g", "%.9g", "%.6f", "%.18e"}) {
            std::snprintf(text, sizeof text, form, value);
            expectExact(text);
        }
        double back = 0;
        std::snprintf(text, sizeof text, "%.17g", value);
        parse(text, back);
        ASSERT_EQ(bitsOf(back), bitsOf(value));
    }
}

TEST(NumberParser, takesTheEnds) {
    const double infinity = std::numeric_limits<double>::infinity();
    struct Case {
        const char* text;
        double value;
    };
    for (const Case& c : {Case{"0", 0},
                          {"-0", -0.0},
                          {"0.0e5", 0},
                          {".5", 0.5},
                          {"5.", 5},
                          {"+7", 7},
                          {"1e400", infinity},
                          {"-1e400", -infinity},
                          {"1e-400", 0},
                          {"-0.0000", -0.0},
                          {"inf", infinity}}) {
        double value = 1;
        EXPECT_EQ(parse(c.text, value), ptrdiff_t(std::strlen(c.text))) << c.text;
        EXPECT_EQ(bitsOf(value), bitsOf(c.value)) << c.text;
    }
    for (const char* text : {"", "-", ".", "-.", "--1", "e5", "+-1", "-+1", "/", "abc"}) {
        double value = 1;
        EXPECT_EQ(parse(text, value), -1) << text;
    }
}

TEST(NumberParser, endsWhereTheNumberEnds) {
    for (const std::string number : {"7", "-7", "0.25", "-.5", "5.", "123456.789e-3", "1e5",
                                     "123456789012345", "0.12345678901234567"})
        for (const std::string after :
             {" ", "\n", "/", ".", "-", "-1", "..5", "e", "e+", "ex", "x"}) {
            if (number.find_first_of(".e") == number.npos && after[0] == '.') continue;
            if (number.find('e') != number.npos && after[0] == 'e') continue;
            double value = 0;
            EXPECT_EQ(parse(number + after, value), ptrdiff_t(number.size())) << number << after;
            EXPECT_EQ(bitsOf(value), bitsOf(expected(number))) << number << after;
        }
}

}  // namespace
}  // namespace pietra
