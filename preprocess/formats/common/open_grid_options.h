// What a user says of a grid's files: which they are, and what cannot be detected or is to be overruled.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_order.h"

namespace curvisplat {

enum class RecordMarkers { kNone, kBytes4, kBytes8 };

/// What the user says of a PLOT3D file's layout; the rest is detected.
struct Plot3dForce {
  std::optional<bool> ascii;
  std::optional<ByteOrder> byte_order;
  std::optional<RecordMarkers> records;
  std::optional<int> precision_bytes;  // 4 or 8
  std::optional<bool> multi_block;
  std::optional<bool> blanking;
};

/// What the user says of grids of the earth.
struct GlobeOptions {
  enum class Shape { kAutomatic, kSphere, kFlat };
  Shape shape = Shape::kAutomatic;  // automatic: a sphere for degrees, flat for lengths
  double radius_km = 6371;
  double vertical_scale = 1;
};

struct OpenGridOptions {
  std::filesystem::path grid;
  std::vector<std::filesystem::path> solutions;  // Q and function files; may be empty
  std::filesystem::path temporary_folder;        // ASCII is spooled to binary here; empty: the system's
  Plot3dForce force;                             // what the user says of the layout, over what is detected
  std::optional<uint32_t> time_step = {};        // from 0; none: the first
  std::vector<std::string> function_names = {};  // of function files' variables, over their .nam files
  GlobeOptions globe = {};                       // of grids in degrees
  std::vector<std::string> scalars = {};         // that are wanted: they choose among several grids of a file
};

}  // namespace curvisplat
