// Options of lines and points in a picture: --lines, --points and how they look. Part of the options of surfaces
// (scene_arguments.h), which hold them as given; checked without a cache. Reading the files can take long. The functions keep no
// state: any thread may call them.
#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <vector>

#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct CurveArguments {
  std::vector<std::string> lines, points, colours;
  std::string by;  // a scalar of the files
  std::string line_width = "3px", point_size = "6px", opacity = "1";
  std::optional<std::string> time;

  bool given() const { return !lines.empty() || !points.empty(); }
};

/// Adds --lines, --line-width, --points, --point-size, --lines-by, --lines-colour, --lines-opacity and --lines-time.
void addCurveOptions(CLI::App& command, CurveArguments& arguments, const std::string& group);

/// Throws UsageError; reads no file.
void checkCurveArguments(const CurveArguments& arguments);

/// Reads the files, those of lines first, and places what is in degrees as the cache's grid is. `drawn`: the scalar of the
/// picture's colours, whose function colours a scalar of the same name; another gets one over its values. Trajectories are
/// those of the cache's step. Throws Error for a file that cannot be read, or has no such scalar.
std::vector<Curves> curvesOf(const CurveArguments& arguments, const CacheReader& cache,
                             const std::optional<Globe>& globe, const std::string& drawn);

}  // namespace curvisplat
