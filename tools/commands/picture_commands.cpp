// Subcommands of a few lines that need no cache: `compare` measures the difference of two pictures, and
// `colormaps` lists or draws the built-in colour maps.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "render/annotate/annotations.h"
#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "tools/commands/commands.h"
#include "tools/output/start_checks.h"

namespace curvisplat {
namespace {

struct CompareOptions {
  std::string a, b;
  std::optional<double> min_psnr_db;
  std::string difference;
};

/// |a - b| over white, opaque, scaled so that the largest difference has full brightness.
Image differenceImage(const Image& a, const Image& b, double largest) {
  Image difference(a.size);
  const float gain = largest > 0 ? static_cast<float>(1 / largest) : 0;
  for (size_t n = 0; n < a.rgba.size(); n += 4) {
    for (size_t c = 0; c < 3; ++c)
      difference.rgba[n + c] =
          gain * std::abs(a.rgba[n + c] - a.rgba[n + 3] - (b.rgba[n + c] - b.rgba[n + 3]));
    difference.rgba[n + 3] = 1;
  }
  return difference;
}

ImageDifference compareNamed(const Image& a, const Image& b, const CompareOptions& options) {
  try {
    return compareImages(a, b);
  } catch (const Error& error) {
    throw Error("{} and {}: {}", options.a, options.b, error.what());
  }
}

void compare(const CompareOptions& options) {
  if (!options.difference.empty()) {
    checkImageName(options.difference);
    checkOutputFile("--difference", options.difference, {options.a, options.b});
  }
  const Image a = readImage(options.a), b = readImage(options.b);
  const ImageDifference difference = compareNamed(a, b, options);
  if (difference.largest == 0)
    fmt::print("identical\n");
  else
    fmt::print("PSNR {:.2f} dB, largest difference {:.6f} at pixel ({}, {})\n", difference.psnr_db,
               difference.largest, difference.largest_x, difference.largest_y);
  if (!options.difference.empty()) writeImage(differenceImage(a, b, difference.largest), options.difference);
  if (options.min_psnr_db && difference.psnr_db < *options.min_psnr_db)
    throw Error(
        "{} and {}: PSNR {:.2f} dB is below --min-psnr {:.2f} dB; largest difference {:.6f} at pixel "
        "({}, {})",
        options.a, options.b, difference.psnr_db, *options.min_psnr_db, difference.largest,
        difference.largest_x, difference.largest_y);
}

}  // namespace

void addCompare(CLI::App& app) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command =
      app.add_subcommand("compare", "Print the PSNR and the largest difference of two pictures");
  command->add_option("A", options->a, "Picture: PNG, EXR or PFM")->required();
  command->add_option("B", options->b, "Picture of the same size: PNG, EXR or PFM")->required();
  command->add_option("--min-psnr", options->min_psnr_db,
                      "Exit with status 1 if the PSNR is below this, in dB");
  command->add_option("--difference", options->difference,
                      "Write a picture of the differences, scaled so that the largest has full brightness");
  command->callback([options] { compare(*options); });
}

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
        fmt::print("  {:<22}{:<22}{}\n", map.name, map.source,
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
