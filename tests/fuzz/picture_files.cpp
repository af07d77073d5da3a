// Inputs of pictures: splats, colour maps, camera paths, pictures, surfaces and curves.
#include <algorithm>
#include <cmath>
#include <limits>

#include "render/colour/classification.h"
#include "render/colour/transfer_function.h"
#include "render/cpu/cpu_painter.h"
#include "render/film/film.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "render/mesh/curve_set.h"
#include "render/mesh/triangle_mesh.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

enum ProjectionFlags : uint8_t {
  kWithPerspective = 1,
  kFlat = 2,
  kClip = 4,
  kCells = 8,
  kLit = 16,
  kPlane = 32
};

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

// Splats such as the decoders let through (finite, axes above zero), on their way to a picture.
//
//   flags u8 | corner of the cell, 3 doubles | scale, 3 doubles | size of the cell, double | splats: 10
//   floats, a half cell, 5 floats each
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
                    flags & kWithPerspective ? Projection::kPerspective : Projection::kOrthographic);
  ProjectionSettings settings{ScreenView::of(camera, pixels, scale, kLowPass, 1e-4 * size), !(flags & kFlat)};
  if (flags & kCells) settings.borders = kWholeCellStyle;
  if (flags & kClip) settings.clip_planes = clipPlanesOf({}, WorldBox{corner, corner + 0.5 * size});
  if (flags & kPlane) settings.clip_planes.push_back({corner + 0.4 * size, {1, -2, 0.5}});
  if (flags & kLit) settings.light.emplace();

  static BrickProjector projector;
  static CpuPainter painter;
  projector.project(settings, table(), corner, splats.geometry, splats.values);
  static DepthSorter sorter;
  const DepthKeys keys(settings.view, RootCube{corner, size});
  std::vector<uint32_t> of_splats(projector.depths().size());
  keys.setKeys(projector.mutableSplats(), projector.depths(), corner, {0, ~uint32_t{0}}, of_splats);
  std::vector<ScreenSplat> sorted;
  for (const DepthItem& item : sorter.sort(of_splats)) sorted.push_back(projector.splats()[item.splat]);
  painter.begin(pixels, {1, 1, 1, 1}, table(), {settings.per_pixel, settings.light.has_value()}, {1, 512});
  painter.draw(sorted);
  const Image image = painter.end();
  for (const float channel : image.rgba) CURVISPLAT_CHECK(std::isfinite(channel));
}

const RegisteredFuzzTarget picture_target("picture", fuzzPicture);

void checkValues(const TransferFunction& function) {
  const auto [low, high] = function.range();
  for (const double scalar :
       {low, 0.5 * low + 0.5 * high, 0.99 * high + 0.01 * low, high, -1e30, 0.0, 1e30}) {
    const TransferFunction::Value value = function.at(scalar);
    CURVISPLAT_CHECK(value.extinction >= 0 && std::isfinite(value.extinction));
    for (int c = 0; c < 3; ++c) CURVISPLAT_CHECK(value.colour[c] >= -1e-6 && value.colour[c] <= 1 + 1e-6);
  }
}

// ParaView's colour maps. What is read is written and read again as the same, and gives colours and
// extinctions everywhere.
void fuzzTransferFunction(std::span<const std::byte> bytes) {
  const TransferFunctionDefinition definition = parseParaViewPreset(std::string(textOf(bytes)), "a.json");
  const std::string text = toParaViewPreset(definition);
  CURVISPLAT_CHECK(toParaViewPreset(parseParaViewPreset(text, "again.json")) == text);
  const std::pair<double, double> range(0.5, 2);
  checkValues(TransferFunction(definition, &range, 0.1));
  const TransferFunction as_it_is(definition, nullptr, 0.1);
  checkValues(as_it_is);
  if (bytes.size() % 16 == 0) {  // which takes long
    const ClassificationTable table = ClassificationTable::of(as_it_is, -1, 2);
    for (const double centre : {-1.0, 0.3, 5.0})
      for (int c = 0; c < 4; ++c) CURVISPLAT_CHECK(std::isfinite(table.mean(centre, 0.1)[c]));
  }
}

