#include "tools/options/grid_options.h"

#include <charconv>
#include <cmath>
#include <map>
#include <string>

#include "preprocess/formats/derived/derived_mesh.h"
#include "preprocess/gather/gradient_mesh.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {
namespace {

constexpr const char* kGroup = "PLOT3D layout (default: detected)";
constexpr const char* kGlobeGroup = "Longitude-latitude grids (NetCDF), in kilometres";

/// Adds an option that accepts the keys of `values` and sets `target` to the value of the given key.
template <typename Value>
void addChoice(CLI::App& app, const char* name, const char* help, const std::map<std::string, Value>& values,
               std::optional<Value>& target) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : values) keys.push_back(key);
  app.add_option_function<std::string>(
         name, [values, &target](const std::string& key) { target = values.at(key); }, help)
      ->check(CLI::IsMember(keys))
      ->group(kGroup);
}

void addGlobeOptions(CLI::App& app, GlobeOptions& globe) {
  // A flag with an optional value: an option would take the next argument, the grid file, as its value.
  const std::string sphere_help = "Project to a sphere (default); --sphere=KM sets its radius";
  CLI::Option* const sphere =
      app.add_flag("--sphere{6371}", sphere_help)
          ->each([&globe](const std::string& radius) {
            globe.shape = GlobeOptions::Shape::kSphere;
            const char* const end = radius.data() + radius.size();
            const auto [parsed, error] = std::from_chars(radius.data(), end, globe.radius_km);
            if (error != std::errc{} || parsed != end || !(globe.radius_km > 0) ||
                !std::isfinite(globe.radius_km))
              throw CLI::ValidationError(radius +
                                         " is not a radius; expected kilometres above zero, such as 6371");
          })
          ->group(kGlobeGroup);
  app.add_flag_callback(
         "--flat", [&globe] { globe.shape = GlobeOptions::Shape::kFlat; },
         "Project to a flat map (equirectangular)")
      ->group(kGlobeGroup)
      ->excludes(sphere);
  app.add_option("--vertical-scale", globe.vertical_scale, "Vertical exaggeration factor (default 1)")
      ->check(CLI::Number)
      ->group(kGlobeGroup);
}

}  // namespace

void addGridOptions(CLI::App& app, OpenGridOptions& options) {
  app.add_option("--time-step", options.time_step,
                 "Time step to read from the grid's files, counted from 0 (default 0)");
  addGlobeOptions(app, options.globe);
  Plot3dForce& force = options.force;
  addChoice<ByteOrder>(app, "--byte-order", "Byte order of binary files",
                       {{"little", ByteOrder::kLittle}, {"big", ByteOrder::kBig}}, force.byte_order);
  addChoice<RecordMarkers>(
      app, "--records", "Size of Fortran record markers in bytes; none: C binary",
      {{"none", RecordMarkers::kNone}, {"4", RecordMarkers::kBytes4}, {"8", RecordMarkers::kBytes8}},
      force.records);
  addChoice<int>(app, "--precision", "Floating-point precision", {{"single", 4}, {"double", 8}},
                 force.precision_bytes);
  addChoice<bool>(app, "--blocks", "multi: the file begins with a block count",
                  {{"single", false}, {"multi", true}}, force.multi_block);
  addChoice<bool>(app, "--iblank", "Whether the grid file has an iblank array",
                  {{"no", false}, {"yes", true}}, force.blanking);
  CLI::Option* const ascii = app.add_flag_callback(
                                    "--ascii", [&force] { force.ascii = true; }, "Read as ASCII")
                                 ->group(kGroup);
  app.add_flag_callback(
         "--binary", [&force] { force.ascii = false; }, "Read as binary")
      ->group(kGroup)
      ->excludes(ascii);
}

void addGasOptions(CLI::App& app, GasModel& gas) {
  constexpr const char* kGasGroup = "Gas model of derived scalars";
  app.add_option("--gamma", gas.gamma, "Ratio of specific heats (default: from the files, else 1.4)")
      ->group(kGasGroup);
  app.add_option("--gas-constant", gas.constant, "Specific gas constant R (default: from the files, else 1)")
      ->group(kGasGroup);
}

std::unique_ptr<DataSource> openWithDerived(const OpenGridOptions& grid, const DerivedOptions& derived) {
  std::unique_ptr<DataSource> source = openData(grid);
  if (auto* const mesh = dynamic_cast<MeshSource*>(source.get())) {
    source.release();
    return std::make_unique<GradientMesh>(
        std::make_unique<DerivedMeshSource>(std::unique_ptr<MeshSource>(mesh), derived), derived,
        grid.temporary_folder.empty() ? std::filesystem::temp_directory_path() : grid.temporary_folder);
  }
  return std::make_unique<DerivedSource>(requireGrid(std::move(source), ""), derived);
}

}  // namespace curvisplat
