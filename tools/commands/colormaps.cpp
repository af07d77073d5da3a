// `curvisplat colormaps`: lists the built-in colour maps, and draws them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>

#include "render/annotate/colour_map_sheet.h"
#include "render/colour/published_maps.h"
#include "render/image/image_file.h"
#include "tools/commands/commands.h"
#include "tools/output/output_paths.h"

namespace curvisplat {
namespace {

struct ColormapsArguments {
  std::filesystem::path output;
  bool safe = false;
};

void list(bool only_safe) {
  const std::pair<MapCategory, const char*> categories[] = {
      {MapCategory::kSequential, "sequential, for values from low to high"},
      {MapCategory::kDiverging, "diverging, for values on both sides of a middle"},
      {MapCategory::kCyclic, "cyclic, for angles and phases"}};
  for (const auto& [category, title] : categories) {
    fmt::print("{}\n", title);
    for (const PublishedMap& map : builtInMaps())
      if (map.category == category && (map.colour_blind_safe || !only_safe))
        fmt::print("  {:<22}{:<12}{}\n", map.name, map.source,
                   map.colour_blind_safe ? "colour-blind safe" : "");
  }
}

void colormaps(const ColormapsArguments& arguments) {
  if (arguments.output.empty()) return list(arguments.safe);
  checkImageName(arguments.output);
  checkOutputFile("-o", arguments.output, {});
  const Image sheet = colourMapSheet();
  writeImage(sheet, arguments.output);
  fmt::print("{}: {} colour maps\n", arguments.output.string(), builtInMaps().size());
}

}  // namespace

void addColormaps(CLI::App& app) {
  auto arguments = std::make_shared<ColormapsArguments>();
  CLI::App* command = app.add_subcommand("colormaps", "List the built-in colour maps, or draw them");
  command->add_option("-o,--output", arguments->output,
                      "Draw all maps with their names into this picture: .png, .exr or .pfm");
  command->add_flag("--safe", arguments->safe, "List only maps that are safe for colour-blind readers");
  command->callback([arguments] { colormaps(*arguments); });
}

}  // namespace curvisplat
