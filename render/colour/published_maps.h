// The built-in colour maps: their names, categories and published points.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "render/colour/colour_map.h"

namespace curvisplat {

enum class MapCategory { kSequential, kDiverging, kCyclic };

struct PublishedMap {
  struct Point {
    double x, red, green, blue;  // each 0..1
  };

  std::string_view name, source;  // "thermal", "cmocean"
  MapCategory category = MapCategory::kSequential;
  bool colour_blind_safe = false;  // told apart with the common forms of colour blindness
  ColourSpace space = ColourSpace::kRgb;
  std::span<const Point> points = {};  // sorted by x, from 0 to 1
};

/// Those of matplotlib, cmocean and ParaView; published_maps.cpp names versions and licences.
std::span<const PublishedMap> publishedMaps();

/// All maps that --tf knows, the five that transfer_function_presets.cpp defines first. `points` is empty for
/// these five.
std::span<const PublishedMap> builtInMaps();

}  // namespace curvisplat
