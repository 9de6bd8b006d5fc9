#pragma once
// CHECK(condition): a violated invariant is a bug in Pietra. Throws BugError (exit code 1) with the
// condition, the operands where the binary forms are used, and the place. Always on; hot loops use
// DCHECK, which is on in debug and sanitizer builds only.

#include <fmt/format.h>

#include <stdexcept>
#include <string>

namespace pietra {

class BugError : public std::logic_error {
public:
    using std::logic_error::logic_error;
};

[[noreturn]] void failCheck(const char* file, int line, const std::string& what);

}  // namespace pietra

#define CHECK(condition)                                                      \
    do {                                                                      \
        if (!(condition)) [[unlikely]]                                        \
            ::pietra::failCheck(__FILE__, __LINE__, "CHECK(" #condition ")"); \
    } while (false)

#define PIETRA_CHECK_OP(a, op, b)                                                            \
    do {                                                                                     \
        const auto& check_a_ = (a);                                                          \
        const auto& check_b_ = (b);                                                          \
        if (!(check_a_ op check_b_)) [[unlikely]]                                            \
            ::pietra::failCheck(                                                             \
                __FILE__, __LINE__,                                                          \
                fmt::format("CHECK(" #a " " #op " " #b "): {} and {}", check_a_, check_b_)); \
    } while (false)

#define CHECK_EQ(a, b) PIETRA_CHECK_OP(a, ==, b)
#define CHECK_NE(a, b) PIETRA_CHECK_OP(a, !=, b)
#define CHECK_LT(a, b) PIETRA_CHECK_OP(a, <, b)
#define CHECK_LE(a, b) PIETRA_CHECK_OP(a, <=, b)

#ifdef NDEBUG
#define DCHECK(condition) \
    do {                  \
    } while (false && (condition))
#else
#define DCHECK(condition) CHECK(condition)
#endif
