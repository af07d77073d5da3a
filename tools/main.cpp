// The `curvisplat` program: one subcommand a file, errors caught here and nowhere else.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/error.h"
#include "stream/progress.h"
#include "tools/commands.h"

namespace {

/// "convert, info, render and view"
std::string namesOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  const std::string last = names.back();
  names.pop_back();
  return fmt::format("{} and {}", fmt::join(names, ", "), last);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace curvisplat;
  CLI::App app("curvisplat shows curvilinear simulation grids that are larger than memory.", "curvisplat");
  app.set_version_flag("--version", "curvisplat " CURVISPLAT_VERSION);
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "Help of every subcommand");
  addConvert(app);
  addInfo(app);
  addRender(app);
  addView(app);
  addBench(app);
  addGenerate(app);
  addCompare(app);

  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty()) {
      fmt::print(stderr, "curvisplat: there is no subcommand '{}'; there are {}\n", argv[1], namesOf(app));
      return 2;
    }
    if (error.get_exit_code() == 0) return app.exit(error);  // help and versions come this way too
    const std::vector<CLI::App*> chosen = app.get_subcommands();
    const std::string command = "curvisplat" + (chosen.empty() ? "" : " " + chosen.front()->get_name());
    fmt::print(stderr, "{}: {}; see {} --help\n", command, error.what(), command);
    return 2;
  } catch (const UsageError& error) {
    fmt::print(stderr, "curvisplat: {}\n", error.what());
    return 2;
  } catch (const Interrupted& interrupted) {
    fmt::print(stderr, "curvisplat: {}\n", interrupted.what());
    return 128 + interrupted.signal();  // as a shell says of a process that the signal has ended
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "curvisplat: out of memory; give the machine more, or ask for less with --memory\n");
    return 1;
  } catch (const std::filesystem::filesystem_error& error) {
    fmt::print(stderr, "curvisplat: {}: {}\n", error.path1().string(), error.code().message());
    return 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "curvisplat: {}\n", error.what());
    return 1;
  }
}
