#include "apps/pietra/command_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <numeric>

#include "apps/pietra/help.h"
#include "base/error.h"

namespace pietra {

namespace {

struct BoundOption {
    const Option* option;
    CLI::Option* parsed;
};

/// A verb (or the program itself) with its options, as declared and as known to CLI11.
struct BoundApp {
    CLI::App* app = nullptr;
    Verb* verb = nullptr;
    OptionSet options;
    std::vector<BoundOption> bound;
};

void bind(BoundApp& target) {
    for (const Option& option : target.options.options()) {
        CLI::Option* parsed;
        if (option.value.empty()) {
            parsed = target.app->add_flag(option.names);
        } else {
            parsed = target.app->add_option(option.names);
            parsed->type_name(option.value)
                ->multi_option_policy(option.many ? CLI::MultiOptionPolicy::TakeAll
                                                  : CLI::MultiOptionPolicy::TakeLast);
            if (option.many) parsed->expected(-1);
            // CLI11 leaves values to positionals that come later only where these are required.
            if (option.positional) parsed->required(option.required);
        }
        target.bound.push_back({&option, parsed});
    }
}

void declareCommon(OptionSet& options, CommonOptions& common) {
    options.flag("--force", common.force, "Overwrite outputs that exist.");
    options.text("--report", "FILE", common.report,
                 "Write a report of the run as JSON; - is standard output.");
    options.choice("--progress", common.progress, {"auto", "bar", "plain", "json", "none"},
                   "How to show progress on standard error: a bar, a line every ten seconds, or a "
                   "line of JSON a second. auto is bar on a terminal, else plain.");
    options.flag("-q,--quiet", common.quiet, "Show errors only.");
    options.choice("--log-level", common.log_level, {"debug", "info", "warn", "error"},
                   "The least of the messages shown.");
    options.text("--log-file", "FILE", common.log_file,
                 "Append messages to a file too, with the time of each.");
    options.text("--config", "FILE", common.config,
                 "Take options from a file of lines `key = value`, those of a verb below a line "
                 "`[verb]`. The command line overrides it.");
}

size_t editDistance(std::string_view a, std::string_view b) {
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t(0));
    for (size_t i = 0; i < a.size(); ++i) {
        size_t diagonal = std::exchange(row[0], i + 1);
        for (size_t j = 0; j < b.size(); ++j) {
            const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
        }
    }
    return row.back();
}

/// "; did you mean X?" where a known word is near, else nothing.
std::string suggestion(std::string_view word, const std::vector<std::string>& known) {
    const std::string* best = nullptr;
    size_t best_distance = 3;
    for (const std::string& candidate : known) {
        const size_t distance = editDistance(word, candidate);
        if (distance < best_distance && 2 * distance < candidate.size()) {
            best_distance = distance;
            best = &candidate;
        }
    }
    return best ? fmt::format("; did you mean {}?", *best) : "";
}

class Parser {
public:
    Parser(const VerbTable& verbs, CommonOptions& common);
    Command parse(const std::vector<std::string>& arguments);

private:
    const BoundApp* chosen() const;
    std::string helpPage() const;
    void refuseExtras(const std::vector<std::string>& arguments) const;
    void refuseMissing() const;
    void assign(const BoundApp& target) const;
    [[noreturn]] void explain(const CLI::ParseError& fault) const;
    [[noreturn]] void refuse(const std::string& what) const;

