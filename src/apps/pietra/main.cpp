// The program: parse, run the verb, turn what went wrong into a sentence and an exit code.

#include <fmt/format.h>

#include <csignal>
#include <new>

#include "apps/pietra/command_line.h"
#include "apps/pietra/json_report.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/progress_display.h"
#include "base/check.h"
#include "base/error.h"

namespace pietra {
namespace {

/// The first signal asks the work to stop; a second one of the same kind ends the process at once.
void cancelOnSignals() {
    struct sigaction action {};
    action.sa_handler = [](int) { Progress::requestCancel(); };
    action.sa_flags = int(SA_RESETHAND | SA_RESTART);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
}

int runCommand(const std::vector<std::string>& arguments) {
    const VerbTable verbs = makeVerbs();
    CommonOptions common;
    const Command command = parseCommandLine(arguments, verbs, common);
    if (!command.verb) {
        printOut(command.print);
        return 0;
    }
    setUpLogging(common.log_level, common.quiet, common.log_file);
    checkOutput(common.report, common.force);
    ProgressDisplay display(progressMode(common.progress, common.quiet, errorLine()), errorLine());
    Progress progress(&display);
    return command.verb->run({common, progress});
}

int reportBug(const char* what) {
    logError(fmt::format("this is a bug in Pietra, please report it: {}", what));
    return 1;
}

int guardedRun(const std::vector<std::string>& arguments) {
    try {
        return runCommand(arguments);
    } catch (const Error& error) {
        logError(error.what());
        return error.exitCode();
    } catch (const std::bad_alloc&) {
        logError("out of memory: the system gave no more; a smaller --memory or --jobs may help");
        return 5;
    } catch (const std::exception& error) {
        return reportBug(error.what());
    } catch (...) {
        return reportBug("unknown exception");
    }
}

}  // namespace
}  // namespace pietra

int main(int argc, char** argv) {
    pietra::cancelOnSignals();
    return pietra::guardedRun(std::vector<std::string>(argv + (argc > 0 ? 1 : 0), argv + argc));
}
