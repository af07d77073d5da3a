// The user's options for opening a grid: its files, and settings that cannot be detected or that override
// detection.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/file_index.h"

namespace curvisplat {

enum class RecordMarkers { kNone, kBytes4, kBytes8 };

/// Parts of a PLOT3D file's layout that the user has fixed; the rest is detected.
struct Plot3dForce {
  std::optional<bool> ascii;
  std::optional<ByteOrder> byte_order;
  std::optional<RecordMarkers> records;
  std::optional<int> precision_bytes;  // 4 or 8
  std::optional<bool> multi_block;
  std::optional<bool> blanking;

  bool operator==(const Plot3dForce& other) const = default;
};

/// How longitude and latitude become positions.
struct GlobeOptions {
  enum class Shape { kAutomatic, kSphere, kFlat };
  Shape shape = Shape::kAutomatic;  // automatic: sphere for degrees, flat for lengths
  double radius_km = 6371;
  double vertical_scale = 1;

  bool operator==(const GlobeOptions& other) const = default;
};

/// The options of openData(). Only `grid` has to be set.
struct OpenGridOptions {
  std::filesystem::path grid;
  std::vector<std::filesystem::path> solutions;  // PLOT3D Q and function files; may be empty
  std::filesystem::path temporary_folder;        // for spool files; empty: the system's
  Plot3dForce force;                             // overrides the detected PLOT3D layout
  std::optional<uint32_t> time_step = {};        // from 0; nullopt: the first
  std::vector<std::string> function_names = {};  // variables of function files; override their .nam files
  GlobeOptions globe = {};                       // for grids in degrees
  std::vector<std::string> scalars = {};         // requested; select one of several grids in a file
  std::optional<bool> cut_curved = {};    // cells of higher order (default); false: drawn by their corners
  std::vector<std::string> select = {};   // "month=3": the value to read of a NetCDF dimension
  std::shared_ptr<FileIndex> index = {};  // of files whose steps are opened one after the other; may be null
  std::optional<std::filesystem::path> names_folder = {};  // of the files that `grid` names; nullopt: its own

  bool is_part = false;  // `grid` is one of a grid's files, each of which is opened by itself

  /// The folder that names in `grid` are relative to.
  std::filesystem::path namesFolder() const { return names_folder.value_or(grid.parent_path()); }
};

}  // namespace curvisplat
