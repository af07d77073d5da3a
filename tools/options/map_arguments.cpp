#include "tools/options/map_arguments.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "render/annotate/globe_box.h"
#include "render/mesh/curve_set.h"
#include "render/surface/map_image.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

/// The globe, which has degrees.
const Globe& globeFor(const std::string& map, const std::optional<Globe>& globe) {
  requireGlobe(globe, "--map " + map);
  if (!globe->degrees())
    throw Error("--map {}: needs longitudes and latitudes, but the cache's grid has lengths", map);
  return *globe;
}

glm::vec3 colourOf(const std::string& map) {
  try {
    return glm::vec3(parseBackground("--map", map));
  } catch (const UsageError&) {
    throw UsageError("--map {}: expected the file of an image, or a colour #rrggbb", map);
  }
}

double heightOf(const MapArguments& arguments, const CacheReader& cache, const Globe& globe) {
  if (!arguments.height) {
    const auto box = boxOnGlobe(cache, globe);
    return box ? std::min(box->lower.z, 0.0) : 0;
  }
  const double height = parseNumber("--map-height", *arguments.height);
  if (globe.sphere() && !(globe.radius_km + height * globe.vertical_scale > 0))
    throw UsageError("--map-height {}: lies below the middle of the Earth", *arguments.height);
  return height;
}

}  // namespace

void addMapOptions(CLI::App& command, MapArguments& arguments, const std::string& group) {
  command
      .add_option("--map", arguments.map,
                  "The Earth as an opaque surface below data with longitudes and latitudes: the image of a "
                  "map (equirectangular, all of the Earth), or a colour #rrggbb; --surface blanks shows the "
                  "image, too")
      ->group(group);
  command
      .add_option("--map-height", arguments.height,
                  "Height of that surface, in kilometres; depths are negative (default: the data's lowest, "
                  "at most 0)")
      ->group(group);
}

void checkMapArguments(const MapArguments& arguments) {
  if (arguments.height && !arguments.map)
    throw UsageError("--map-height {} needs a map: --map FILE", *arguments.height);
  constexpr double kMaxHeight = 1e9;
  if (arguments.height && !(std::abs(parseNumber("--map-height", *arguments.height)) <= kMaxHeight))
    throw UsageError("--map-height {}: expected at most {:g} kilometres, up or down", *arguments.height,
                     kMaxHeight);
  if (arguments.map && !arguments.isImage()) colourOf(*arguments.map);
}

std::optional<AnnotatedScene::OnGlobe> boxOnEarth(const MapArguments& arguments, const CacheReader& cache,
                                                  const std::optional<Globe>& globe) {
  return arguments.map && globe && globe->sphere() ? boxOnGlobe(cache, globe) : std::nullopt;
}

std::optional<Surface> mapOf(const MapArguments& arguments, const CacheReader& cache,
                             const std::optional<Globe>& globe) {
  if (!arguments.map) return std::nullopt;
  const Globe& on = globeFor(*arguments.map, globe);
  Surface surface;
  if (arguments.isImage())
    surface.map = std::make_shared<PlacedMap>(PlacedMap{readMapImage(*arguments.map), on});
  else
    surface.colour = colourOf(*arguments.map);
  surface.mesh = std::make_shared<TriangleMesh>(meshOfGlobe(on, heightOf(arguments, cache, on)));
  return surface;
}

}  // namespace curvisplat
