#include "tools/options/grid_options.h"

#include <charconv>
#include <cmath>
#include <map>
#include <string>

namespace curvisplat {
namespace {

constexpr const char* kGroup = "How PLOT3D files are written (detected if not given)";
constexpr const char* kGlobeGroup = "Where grids of the earth lie (NetCDF; kilometres)";

/// An option whose words stand for values of `target`.
template <typename Value>
void addWords(CLI::App& app, const char* name, const char* help, const std::map<std::string, Value>& words,
              std::optional<Value>& target) {
  std::vector<std::string> spellings;
  for (const auto& [word, value] : words) spellings.push_back(word);
  app.add_option_function<std::string>(
         name, [words, &target](const std::string& word) { target = words.at(word); }, help)
      ->check(CLI::IsMember(spellings))
      ->group(kGroup);
}

void addGlobeOptions(CLI::App& app, GlobeOptions& globe) {
  // A flag that may have a value, not an option: the next word is the grid's name.
  const std::string sphere_help =
      "Longitude and latitude lie on a sphere, the default; --sphere=KM: of that radius";
  CLI::Option* const sphere =
      app.add_flag("--sphere{6371}", sphere_help)
          ->each([&globe](const std::string& radius) {
            globe.shape = GlobeOptions::Shape::kSphere;
            const char* const end = radius.data() + radius.size();
            const auto [parsed, error] = std::from_chars(radius.data(), end, globe.radius_km);
            if (error != std::errc{} || parsed != end || !(globe.radius_km > 0) ||
                !std::isfinite(globe.radius_km))
              throw CLI::ValidationError(radius + " is no radius; expected kilometres, as 6371");
          })
          ->group(kGlobeGroup);
  app.add_flag_callback(
         "--flat", [&globe] { globe.shape = GlobeOptions::Shape::kFlat; },
         "They are a flat map's, of equal kilometres a degree")
      ->group(kGlobeGroup)
      ->excludes(sphere);
  app.add_option("--vertical-scale", globe.vertical_scale, "Depth and height are so many times as large (1)")
      ->check(CLI::Number)
      ->group(kGlobeGroup);
}

}  // namespace

void addGridOptions(CLI::App& app, OpenGridOptions& options) {
  app.add_option("--time-step", options.time_step,
                 "Of several time steps the one to take, from 0 (default: the first)");
  addGlobeOptions(app, options.globe);
  Plot3dForce& force = options.force;
  addWords<ByteOrder>(app, "--byte-order", "Byte order",
                      {{"little", ByteOrder::kLittle}, {"big", ByteOrder::kBig}}, force.byte_order);
  addWords<RecordMarkers>(
      app, "--records", "Bytes of Fortran's record markers; none: a C file",
      {{"none", RecordMarkers::kNone}, {"4", RecordMarkers::kBytes4}, {"8", RecordMarkers::kBytes8}},
      force.records);
  addWords<int>(app, "--precision", "Precision of the numbers", {{"single", 4}, {"double", 8}},
                force.precision_bytes);
  addWords<bool>(app, "--blocks", "multi: a block count comes first", {{"single", false}, {"multi", true}},
                 force.multi_block);
  addWords<bool>(app, "--iblank", "Whether the grid has an iblank array", {{"no", false}, {"yes", true}},
                 force.blanking);
  CLI::Option* const ascii = app.add_flag_callback(
                                    "--ascii", [&force] { force.ascii = true; }, "Texts")
                                 ->group(kGroup);
  app.add_flag_callback(
         "--binary", [&force] { force.ascii = false; }, "No texts")
      ->group(kGroup)
      ->excludes(ascii);
}

void addGasOptions(CLI::App& app, GasModel& gas) {
  constexpr const char* kGasGroup = "The gas that derived quantities are of";
  app.add_option("--gamma", gas.gamma, "Ratio of specific heats (default: the files', else 1.4)")
      ->group(kGasGroup);
  app.add_option("--gas-constant", gas.constant, "Gas constant R (default: the files', else 1)")
      ->group(kGasGroup);
}

std::unique_ptr<GridSource> openWithDerived(const OpenGridOptions& grid, const DerivedOptions& derived) {
  return std::make_unique<DerivedSource>(openGrid(grid), derived);
}

}  // namespace curvisplat
