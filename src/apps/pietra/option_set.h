#pragma once
// How a verb declares its options: a table that the parser (command_line.h) and the help page
// (help.h) read. It keeps CLI11, whose header takes seconds to compile, out of the verbs.
//
// Targets must outlive the set; each keeps its value unless the option is given, and that value is
// what the help page shows as the default. Later occurrences of an option win.

#include <concepts>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/pietra/values.h"

namespace pietra {

struct Option {
    std::string names;       ///< "-o,--output", or "IN" for a positional argument
    std::string value = {};  ///< how the help page calls the value: "SIZE"; empty: a flag
    std::string help = {};
    std::string standard = {};  ///< the default, as the help page shows it; empty: not shown
    bool positional = false;
    bool many = false;  ///< takes one value or more
    bool required = false;
    /// Takes the values given (of a flag, none); throws UsageError with what is wrong with them.
    std::function<void(const std::vector<std::string>&)> set = {};

    Option& require() {
        required = true;
        return *this;
    }
    Option& defaultsTo(std::string text) {
        standard = std::move(text);
        return *this;
    }
    /// The longest name, by which messages call it.
    std::string name() const;
};

class OptionSet {
public:
    const std::vector<Option>& options() const { return options_; }

    /// A positional argument of one or more file names, or of exactly one.
    Option& files(const char* value, std::vector<std::string>& target, const char* help);
    Option& file(const char* value, std::string& target, const char* help);

    Option& flag(const char* names, bool& target, const char* help);
    Option& text(const char* names, const char* value, std::string& target, const char* help);
    Option& texts(const char* names, const char* value, std::vector<std::string>& target,
                  const char* help);
    /// Anything else: `set` gets the value, and throws UsageError where it is wrong.
    Option& custom(const char* names, const char* value, const char* standard, const char* help,
                   std::function<void(const std::string&)> set);
    /// One of a few words.
    Option& choice(const char* names, std::string& target, const std::vector<std::string>& words,
                   const char* help);
    /// T: double or std::optional<double>; likewise below.
    template <class T>
    Option& number(const char* names, const char* value, T& target, const NumberRange& range,
                   const char* help) {
        return add(names, value, help, target,
                   [range](const std::string& text) { return parseNumber(text, range); });
    }
    template <class T>
    Option& count(const char* names, const char* value, T& target, const CountRange& range,
                  const char* help) {
        return add(names, value, help, target,
                   [range](const std::string& text) { return parseCount(text, range); });
    }
    template <class T>
    Option& size(const char* names, T& target, const char* help) {
        Option& option = add(names, "SIZE", help, target,
                             [](const std::string& text) { return parseSize(text); });
        if (const std::optional<uint64_t> bytes = target) option.standard = formatSize(*bytes);
        return option;
    }
    template <class T>
    Option& pictureSize(const char* names, T& target, const char* help) {
        return add(names, "WxH", help, target,
                   [](const std::string& text) { return parsePictureSize(text); });
    }

private:
    Option& push(Option option);

    template <class T, class Parse>
    Option& add(const char* names, const char* value, const char* help, T& target, Parse parse) {
        Option option{.names = names, .value = value, .help = help};
        option.standard = shown(target);
        option.set = [&target, parse](const std::vector<std::string>& values) {
            target = static_cast<T>(parse(values.back()));
        };
        return push(std::move(option));
    }

    static std::string shown(double value);
    static std::string shown(std::integral auto value) { return std::to_string(value); }
    static std::string shown(const PictureSize& size);
    template <class T>
    static std::string shown(const std::optional<T>& value) {
        return value ? shown(*value) : "";
    }

    std::vector<Option> options_;
};

}  // namespace pietra
