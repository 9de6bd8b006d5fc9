#include "apps/pietra/option_set.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/error.h"

namespace pietra {

std::string Option::name() const {
    return names.substr(names.rfind(',') + 1);
}

Option& OptionSet::push(Option option) {
    options_.push_back(std::move(option));
    return options_.back();
}

std::string OptionSet::shown(double value) {
    return fmt::format("{}", value);
}

std::string OptionSet::shown(const PictureSize& size) {
    return fmt::format("{}x{}", size.width, size.height);
}

Option& OptionSet::files(const char* value, std::vector<std::string>& target, const char* help) {
    Option& option = texts(value, value, target, help);
    option.positional = true;
    return option;
}

Option& OptionSet::file(const char* value, std::string& target, const char* help) {
    Option& option = text(value, value, target, help);
    option.positional = true;
    return option;
}

Option& OptionSet::flag(const char* names, bool& target, const char* help) {
    return push({.names = names, .help = help, .set = [&target](const auto&) { target = true; }});
}

Option& OptionSet::text(const char* names, const char* value, std::string& target,
                        const char* help) {
    return push({.names = names,
                 .value = value,
                 .help = help,
                 .standard = target,
                 .set = [&target](const auto& values) { target = values.back(); }});
}

Option& OptionSet::texts(const char* names, const char* value, std::vector<std::string>& target,
                         const char* help) {
    return push({.names = names,
                 .value = value,
                 .help = help,
                 .many = true,
                 .set = [&target](const auto& values) { target = values; }});
}

Option& OptionSet::custom(const char* names, const char* value, const char* standard,
                          const char* help, std::function<void(const std::string&)> set) {
    return push({.names = names,
                 .value = value,
                 .help = help,
                 .standard = standard,
                 .set = [set](const auto& values) { set(values.back()); }});
}

Option& OptionSet::choice(const char* names, std::string& target,
                          const std::vector<std::string>& words, const char* help) {
    Option& option = text(names, "", target, help);
    option.value = fmt::format("{}", fmt::join(words, "|"));
    option.set = [&target, words](const std::vector<std::string>& values) {
        if (std::find(words.begin(), words.end(), values.back()) == words.end())
            throw UsageError(
                fmt::format("'{}' is none of {}", values.back(), fmt::join(words, ", ")));
        target = values.back();
    };
    return option;
}

}  // namespace pietra
