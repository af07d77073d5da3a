// The `curvisplat` program: prepares the process, parses the command line, runs one subcommand, and turns
// exceptions into messages and exit statuses. No other file of the program catches errors to end it.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <new>
#include <regex>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "tools/commands/commands.h"
#include "tools/commands/manual.h"
#include "tools/early_start.h"
#include "tools/output/command_run.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

/// Opens /dev/null in place of each standard stream that is closed, so that no file the program opens gets
/// number 0, 1 or 2. Reading from or printing to such a stream fails. Call before opening anything else.
void openStandardStreams() {
  // open() returns the lowest free number. Standard output is opened read-only, so that printing to it fails
  // and is reported.
  for (int number = 0; number <= 2; ++number)
    if (::fcntl(number, F_GETFD) < 0) ::open("/dev/null", number == 2 ? O_WRONLY : O_RDONLY);
}

/// Flushes standard output. Prints a message and returns false if anything printed could not be written.
bool finishStandardOutput() {
  // An earlier failed write has set the error flag, but its errno is lost.
  const bool failed = std::ferror(stdout) != 0;
  if (std::fflush(stdout) == 0 && !failed) return true;
  printMessage("cannot write to standard output{}{}", failed ? "" : ": ", failed ? "" : std::strerror(errno));
  return false;
}

void writeToStderr(std::string_view text) {
  // Nothing that allocates, and nothing of the C++ library, which may not be ready yet.
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
}

/// Ends the program after an exception that nobody can catch: a library threw it before main(), or in a
/// thread of its own. If the machine has no threads left (ulimit -u, ulimit -v), the program ends with one line
/// and exit status 1, wherever that shows: libraries start threads before main() and in places where no
/// exception may leave.
[[noreturn]] void onTerminate() {
  try {
    if (std::current_exception()) throw;
  } catch (const std::bad_alloc&) {
    writeToStderr("curvisplat: out of memory; ask for less, or use a machine with more memory\n");
    ::_exit(1);
  } catch (const std::exception& error) {
    // TBB throws a runtime_error with this text.
    if (std::strstr(error.what(), std::strerror(EAGAIN))) {
      writeToStderr(
          "curvisplat: cannot start a thread; raise the limits of processes and memory (ulimit -u, ulimit "
          "-v)\n");
      ::_exit(1);
    }
    writeToStderr("curvisplat: internal error: ");
    writeToStderr(error.what());
    writeToStderr("\n");
  } catch (...) {
  }
  std::abort();
}

}  // namespace

void beforeLibraries() {
  std::set_terminate(onTerminate);
}

namespace {

std::string commandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : shownCommands(app)) names.push_back(command->get_name());
  return fmt::format("{}", fmt::join(names, ", "));
}

/// The names of our options in other programs.
constexpr std::pair<const char*, const char*> kForeignOptions[] = {
    {"--colormap", "--tf"},     {"--colourmap", "--tf"},        {"--cmap", "--tf"},
    {"--palette", "--tf"},      {"--time-step", "--step"},      {"--timestep", "--step"},
    {"--resolution", "--size"}, {"--width", "--size"},          {"--height", "--size"},
    {"--variable", "--scalar"}, {"--field", "--scalar"},        {"--array", "--scalar"},
    {"--isosurface", "--iso"},  {"--contour", "--iso"},         {"--bg", "--background"},
    {"--fps", "--frame-rate"},  {"--zoom", "--parallel-scale"}, {"--camera", "--position"},
    {"--clip", "--clip-plane"}, {"--lighting", "--shade"},      {"--out", "--output"},
    {"--force", "--overwrite"}, {"--jobs", "--threads"},        {"--up", "--view-up"}};

std::string unknownOption(const CLI::App& command, const std::string& name) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& known : option->get_lnames()) names.push_back("--" + known);
  for (const auto& [foreign, ours] : kForeignOptions)
    if (name == foreign && std::find(names.begin(), names.end(), ours) != names.end())
      return fmt::format("unknown option {} (did you mean {}?)", name, ours);
  if (command.get_name() == "view" && (name == "--scale" || name == "--font-size"))
    return fmt::format("unknown option {}: Ctrl and + make the window's texts larger, which is kept", name);
  return fmt::format("unknown option {}{}", name, didYouMean(name, names));
}

