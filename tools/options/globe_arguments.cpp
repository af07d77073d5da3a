#include "tools/options/globe_arguments.h"

#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>

#include "render/project/screen_view.h"
#include "stream/base/error.h"
#include "tools/options/option_parsers.h"

namespace curvisplat {
namespace {

constexpr const char* kViewAngle = "30";

}  // namespace

void addGlobeOption(CLI::App& command, std::optional<std::string>& text, const std::string& group) {
  command
      .add_option("--globe", text,
                  "RADIUS[,VERTICAL_SCALE] of the sphere around 0,0,0 on which the data lies, in kilometres, "
                  "for caches that "
                  "do not say it (those of NetCDF grids do): longitude and latitude of --lines, --look-at "
                  "and --axes-grid")
      ->group(group);
}

std::optional<Globe> globeOf(const std::optional<std::string>& text, const Manifest& manifest) {
  if (!text) return manifest.globe;
  Globe globe;
  const size_t comma = std::min(text->find(','), text->size());
  globe.radius_km = parsePositive("--globe", text->substr(0, comma));
  if (comma < text->size()) globe.vertical_scale = parsePositive("--globe", text->substr(comma + 1));
  return globe;
}

void addLookAtOptions(CLI::App& command, CameraArguments& arguments, const std::string& group) {
  command
      .add_option("--look-at", arguments.look_at,
                  "Longitude and latitude LON,LAT of the place that the camera looks down at, north up, in "
                  "perspective")
      ->group(group);
  command
      .add_option(
          "--from-height", arguments.from_height,
          "Height of the camera above that place, in kilometres (of the data: heights are not scaled)")
      ->group(group);
}

CameraArguments placedAbove(const CameraArguments& arguments, const std::optional<Globe>& globe,
                            const glm::dvec3& scale) {
  if (!arguments.look_at) return arguments;
  const auto degrees = parseNumbers("--look-at", *arguments.look_at, "LON,LAT");
  if (!(std::abs(degrees[0]) <= 360 && std::abs(degrees[1]) <= 90))
    throw UsageError("--look-at {}: expected a longitude and a latitude, in degrees", *arguments.look_at);
  if (!globe || !globe->degrees())
    throw UsageError(
        "--look-at {}: the cache does not say where its grid has longitudes and latitudes; --globe does",
        *arguments.look_at);
  const double height = parsePositive("--from-height", *arguments.from_height);
  const glm::dvec3 column = globe->column(degrees[0], degrees[1]), ground = globe->place(column, 0);
  const glm::dvec3 up = globe->sphere() ? column : glm::dvec3(0, 0, 1);
  glm::dvec3 north(0, 1, 0);
  if (globe->sphere()) {
    const Globe unit;
    north = unit.column(degrees[0], degrees[1] + 90);
  }
  const auto text = [](const glm::dvec3& v) { return fmt::format("{},{},{}", v.x, v.y, v.z); };
  // The height is that above a globe which is drawn larger or smaller, but not that of exaggerated depths.
  const glm::dvec3 of_height = globe->sphere() ? scale : glm::dvec3(1, 1, std::sqrt(scale.x * scale.y));
  CameraArguments placed = arguments;
  placed.position = text(scale * ground + of_height * (height * up));
  placed.focal_point = text(scale * ground);
  placed.view_up = text(scale * north);
  if (!placed.view_angle && !placed.parallel_scale) placed.view_angle = kViewAngle;
  return placed;
}

glm::dvec3 verticallyScaled(const glm::dvec3& scale, const std::optional<std::string>& text,
                            const std::optional<Globe>& globe) {
  if (!text) return scale;
  const double factor = parsePositive("--vertical-scale", *text);
  if (globe && globe->sphere())
    throw UsageError(
        "--vertical-scale {}: the data lies on a sphere, where heights have no axis of their own; convert "
        "the grid "
        "with --vertical-scale {}, or with --flat",
        *text, *text);
  if (scale.z != 1)
    throw UsageError("--vertical-scale {}: --scale stretches z as well; give one of them", *text);
  const double stretch = factor / (globe ? std::abs(globe->vertical_scale) : 1);
  if (!(stretch >= kMinScale && stretch <= kMaxScale))
    throw UsageError("--vertical-scale {}: expected a factor that stretches z by {:g} to {:g}", *text,
                     kMinScale, kMaxScale);
  return {scale.x, scale.y, stretch};
}

ShownBox withGrid(const ShownBox& shown, const std::optional<AnnotatedScene::OnGlobe>& on_globe,
                  const glm::dvec3& scale) {
  ShownBox box = shown;
  if (!on_globe) return box;
  constexpr int kPieces = 8;
  for (int n = 0; n < 12 * (kPieces + 1); ++n) {
    // A place on one of the box's edges.
    const int axis = n % 3, corner = n / 3 % 4;
    glm::dvec3 part;
    part[axis] = static_cast<double>(n / 12) / kPieces;
    part[(axis + 1) % 3] = corner & 1;
    part[(axis + 2) % 3] = corner >> 1;
    const glm::dvec3 at = scale * on_globe->globe.placeAt(glm::mix(on_globe->lower, on_globe->upper, part));
    box.lower = glm::min(box.lower, at);
    box.upper = glm::max(box.upper, at);
  }
  return box;
}

}  // namespace curvisplat