const RegisteredFuzzTarget transfer_function_target("transfer_function", fuzzTransferFunction);

// Camera paths and films: the cameras and functions on them. What is written is read again as the same.
void fuzzCameraPath(std::span<const std::byte> bytes) {
  const Film film = Film::fromFile(fuzzFile("path.json", bytes));
  const std::string text = film.toJson();
  CURVISPLAT_CHECK(Film::fromFile(fuzzFile("again.json", std::as_bytes(std::span(text)))).toJson() == text);
  const CameraPath& path = film.cameras();
  for (int n = -1; n <= 9; ++n) {
    const double time = path.begin() + n / 8.0 * (path.end() - path.begin());
    const Camera camera = path.at(time);
    if (const auto function = film.lookAt(time).function)
      checkValues(TransferFunction(*function, nullptr, function->opacity_unit));
    const glm::dmat4 view = camera.viewFromWorld();
    for (int column = 0; column < 4; ++column)
      for (int row = 0; row < 4; ++row) CURVISPLAT_CHECK(std::isfinite(view[column][row]));
    CURVISPLAT_CHECK(camera.projection == Projection::kPerspective
                         ? camera.view_angle_deg > 0 && camera.view_angle_deg < 180
                         : camera.parallel_scale > 0);
  }
}

const RegisteredFuzzTarget camera_path_target("camera_path", fuzzCameraPath);

// Pictures: PFM is read here; PNG and EXR by libraries, with checks of ours before them.
void fuzzImage(std::span<const std::byte> bytes) {
  const Image image = readImage(fuzzFile("picture", bytes));
  CURVISPLAT_CHECK_OP(image.rgba.size(), ==, 4 * image.size.pixels());
}

const RegisteredFuzzTarget image_target("image", fuzzImage);

// Surfaces: a byte that chooses the file's extension, and the file. What is read has normals and valid corners.
void fuzzMesh(std::span<const std::byte> bytes) {
  constexpr const char* kNames[] = {"a.stl", "a.ply", "a.obj", "a"};
  FuzzInput input(bytes);
  const char* const name = kNames[input.take<uint8_t>() % 4];
  const TriangleMesh mesh = meshOf(parseMesh(input.rest(), name));
  CURVISPLAT_CHECK_OP(mesh.normals.size(), ==, mesh.positions.size());
  for (const auto& triangle : mesh.triangles)
    for (const uint32_t corner : triangle) CURVISPLAT_CHECK_OP(corner, <, mesh.positions.size());
  for (const glm::vec3& normal : mesh.normals)
    for (int axis = 0; axis < 3; ++axis) CURVISPLAT_CHECK(std::abs(normal[axis]) <= 1.0001f);
}

const RegisteredFuzzTarget mesh_target("mesh", fuzzMesh);

// Lines and points of a picture as text with columns, GeoJSON or a shapefile. The first byte: a globe (1), the scalar p (2),
// GeoJSON (4), a shapefile (8).
void fuzzCurveText(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  const auto choice = input.take<uint8_t>();
  const std::string text(textOf(input.rest()));
  const Globe globe;
  const CurveSet set = (choice & 4) != 0 ? parseGeoJson(text, "a.geojson", globe, {})
                       : (choice & 8) != 0
                           ? parseShapefile(text, "a.shp", globe, {})
                           : parseCurveText(text, "a.csv", (choice & 2) != 0 ? "p" : "",
                                            (choice & 1) != 0 ? std::optional(globe) : std::nullopt);
  CURVISPLAT_CHECK_OP(set.begins.back(), ==, set.positions.size());
  CURVISPLAT_CHECK(std::ranges::is_sorted(set.begins));
  CURVISPLAT_CHECK(set.values.empty() || set.values.size() == set.positions.size());
  CURVISPLAT_CHECK(set.times.empty() || set.times.size() == set.positions.size());
  if (!set.times.empty()) partBetween(set, 1, 2);
  for (const glm::vec3& point : set.positions)
    CURVISPLAT_CHECK(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z));
}

const RegisteredFuzzTarget curve_text_target("curve_text", fuzzCurveText);

}  // namespace
}  // namespace curvisplat