/// The first word that is left over, with the option that it may stand for.
std::string leftOver(const CLI::App& app, const CLI::App* command) {
  for (const std::string& word : app.remaining(true)) {
    if (word == "--") continue;
    if (!word.starts_with('-')) return fmt::format("unexpected argument '{}'", word);
    return unknownOption(command ? *command : app, word.substr(0, word.find('=')));
  }
  return "unexpected argument";
}

/// Describes what is wrong with the command line: CLI11's texts, without those that leave out the reason.
std::string describe(const CLI::App& app, const CLI::App* command, const CLI::ParseError& error) {
  const std::string text = error.what();
  std::smatch found;
  if (dynamic_cast<const CLI::ExtrasError*>(&error)) return leftOver(app, command);
  if (error.get_name() == "RequiredError" && command) {
    // An unknown option is the likelier mistake.
    for (const std::string& argument : command->remaining())
      if (argument.size() > 1 && argument[0] == '-') return leftOver(app, command);
  }
  if (std::regex_match(text, found, std::regex("(\\S+): 1 required \\S+ missing")))
    return found[1].str() + " needs a value";
  if (std::regex_match(text, found, std::regex("Could not convert: (\\S+) = (.*)")) && command) {
    const CLI::Option* const option = command->get_option_no_throw(found[1]);
    const bool is_whole = option && option->get_type_name().starts_with("UINT");
    return fmt::format("{} '{}': is not a {}, or is too large", found[1].str(), found[2].str(),
                       is_whole ? "whole number from 0 on" : "number");
  }
  if (std::regex_match(text, found, std::regex("(\\S+): Failed parsing (.*) as a .*")))
    return fmt::format("{} '{}': expected a number", found[1].str(), found[2].str());
  if (std::regex_match(text, found, std::regex("(\\S+): (.*) not in \\{(.*)\\}"))) {
    std::vector<std::string> choices;
    std::istringstream list(found[3].str());
    for (std::string choice; std::getline(list, choice, ',');) choices.push_back(choice);
    return fmt::format("{} '{}': expected one of {}{}", found[1].str(), found[2].str(),
                       fmt::join(choices, ", "), didYouMean(found[2].str(), choices));
  }
  if (std::regex_match(text, found, std::regex("(\\S+): At least (\\d+) required but received (\\d+)")))
    return fmt::format("{} needs {} values, found {}", found[1].str(), found[2].str(), found[3].str());
  if (std::regex_match(text, found, std::regex("(\\S+): At Most (\\d+) required but received (\\d+)")))
    return fmt::format("{} takes {}, found {}", found[1].str(),
                       found[2] == "1" ? "one value" : found[2].str() + " values", found[3].str());
  if (std::regex_match(text, found,
                       std::regex("(\\S+): Value (.*) not in range \\[?(\\S+) (?:to|-) ([^\\]]+)\\]?")))
    return fmt::format("{} '{}': expected a number from {} to {}", found[1].str(), found[2].str(),
                       found[3].str(), found[4].str());
  return text;
}

/// CLI11 takes --shade=2 for --shade. A flag that has a value by itself, as --sphere=6371 has one, keeps it.
void refuseValuesOfFlags(CLI::App& app) {
  for (CLI::Option* option : app.get_options([](const CLI::Option* each) {
         return each->get_expected_max() == 0 && each->get_fnames().empty();
       }))
    option->check([](const std::string& value) {
      const bool is_switch = value == "true" || value == "false";
      return is_switch ? std::string() : fmt::format("takes no value (found '{}')", value);
    });
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) refuseValuesOfFlags(*command);
}

/// CLI11 takes --orbit --size 9x9 for an orbit by "--size", and 9x9 for a file.
void refuseOptionsAsValues(CLI::App& app) {
  for (CLI::Option* option :
       app.get_options([](const CLI::Option* each) { return each->get_expected_max() > 0; }))
    option->check([&app](const std::string& value) {
      const bool is_option = value.starts_with("--") && app.get_option_no_throw(value);
      return is_option ? fmt::format("needs a value (found the option {})", value) : std::string();
    });
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; }))
    refuseOptionsAsValues(*command);
}

