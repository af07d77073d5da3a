// `curvisplat bench` in a program that was built without it.
#include <CLI/CLI.hpp>

#include "stream/base/error.h"
#include "tools/commands/commands.h"

namespace curvisplat {

void addBench(CLI::App& app) {
  CLI::App* command = app.add_subcommand("bench", "Measure this machine (not in this program)");
  command->allow_extras();
  command->callback([] {
    throw UsageError("bench: this program was built without it (CMake's option CURVISPLAT_THROUGHPUT)");
  });
}

}  // namespace curvisplat
