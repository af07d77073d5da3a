// Trajectories in NetCDF files and Zarr stores by the CF conventions, chapter 9: contiguous and indexed ragged arrays, and
// incomplete multidimensional arrays as OceanParcels and OpenDrift write them, to be drawn in a volume. A single trajectory
// along one dimension, and points without trajectories, are read, too. What is missing is left out, and ends a line.
//
// Values are read a few MiB at a time: the memory taken is that of the points which are there, 48 bytes each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "stream/base/calendar.h"

namespace curvisplat {

struct CfTrajectories {
  std::vector<glm::dvec3>
      points;  // of one line after the other: degrees east and north, or kilometres; kilometres of height
  bool degrees = true;
  std::vector<uint32_t> begins{0};  // [lines + 1], into points
  std::vector<float> values;        // [points], or none
  std::vector<double> times;        // [points], or none; they do not decrease along a line
  TimeUnit time_unit;
};

/// Whether it is a NetCDF file or a Zarr store.
bool isTrajectoryFile(const std::filesystem::path& path);

/// `scalar`: a variable of the observations or of the trajectories; empty: none. Throws Error if the file is damaged, has no
/// trajectories, or no such variable.
CfTrajectories readCfTrajectories(const std::filesystem::path& path, const std::string& scalar);

}  // namespace curvisplat
