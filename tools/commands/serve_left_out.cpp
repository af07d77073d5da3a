// `curvisplat serve` in a program that was built without the server.
#include <CLI/CLI.hpp>

#include "stream/base/error.h"
#include "tools/commands/commands.h"

namespace curvisplat {

void addServe(CLI::App& app) {
  CLI::App* command = app.add_subcommand("serve", "Show caches in a web browser (not in this program)");
  command->allow_extras();
  command->callback([] {
    throw UsageError("serve: this program was built without the server (CMake's option CURVISPLAT_SERVER)");
  });
}

}  // namespace curvisplat
