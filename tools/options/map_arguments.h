// Options of the Earth in a picture: --map, an image or a colour on the globe that the data lies on, and --map-height. Part of the
// options of surfaces (scene_arguments.h), which hold them as given; checked without a cache. Reading the image can take seconds.
// The functions keep no state: any thread may call them.
#pragma once

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

#include "render/annotate/annotated_scene.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/globe.h"

namespace curvisplat {

struct MapArguments {
  std::optional<std::string> map, height;  // a file or #rrggbb; kilometres

  bool isImage() const { return map && !map->starts_with('#'); }
};

/// Adds --map and --map-height.
void addMapOptions(CLI::App& command, MapArguments& arguments, const std::string& group);

/// Throws UsageError; reads no file.
void checkMapArguments(const MapArguments& arguments);

/// The places of data that lies around an opaque Earth, which has to be looked at from outside; nullopt without --map, or on a flat
/// map. Throws as boxOnGlobe().
std::optional<AnnotatedScene::OnGlobe> boxOnEarth(const MapArguments& arguments, const CacheReader& cache,
                                                  const std::optional<Globe>& globe);

/// The Earth as an opaque surface, at its height, by default that of the data's lowest place, or the sea's if that is lower.
/// nullopt without --map. Throws Error for a file that is no map, or if the cache has no globe.
std::optional<Surface> mapOf(const MapArguments& arguments, const CacheReader& cache,
                             const std::optional<Globe>& globe);

}  // namespace curvisplat
