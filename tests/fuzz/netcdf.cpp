// Files in classic NetCDF, whose header libnetcdf parses once it has been checked here (NetCDF-4 is HDF5's), and Zarr: grids and
// trajectories.
#include <algorithm>
#include <cmath>
#include <string>

#include "preprocess/formats/columns/columns_source.h"
#include "preprocess/formats/exodus/exodus_source.h"
#include "preprocess/formats/netcdf/cf_trajectories.h"
#include "preprocess/formats/netcdf/netcdf_file.h"
#include "preprocess/formats/netcdf/netcdf_structure.h"
#include "preprocess/formats/netcdf/open_netcdf.h"
#include "preprocess/formats/netcdf/zarr_file.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

// The header of classic NetCDF files, by which we tell whether one is whole. The rest is libnetcdf's.
void fuzzNetcdfClassic(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("CDF")) return;
  const InputFile file(fuzzFile("a.nc", bytes));
  if (NetcdfFile::recognises(file)) checkClassicNetcdf(file);
}

const RegisteredFuzzTarget netcdf_classic_target("netcdf_classic", fuzzNetcdfClassic);

// Grids by the CF conventions.
//
//   flags u8 | length u16 | first file | second file, if there is more
//
// Flags: 1 both are tiles; 2 the second time step; 4 a flat map; 8 the second file comes first.
void fuzzCfGrid(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  const auto flags = input.take<uint8_t>();
  const auto first = input.takeBytes(input.take<uint16_t>());
  const auto second = input.rest();
  if (!textOf(first).starts_with("CDF")) return;
  // Other inputs' second files must not be found beside the first.
  std::filesystem::remove(fuzzFolder() / "b.nc");
  std::filesystem::remove(fuzzFolder() / "a.tile2.nc");
  const bool tiles = (flags & 1) != 0;
  OpenGridOptions options;
  options.grid = fuzzFile(tiles ? "a.tile1.nc" : "a.nc", first);
  options.temporary_folder = fuzzFolder();
  if (textOf(second).starts_with("CDF"))
    options.solutions = {fuzzFile(tiles ? "a.tile2.nc" : "b.nc", second)};
  if ((flags & 2) != 0) options.time_step = 1;
  if ((flags & 4) != 0) options.globe.shape = GlobeOptions::Shape::kFlat;
  if ((flags & 8) != 0 && !options.solutions.empty()) std::swap(options.grid, options.solutions.front());
  const auto source = openNetcdf(options);
  readGrid(*source);
}

const RegisteredFuzzTarget cf_grid_target("cf_grid", fuzzCfGrid);

// UGRID, ICON and MPAS files.
void fuzzColumns(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("CDF")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.nc", bytes);
  options.temporary_folder = fuzzFolder();
  if (isColumnsGrid(options)) readMesh(ColumnsSource(options));
}

const RegisteredFuzzTarget columns_target("columns", fuzzColumns);

// Exodus files.
void fuzzExodus(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("CDF")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.exo", bytes);
  options.temporary_folder = fuzzFolder();
  if (isExodus(InputFile(options.grid))) readData(openExodus(options));
}

const RegisteredFuzzTarget exodus_target("exodus", fuzzExodus);

// Zarr stores, as archives.
void fuzzZarr(std::span<const std::byte> bytes) {
  if (!textOf(bytes).starts_with("PK")) return;
  OpenGridOptions options;
  options.grid = fuzzFile("a.zip", bytes);
  if (isZarrStore(options.grid)) readGrid(*openNetcdf(options));
}

const RegisteredFuzzTarget zarr_target("zarr", fuzzZarr);

// Trajectories in classic NetCDF files and archives of Zarr stores. The first byte: with the values of p (1).
void fuzzTrajectories(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  const std::string scalar = (input.take<uint8_t>() & 1) != 0 ? "p" : "";
  const std::string_view start = textOf(input.rest()).substr(0, 3);
  if (start != "CDF" && !start.starts_with("PK")) return;
  const auto path = fuzzFile(start == "CDF" ? "a.nc" : "a.zip", input.rest());
  if (!isTrajectoryFile(path)) return;
  const CfTrajectories read = readCfTrajectories(path, scalar);
  CURVISPLAT_CHECK_OP(read.begins.back(), ==, read.points.size());
  CURVISPLAT_CHECK(read.values.empty() || read.values.size() == read.points.size());
  CURVISPLAT_CHECK(read.times.empty() || read.times.size() == read.points.size());
  for (const glm::dvec3& point : read.points)
    CURVISPLAT_CHECK(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z));
  for (size_t line = 0; line + 1 < read.begins.size(); ++line) {
    CURVISPLAT_CHECK_OP(read.begins[line], <, read.begins[line + 1]);
    if (!read.times.empty())
      CURVISPLAT_CHECK(
          std::is_sorted(&read.times[read.begins[line]], &read.times[read.begins[line + 1] - 1] + 1));
  }
}

const RegisteredFuzzTarget trajectories_target("trajectories", fuzzTrajectories);

}  // namespace
}  // namespace curvisplat