    const VerbTable& verbs_;
    CLI::App app_;
    CLI::Option* version_;
    BoundApp program_;
    std::vector<BoundApp> bound_;
};

Parser::Parser(const VerbTable& verbs, CommonOptions& common) : verbs_(verbs) {
    app_.name("pietra");
    app_.require_subcommand(0, 1);
    app_.allow_extras();
    app_.set_help_flag("-h,--help");
    version_ = app_.add_flag("--version");
    program_.app = &app_;
    declareCommon(program_.options, common);
    bind(program_);
    // CLI11 reads the file itself; the option declared above only shows it on the help page.
    CLI::Option* config = app_.get_option("--config");
    std::erase_if(program_.bound, [&](const BoundOption& b) { return b.parsed == config; });
    app_.remove_option(config);
    app_.set_config("--config");
    app_.allow_config_extras(CLI::config_extras_mode::error);

    bound_.reserve(verbs.size());
    for (const auto& verb : verbs) {
        BoundApp& target = bound_.emplace_back();
        target.verb = verb.get();
        target.app = app_.add_subcommand(verb->text().name);
        target.app->fallthrough()->allow_extras();
        target.app->set_help_flag("-h,--help");
        verb->declare(target.options);
        bind(target);
    }
}

const BoundApp* Parser::chosen() const {
    for (const BoundApp& target : bound_)
        if (target.app->parsed()) return &target;
    return nullptr;
}

void Parser::refuse(const std::string& what) const {
    const BoundApp* target = chosen();
    if (!target) throw UsageError(fmt::format("{} (see pietra --help)", what));
    const std::string name = target->app->get_name();
    throw UsageError(fmt::format("{}: {} (see pietra {} --help)", name, what, name));
}

std::string Parser::helpPage() const {
    const int columns = helpColumns();
    const BoundApp* target = chosen();
    return target ? verbHelp(target->verb->text(), target->options, program_.options, columns)
                  : programHelp(verbs_, program_.options, columns);
}

void Parser::refuseExtras(const std::vector<std::string>& arguments) const {
    std::vector<std::string> extras = app_.remaining(true);
    std::erase(extras, "--");
    if (extras.empty()) return;
    const BoundApp* target = chosen();
    // note: CLI11 lists what the program did not take before what the verb did not take.
    const auto first =
        std::find_first_of(arguments.begin(), arguments.end(), extras.begin(), extras.end());
    const std::string& extra = first == arguments.end() ? extras.front() : *first;
    std::vector<std::string> known{"--help", "--version"};
    if (extra.size() > 1 && extra[0] == '-') {
        for (const BoundApp* app : {&program_, target})
            if (app)
                for (const Option& option : app->options.options())
                    if (!option.positional) known.push_back(option.name());
        refuse(fmt::format("unknown option '{}'{}", extra, suggestion(extra, known)));
    }
    if (target) refuse(fmt::format("unexpected argument '{}'", extra));
    for (const BoundApp& app : bound_) known.push_back(app.app->get_name());
    refuse(fmt::format("unknown verb '{}'{}", extra, suggestion(extra, known)));
}

void Parser::refuseMissing() const {
    const BoundApp* target = chosen();
    if (!target) refuse("no verb given");
    for (const BoundOption& b : target->bound) {
        if (!b.option->required || b.parsed->count() > 0) continue;
        refuse(b.option->positional
                   ? fmt::format("{} is missing", b.option->names)
                   : fmt::format("option {} {} is missing", b.option->name(), b.option->value));
    }
}

void Parser::assign(const BoundApp& target) const {
    for (const BoundOption& b : target.bound) {
        if (b.parsed->count() == 0) continue;
        if (b.option->value.empty()) {
            if (b.parsed->as<bool>()) b.option->set({});
            continue;
        }
        try {
            b.option->set(b.parsed->reduced_results());
        } catch (const UsageError& fault) {
            refuse(fmt::format("{}: {}", b.option->name(), fault.what()));
        }
    }
}

/// CLI11's own faults, in our words.
void Parser::explain(const CLI::ParseError& fault) const {
    const std::string what = fault.what();
    if (dynamic_cast<const CLI::FileError*>(&fault)) {
        const std::string path = app_.get_config_ptr()->as<std::string>();
        throw IoError(path, "open", access(path.c_str(), R_OK) == 0 ? EISDIR : errno);
    }
    if (dynamic_cast<const CLI::ConfigError*>(&fault)) {
        const std::string path = app_.get_config_ptr()->as<std::string>();
        refuse(fmt::format("{}: unknown key '{}'", path, what.substr(what.rfind(' ') + 1)));
    }
    if (dynamic_cast<const CLI::ArgumentMismatch*>(&fault))
        refuse(fmt::format("option {} needs a value", what.substr(0, what.find(':'))));
    refuse(what);
}

Command Parser::parse(const std::vector<std::string>& arguments) {
    try {
        app_.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
    } catch (const CLI::CallForHelp&) {
        return {nullptr, helpPage()};
    } catch (const CLI::RequiredError&) {
        refuseExtras(arguments);
        refuseMissing();
        throw;
    } catch (const CLI::ParseError& fault) {
        explain(fault);
    }
    if (version_->count() > 0) return {nullptr, fmt::format("pietra {}\n", PIETRA_VERSION)};
    refuseExtras(arguments);
    refuseMissing();
    assign(program_);
    assign(*chosen());
    return {chosen()->verb, ""};
}

}  // namespace

Command parseCommandLine(const std::vector<std::string>& arguments, const VerbTable& verbs,
                         CommonOptions& common) {
    // `pietra help build` is what newcomers type first.
    if (!arguments.empty() && arguments[0] == "help") {
        std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
        rest.push_back("--help");
        return parseCommandLine(rest, verbs, common);
    }
    return Parser(verbs, common).parse(arguments);
}

}  // namespace pietra
