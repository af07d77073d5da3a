#include "render/annotate/globe_box.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <limits>

#include "stream/base/error.h"
#include "stream/cache/coarse_level.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMinSplats = 50'000;  // of the level that the data's box is found from
constexpr size_t kParts = 1440;          // of a circle of latitude
constexpr double kNearlyAround = 350;    // degrees: data that wide goes all around

/// The longitudes of data, by which parts of a circle it covers.
class Longitudes {
 public:
  void add(double west, double east) {
    const double part = 360.0 / kParts;
    if (!(east - west < 360)) {
      covered_.fill(true);
      return;
    }
    const auto first = static_cast<int64_t>(std::floor(west / part)),
               last = std::min(static_cast<int64_t>(std::floor(east / part)), first + int64_t{kParts} - 1);
    for (int64_t n = first; n <= last; ++n) {
      const auto at = static_cast<size_t>((n % int64_t{kParts} + int64_t{kParts}) % int64_t{kParts});
      ends_[at] = covered_[at] ? std::array{std::min(ends_[at][0], unwrapped(west, at)),
                                            std::max(ends_[at][1], unwrapped(east, at))}
                               : std::array{unwrapped(west, at), unwrapped(east, at)};
      covered_[at] = true;
    }
  }

  /// The range from the end of the widest gap to its beginning, eastwards.
  std::array<double, 2> range() const {
    size_t longest = 0, end_of_gap = 0;
    for (size_t n = 0; n < kParts; ++n) {
      size_t gap = 0;
      while (gap < kParts && !covered_[(n + gap) % kParts]) ++gap;
      if (gap > longest) {
        longest = gap;
        end_of_gap = (n + gap) % kParts;
      }
    }
    if (longest == 0) return {-180, 180};
    const size_t last = (end_of_gap + kParts - longest - 1) % kParts;
    double west = ends_[end_of_gap][0], east = ends_[last][1];
    if (last < end_of_gap) east += 360;
    if (east - west > kNearlyAround) return {-180, 180};
    const double turns = 360 * std::floor((0.5 * (west + east) + 180) / 360);
    return {west - turns, east - turns};
  }

 private:
  /// A longitude as near to a part as it can be, and not beyond it.
  static double unwrapped(double longitude, size_t part) {
    const double width = 360.0 / kParts, low = width * static_cast<double>(part);
    const double near = longitude - 360 * std::round((longitude - low) / 360);
    return std::clamp(near, low, low + width);
  }

  std::array<bool, kParts> covered_{};
  std::array<std::array<double, 2>, kParts> ends_{};
};

}  // namespace

