#include "io/notes.h"

#include <fmt/format.h>

#include <algorithm>

namespace pietra {

std::string printable(std::string_view word) {
    std::string text(word.substr(0, 40));
    for (char& c : text)
        if (c < 32 || c > 126) c = '?';
    return text + (word.size() > 40 ? "..." : "");
}

std::string listed(const std::vector<std::string>& words) {
    constexpr size_t kMost = 9;
    std::string list;
    const size_t shown = std::min(words.size(), kMost);
    for (size_t i = 0; i < shown; ++i)
        list += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + printable(words[i]);
    return shown == words.size() ? list
                                 : fmt::format("{} and {} others", list, words.size() - shown);
}

std::string leftOut(const char* kind, const std::vector<std::string>& names) {
    return names.size() == 1 ? fmt::format("{} {} is left out", kind, printable(names.front()))
                             : fmt::format("{}s {} are left out", kind, listed(names));
}

}  // namespace pietra
