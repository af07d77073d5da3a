// Small NetCDF files as models of the ocean and the atmosphere write them, of known values.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "tests/support/netcdf_writer.h"

namespace curvisplat {

/// Files as ROMS writes them: an Arakawa C mesh of terrain-following levels; temp and salt at rho points, u
/// and v beside them, w between the levels; two records. Land at the rho points i < 2, j < 2.
namespace roms {
inline constexpr size_t kXi = 7, kEta = 6, kLevels = 4, kTimes = 2;
inline constexpr double kHc = 20, kThetaS = 5, kThetaB = 0.4, kFill = 1e37;
/// Coordinates of rho points; other points stand half-way.
double longitude(double j, double i);
double latitude(double j, double i);
double depth(double j, double i);
double elevation(size_t time, double j, double i);
double sRho(size_t k);
double csRho(size_t k);
double sW(size_t k);
double csW(size_t k);
/// The value of a variable, by its number.
double value(int variable, size_t time, size_t k, size_t j, size_t i);
/// `coordinate`: the standard_name of the vertical one, ocean_s_coordinate_g1 for example.
void write(const std::filesystem::path& path, NetcdfFileType type, const std::string& coordinate);
}  // namespace roms

/// Files as NEMO writes them: nav_lon and nav_lat, 32 bits; levels of depth, downwards; packed temperatures.
namespace nemo {
inline constexpr size_t kX = 6, kY = 5, kLevels = 4, kTimes = 3;
inline constexpr double kScale = 0.01, kOffset = 10;
double longitude(size_t j, size_t i);
double latitude(size_t j, size_t i);
double level(size_t k);
/// The depth of a node, with partial cells at the bottom.
double depth(size_t k, size_t j, size_t i);
/// The packed temperature.
double packed(size_t time, size_t k, size_t j, size_t i);
bool land(size_t k, size_t j, size_t i);
void write(const std::filesystem::path& path, NetcdfFileType type, bool partial_cells);
}  // namespace nemo

/// Files as WRF writes them: no coordinate variables, XLONG and XLAT in every record, the geopotential
/// between the levels.
namespace wrf {
inline constexpr size_t kWest = 6, kSouth = 5, kBottom = 4, kTimes = 2;
double longitude(double j, double i);
double latitude(double j, double i);
double geopotentialBase(size_t k, size_t j, size_t i);
double geopotentialPerturbation(size_t time, size_t k, size_t j, size_t i);
double value(int variable, size_t time, size_t k, size_t j, size_t i);
void write(const std::filesystem::path& path, NetcdfFileType type);
}  // namespace wrf

}  // namespace curvisplat