std::optional<AnnotatedScene::OnGlobe> boxOnGlobe(const CacheReader& cache,
                                                  const std::optional<Globe>& globe) {
  if (!globe || !globe->degrees()) return std::nullopt;
  constexpr double kFar = std::numeric_limits<double>::infinity();
  glm::dvec3 lower(kFar), upper(-kFar);
  Longitudes longitudes;
  SplatGeometry splats;
  for (const uint32_t brick : bricksAtALevel(cache, kMinSplats)) {
    try {
      cache.readGeometry(brick, splats);
    } catch (const DamagedBrick&) {
      continue;  // drawing it reports it
    }
    const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[brick].cell);
    for (size_t n = 0; n < splats.x.size(); ++n) {
      const glm::dvec3 at = corner + glm::dvec3(splats.x[n], splats.y[n], splats.z[n]);
      // Half of the cell's extent towards the east, the north and up.
      const double a0 = splats.axis0[n], a1 = splats.axis1[n], a2 = splats.axis2[n];
      const std::array columns{glm::dvec3(a0, a0 * splats.shear10[n], a0 * splats.shear20[n]),
                               glm::dvec3(0, a1, a1 * splats.shear21[n]), glm::dvec3(0, 0, a2)};
      const auto reach = [&](const glm::dvec3& direction) {
        double sum = 0;
        for (const glm::dvec3& column : columns) sum += 0.5 * std::abs(glm::dot(column, direction));
        return sum;
      };
      const glm::dvec3 place = globe->geographic(at);
      const Globe unit;
      const glm::dvec3 up = globe->sphere() ? unit.column(place.x, place.y) : glm::dvec3(0, 0, 1),
                       north = globe->sphere() ? unit.column(place.x, place.y + 90) : glm::dvec3(0, 1, 0);
      const double of_degree = globe->radius_km * glm::radians(1.0);
      const double across = globe->sphere() ? std::max(std::cos(glm::radians(place.y)), 1e-3) : 1;
      const glm::dvec3 half(reach(glm::cross(north, up)) / (of_degree * across), reach(north) / of_degree,
                            reach(up) / std::abs(globe->vertical_scale));
      lower = glm::min(lower, place - half);
      upper = glm::max(upper, place + half);
      if (globe->sphere()) longitudes.add(place.x - half.x, place.x + half.x);
    }
  }
  // A globe that is not the data's, or one whose heights are all the same.
  constexpr double kMaxDegrees = 1e6, kMaxHeight = 1e12;
  for (int axis = 0; axis < 3; ++axis) {
    const double most = axis == 2 ? kMaxHeight : kMaxDegrees;
    if (!(lower[axis] <= upper[axis] && lower[axis] >= -most && upper[axis] <= most)) return std::nullopt;
  }
  if (globe->sphere()) {
    const auto [west, east] = longitudes.range();
    lower.x = west;
    upper.x = east;
  }
  lower.y = std::max(lower.y, -90.0);
  upper.y = std::min(upper.y, 90.0);
  return AnnotatedScene::OnGlobe{*globe, lower, upper};
}

Camera cameraAbove(const AnnotatedScene::OnGlobe& box, const glm::dvec3& scale, ImageSize size) {
  constexpr double kViewAngle = 30, kMargin = 1.15, kNearPole = 85;
  constexpr int kPlaces = 16;
  const Globe unit;
  const double east = 0.5 * (box.lower.x + box.upper.x), north = 0.5 * (box.lower.y + box.upper.y);
  const glm::dvec3 middle = unit.column(east, north);
  double reach = 1e-4;  // the largest angle between the middle and a place of the data
  for (int n = 0; n <= kPlaces; ++n)
    for (int m = 0; m <= kPlaces; ++m) {
      const glm::dvec3 part(static_cast<double>(n) / kPlaces, static_cast<double>(m) / kPlaces, 0);
      const glm::dvec3 at = glm::mix(box.lower, box.upper, part);
      reach = std::max(reach, std::acos(std::clamp(glm::dot(middle, unit.column(at.x, at.y)), -1.0, 1.0)));
    }
  const double aspect = static_cast<double>(size.width) / size.height;
  const double slope = std::tan(glm::radians(kViewAngle / 2)) * std::min(1.0, aspect) / kMargin;
  reach = std::min(reach, std::atan(1 / slope));  // what is further away lies behind the horizon
  const double radius = box.globe.radius_km + std::max({0.0, box.globe.vertical_scale * box.lower.z,
                                                        box.globe.vertical_scale * box.upper.z});
  Camera camera;
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = kViewAngle;
  camera.focal_point = glm::dvec3(0.0);
  camera.position = scale * middle * (radius * (std::cos(reach) + std::sin(reach) / slope));
  camera.view_up = std::abs(north) < kNearPole ? glm::dvec3(0, 0, 1) : unit.column(east, north + 90);
  camera.parallel_scale = kMargin * radius * std::sin(reach);
  return camera;
}

void showOnGlobe(const std::optional<AnnotatedScene::OnGlobe>& box, AnnotatedScene& scene) {
  scene.on_globe = box;
  if (box) scene.axis_titles = {"longitude", "latitude", box->isOfDepths() ? "depth [m]" : "height [m]"};
}

}  // namespace curvisplat
