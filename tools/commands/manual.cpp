// `curvisplat manual`: manual pages and completion for bash, for the build, which installs them. Hidden.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>

#include "stream/base/durable_file.h"
#include "tools/commands/commands.h"
#include "tools/options/bash_completion.h"
#include "tools/options/manual_page.h"
#include "tools/options/shown_options.h"

namespace curvisplat {

void addManual(CLI::App& app) {
  auto folder = std::make_shared<std::filesystem::path>();
  CLI::App* command = app.add_subcommand("manual", "Write manual pages and bash completion into a folder");
  command->group("");
  command->add_option("FOLDER", *folder, "An existing folder")->required()->check(CLI::ExistingDirectory);
  command->callback([folder, &app] {
    writeFileDurably(*folder / "curvisplat.1", programManual(app));
    for (const CLI::App* shown : shownCommands(app))
      writeFileDurably(*folder / ("curvisplat-" + shown->get_name() + ".1"), commandManual(app, *shown));
    writeFileDurably(*folder / "curvisplat.bash", bashCompletion(app));
  });
}

}  // namespace curvisplat