/// CLI11 takes the next word where nothing follows "=", and an option before an empty word for one that was not given.
void refuseEmptyValues(std::span<const char* const> words) {
  std::string_view before;
  for (const std::string_view word : words) {
    if (word.empty() && before == "--scalar-bar-title") continue;  // a bar without a title
    if (word.empty())
      throw UsageError("found an empty word{}, as of a variable of the shell that is not set",
                       before.starts_with('-') ? fmt::format(" behind {}", before) : "");
    if (word == "--") return;
    if (word.starts_with("--") && word.find('=') + 1 == word.size())
      throw UsageError("{}: needs a value (found nothing behind '=')", word.substr(0, word.size() - 1));
    before = word;
  }
}

/// Reports a failure, as one rank for all where there are several.
int fail(const std::string& line, int status) {
  endRanksAfter(line, status);
  printMessage(line);
  return status;
}

/// Names the options of the command that lower its memory.
std::string outOfMemory(const CLI::App& app) {
  std::string options;
  for (const CLI::App* const command : app.get_subcommands())
    for (const char* const name : {"--memory", "--size"})
      if (command->get_option_no_throw(name))
        options += (options.empty() ? "lower " : " or ") + std::string(name);
  return fmt::format("out of memory; {}, or use a machine with more memory",
                     options.empty() ? "ask for less" : options);
}

/// Returns the exit status: 0 success, 1 failure, 2 wrong usage, 128 + n stopped by signal n.
int run(int argc, char** argv) {
  CLI::App app("Render curvilinear simulation grids that are larger than memory.", "curvisplat");
  app.set_version_flag("--version", "curvisplat " CURVISPLAT_VERSION);
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "Print the help of every subcommand and exit");
  addConvert(app);
  addInfo(app);
  addRender(app);
  addView(app);
  addServe(app);
  addBench(app);
  addGenerate(app);
  addCompare(app);
  addColormaps(app);
  addExport(app);
  addManual(app);
  refuseValuesOfFlags(app);
  refuseOptionsAsValues(app);

  try {
    refuseEmptyValues({argv, static_cast<size_t>(argc)});
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty()) {
      std::vector<std::string> names;
      for (const CLI::App* shown : shownCommands(app)) names.push_back(shown->get_name());
      printMessage("unknown subcommand '{}'{}; expected one of {}", argv[1], didYouMean(argv[1], names),
                   commandNames(app));
      return 2;
    }
    if (argc > 1 && argv[1][0] == '-' && app.get_subcommands().empty() && error.get_exit_code() != 0) {
      printMessage("{}; see curvisplat --help", unknownOption(app, argv[1]));
      return 2;
    }
    if (error.get_exit_code() == 0) return app.exit(error);  // --help and --version
    const std::vector<CLI::App*> chosen = app.get_subcommands();
    const std::string command = "curvisplat" + (chosen.empty() ? "" : " " + chosen.front()->get_name());
    printMessage("{}; see {} --help", describe(app, chosen.empty() ? nullptr : chosen.front(), error),
                 command);
    return 2;
  } catch (const UsageError& error) {
    return fail(error.what(), 2);
  } catch (const Interrupted& interrupted) {
    return fail(interrupted.what(), 128 + interrupted.signal());  // as a shell reports for a signal
  } catch (const std::bad_alloc&) {
    return fail(outOfMemory(app), 1);
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(textOf(error), 1);
  } catch (const std::exception& error) {
    if (isForLackOfThreads(error)) return fail(kNoThread, 1);
    // Otherwise main() reports that standard output has failed.
    return std::ferror(stdout) == 0 ? fail(error.what(), 1) : 1;
  }
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  curvisplat::endLoadingOfLibraries();
  curvisplat::openStandardStreams();
  curvisplat::ignoreFileSizeSignal();
  const int status = curvisplat::run(argc, argv);
  if (status == 0) curvisplat::finishRanks();
  const bool printed = curvisplat::finishStandardOutput();
  return status == 0 && !printed ? 1 : status;
}
