// `curvisplat view` in a program that was built without the window.
#include <CLI/CLI.hpp>

#include "stream/base/error.h"
#include "tools/commands/commands.h"

namespace curvisplat {

void addView(CLI::App& app) {
  CLI::App* command = app.add_subcommand("view", "Open a window on a cache (not in this program)");
  command->allow_extras();
  command->callback([] {
    throw UsageError(
        "view: this program was built without the window (CMake's option CURVISPLAT_WINDOW); "
        "use 'curvisplat render'");
  });
}

}  // namespace curvisplat
