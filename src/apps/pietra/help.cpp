#include "apps/pietra/help.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <string_view>

namespace pietra {

namespace {

constexpr size_t kOptionColumn = 30;
constexpr size_t kTermColumn = 14;

/// Appends `text` in lines of at most `columns`, all but the first indented; `used`: columns
/// already filled on the first line.
void appendWrapped(std::string& out, std::string_view text, size_t used, size_t indent,
                   size_t columns) {
    size_t column = used;
    bool line_start = true;
    while (!text.empty()) {
        const size_t end = std::min(text.find(' '), text.size());
        const std::string_view word = text.substr(0, end);
        text.remove_prefix(std::min(end + 1, text.size()));
        if (!line_start && column + 1 + word.size() > columns) {
            out += '\n';
            out.append(indent, ' ');
            column = indent;
            line_start = true;
        }
        if (!line_start) out += ' ', ++column;
        out += word;
        column += word.size();
        line_start = false;
    }
    out += '\n';
}

void appendParagraph(std::string& out, std::string_view text, size_t indent, size_t columns) {
    out.append(indent, ' ');
    appendWrapped(out, text, indent, indent, columns);
}

/// A term in the left column and its explanation in the right one.
void appendEntry(std::string& out, std::string_view term, std::string_view text, size_t column,
                 size_t columns) {
    out += "  ";
    out += term;
    if (term.size() + 4 > column) {
        out += '\n';
        out.append(column, ' ');
    } else {
        out.append(column - term.size() - 2, ' ');
    }
    appendWrapped(out, text, column, column, columns);
}

std::string optionTerm(const Option& option) {
    if (option.positional) return option.names + (option.many ? "..." : "");
    std::string term = option.names;
    if (const size_t comma = term.find(','); comma != term.npos)
        term.insert(comma + 1, " ");
    else
        term.insert(0, "    ");
    if (!option.value.empty()) term += " " + option.value;
    if (option.many) term += "...";
    return term;
}

void appendOptions(std::string& out, const OptionSet& options, int columns) {
    for (const Option& option : options.options()) {
        std::string text = option.help;
        if (!option.standard.empty()) text += fmt::format(" (default: {})", option.standard);
        appendEntry(out, optionTerm(option), text, kOptionColumn, size_t(columns));
    }
}

void appendCommon(std::string& out, const OptionSet& common, int columns) {
    out += "\nOptions of every verb:\n";
    appendOptions(out, common, columns);
    appendEntry(out, "-h, --help", "Show this page.", kOptionColumn, size_t(columns));
    appendEntry(out, "    --version", "Show the version.", kOptionColumn, size_t(columns));
}

void appendExitCodes(std::string& out, int columns) {
    const std::pair<const char*, const char*> codes[] = {
        {"0", "done"},
        {"1", "a bug in Pietra"},
        {"2", "wrong use of the command line, or an output that exists without --force"},
        {"3", "bad input or a damaged model; the message names the file, the place and the fault"},
        {"4", "the system refused: no such file, no permission, disk full"},
        {"5", "the work does not fit the memory limit given"},
        {"6", "`check` or `compare` found a fault"},
        {"130", "interrupted"},
    };
    out += "\nExit status:\n";
    for (const auto& [code, text] : codes) appendEntry(out, code, text, 8, size_t(columns));
}

}  // namespace

std::string programHelp(const VerbTable& verbs, const OptionSet& common, int columns) {
    std::string out = "pietra - look at triangle meshes of any size, on any machine\n\n";
    appendParagraph(
        out,
        "Pietra turns a mesh into a multiresolution model, once, in bounded memory; the "
        "model is then drawn, measured and exported at exactly the detail asked for, "
        "without cracks and within a proven error.",
        0, size_t(columns));
    out += "\nUsage:\n  pietra VERB [arguments] [options]\n  pietra VERB --help\n\nVerbs:\n";
    for (const auto& verb : verbs) {
        const VerbText text = verb->text();
        appendEntry(out, text.name, text.summary, 12, size_t(columns));
    }
    appendCommon(out, common, columns);
    out += '\n';
    appendParagraph(out,
                    "Data goes to standard output, everything else to standard error. Sizes are "
                    "bytes and take k, M, G, T (binary); counts take k, M, G (decimal).",
                    0, size_t(columns));
    appendExitCodes(out, columns);
    return out;
}

std::string verbHelp(const VerbText& text, const OptionSet& options, const OptionSet& common,
                     int columns) {
    std::string out;
    appendParagraph(out, fmt::format("pietra {} - {}", text.name, text.summary), 0,
                    size_t(columns));
    out += "\nUsage:\n";
    const std::string program = "pietra " + text.name + " ";
    for (const std::string& usage : text.usage) {
        out += "  " + program;
        appendWrapped(out, usage, 2 + program.size(), 2 + program.size(), size_t(columns));
    }
    for (const std::string& paragraph : text.description) {
        out += '\n';
        appendParagraph(out, paragraph, 0, size_t(columns));
    }
    if (!text.terms.empty()) out += fmt::format("\n{}:\n", text.terms_title);
    for (const auto& [term, meaning] : text.terms)
        appendEntry(out, term, meaning, kTermColumn, size_t(columns));
    out += "\nArguments and options:\n";
    appendOptions(out, options, columns);
    appendCommon(out, common, columns);
    out += "\nExamples:\n";
    for (const auto& [purpose, command] : text.examples) {
        appendParagraph(out, "# " + purpose, 2, size_t(columns));
        out += "  " + command + "\n";
    }
    appendExitCodes(out, columns);
    return out;
}

int helpColumns() {
    winsize size{};
    if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
    return std::clamp<int>(size.ws_col, 60, 100);
}

}  // namespace pietra
