// Splats such as the decoders let through (finite, axes above zero), on their way to a picture.
//
//   flags u8 | corner of the cell, 3 doubles | scale, 3 doubles | size of the cell, double | splats: 10
//   floats, a half cell, 5 floats each
#include <algorithm>
#include <cmath>
#include <limits>

#include "render/cpu/cpu_painter.h"
#include "render/project/depth_keys.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/base/check.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

enum Flags : uint8_t { kPerspective = 1, kFlat = 2, kClip = 4, kCells = 8, kLit = 16, kPlane = 32 };

constexpr float kLargest = std::numeric_limits<float>::max();

float finite(float value, float least) {
  return std::isfinite(value) ? std::max(value, least) : 1.0f;
}

struct Splats {
  SplatGeometry geometry;
  SplatVariable values;

  void take(FuzzInput& input) {
    for (auto* array : {&geometry.x, &geometry.y, &geometry.z})
      array->push_back(finite(input.take<float>(), 0));
    for (auto* array : {&geometry.axis0, &geometry.axis1, &geometry.axis2})
      array->push_back(finite(input.take<float>(), std::numeric_limits<float>::min()));
    for (auto* array : {&geometry.shear10, &geometry.shear20, &geometry.shear21})
      array->push_back(finite(input.take<float>(), -kLargest));
    geometry.weight.push_back(finite(input.take<float>(), 0));
    const auto border_code = input.take<uint32_t>();
    geometry.border_code.push_back(isPossibleBorderCode(border_code) ? border_code : kNoBorder);
    const auto growth_code = input.take<uint32_t>();
    geometry.growth_code.push_back(isPossibleGrowthCode(growth_code) ? growth_code : kNoGrowth);
    for (auto* array : {&values.mean, &values.slope0, &values.slope1, &values.slope2})
      array->push_back(finite(input.take<float>(), -kLargest));
    values.variance.push_back(finite(input.take<float>(), 0));
  }
};

const ClassificationTable& table() {
  static const ClassificationTable table(
      [](double f) {
        return TransferFunction::Value{{f, 1 - f, 0.5}, f > 0.2 ? 8 * f * f : 0};
      },
      0, 1);
  return table;
}

void fuzzPicture(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  const auto flags = input.take<uint8_t>();
  glm::dvec3 corner, scale;
  for (int axis = 0; axis < 3; ++axis) corner[axis] = input.take<double>();
  for (int axis = 0; axis < 3; ++axis) scale[axis] = input.take<double>();
  const auto size = input.take<double>();
  Splats splats;
  while (!input.rest().empty() && splats.geometry.size() < 256) splats.take(input);

  const ImageSize pixels{40, 24};
  const Camera camera =
      Camera::named("iso", scale * corner, scale * (corner + size), pixels,
                    flags & kPerspective ? Projection::kPerspective : Projection::kOrthographic);
  ProjectionSettings settings{ScreenView::of(camera, pixels, scale, kLowPass, 1e-4 * size), !(flags & kFlat)};
  if (flags & kCells) settings.borders = kWholeCellStyle;
  if (flags & kClip) settings.clip_planes = clipPlanesOf({}, WorldBox{corner, corner + 0.5 * size});
  if (flags & kPlane) settings.clip_planes.push_back({corner + 0.4 * size, {1, -2, 0.5}});
  if (flags & kLit) settings.light.emplace();

  static BrickProjector projector;
  static CpuPainter painter;
  projector.project(settings, table(), corner, splats.geometry, splats.values);
  static DepthSorter sorter;
  const DepthKeys keys(settings.view, RootCube{corner, size}, painter.order());
  std::vector<uint32_t> of_splats(projector.depths().size());
  keys.keysOf(projector.depths(), corner, {0, ~uint32_t{0}}, of_splats);
  std::vector<ScreenSplat> sorted;
  for (const DepthItem& item : sorter.sort(of_splats, painter.order()))
    sorted.push_back(projector.splats()[item.splat]);
  painter.begin(pixels, {1, 1, 1, 1}, table(), {settings.per_pixel, settings.light.has_value()}, {1, 512});
  painter.draw(sorted);
  const Image image = painter.end();
  for (const float channel : image.rgba) CURVISPLAT_CHECK(std::isfinite(channel));
}

const RegisteredFuzzTarget picture_target("picture", fuzzPicture);

}  // namespace
}  // namespace curvisplat
