// Surfaces and slices in the volume, against the ray march of the same: splats that meet a surface are cut
// there, and without that a picture is worse. Surfaces may be translucent, and the opacity of slices the
// transfer function's.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/mesh/curve_set.h"
#include "render/project/screen_view.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSurfacePicture{256, 256};
const glm::vec3 kGrey{0.6f, 0.7f, 0.8f};
// A plane across the half-annulus, obliquely.
const ClipPlane kPlane{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}};
const glm::dvec3 kCentre{-0.6, 0.1, 0.55};
constexpr double kRadius = 0.35;

std::shared_ptr<SurfaceScene> surfaceOf(RawMesh raw) {
  auto scene = std::make_shared<SurfaceScene>();
  scene->surfaces.push_back({std::make_shared<TriangleMesh>(meshOf(std::move(raw))), kGrey});
  return scene;
}

/// A square that is larger than the picture.
std::shared_ptr<SurfaceScene> planeScene(const ClipPlane& plane) {
  const glm::dvec3 n = glm::normalize(plane.normal);
  const glm::dvec3 u = 8.0 * glm::normalize(glm::cross(n, {0.3, 0.4, 0.8})), v = glm::cross(n, u);
  return surfaceOf({{plane.point - u - v, plane.point + u - v, plane.point + u + v, plane.point - u + v},
                    {{0, 1, 2}, {0, 2, 3}}});
}

std::shared_ptr<SurfaceScene> sphereScene() {
  constexpr uint32_t kAround = 256, kUp = 128;
  RawMesh raw;
  for (uint32_t j = 0; j <= kUp; ++j)
    for (uint32_t i = 0; i < kAround; ++i) {
      const double theta = std::numbers::pi * j / kUp, phi = 2 * std::numbers::pi * i / kAround;
      raw.positions.push_back(kCentre + kRadius * glm::dvec3(std::sin(theta) * std::cos(phi),
                                                             std::sin(theta) * std::sin(phi),
                                                             std::cos(theta)));
    }
  for (uint32_t j = 0; j < kUp; ++j)
    for (uint32_t i = 0; i < kAround; ++i) {
      const uint32_t a = j * kAround + i, b = j * kAround + (i + 1) % kAround;
      raw.triangles.push_back({a, b, b + kAround});
      raw.triangles.push_back({a, b + kAround, a + kAround});
    }
  return surfaceOf(std::move(raw));
}

class Surfaces : public testing::Test {
 protected:
  /// The mean of `rays` x `rays` rays a pixel; or one ray for one pixel of `every` along x and y.
  Image marched(const KnownFunction& function, const ReferenceLayers& layers, int rays = 1,
                int every = 1) const {
    const ImageSize size{rays * kSurfacePicture.width, rays * kSurfacePicture.height};
    MarchSteps steps = stepsFor(field_);
    steps.every = every;
    const Image image =
        toImage(referenceMarch(field_, function.exact, camera_, size, steps, {nullptr, layers}));
    if (rays == 1) return image;
    Image mean(kSurfacePicture);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        for (int c = 0; c < 4; ++c)
          mean.pixel(x / rays, y / rays)[c] += image.pixel(x, y)[c] / static_cast<float>(rays * rays);
    return mean;
  }

  static double voxelOf(double pixels) {
    return pixels * 2 * halfAnnulusCamera().parallel_scale / kSurfacePicture.height;
  }

  /// Least decibels at the finest level, 4 and 8 pixels; dropping splats by their centres must miss each.
  void expectWorth(const std::string& name, const std::string& function_name, const ReferenceLayers& layers,
                   const std::shared_ptr<SurfaceScene>& scene, const std::array<double, 3>& least_db,
                   int rays = 1) const {
    const KnownFunction function = KnownFunction::of(function_name);
    const Image reference = marched(function, layers, rays, rays == 1 && !faults::isWholeSweep() ? 2 : 1);
    for (size_t level = 0; level < 3; ++level) {
      if (level == 1 && !faults::isWholeSweep()) continue;
      DirectOptions options;
      options.scene = scene;
      options.voxel = std::array{0.0, voxelOf(4), voxelOf(8)}[level];
      const auto db = [&] {
        return compareWithReference(
                   drawDirectly(source_, 0, options, function.table, camera_, kSurfacePicture), reference)
            .psnr_db;
      };
      const double cut = db();
      options.cut_splats = false;
      const double by_centre = db();
      fmt::print("{}, {}, level {}: {:.1f} dB, by centres {:.1f} dB\n", name, function_name, level, cut,
                 by_centre);
      EXPECT_GE(cut, least_db[level]) << name << ", " << function_name << ", level " << level;
      EXPECT_LT(by_centre, least_db[level]) << name << ", " << function_name << ", level " << level;
    }
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
  const SceneGridSource source_{annulus_, {64, 32, 32}, 4};
  Camera camera_ = halfAnnulusCamera();
};

TEST_F(Surfaces, APlaneCutsTheSplats) {
  const auto scene = planeScene(kPlane);
  const auto layers = planeLayer(kPlane.point, kPlane.normal, glm::dvec3(kGrey));
  expectWorth("plane", "smooth", layers, scene, {70, 57, 51});
  if (!faults::isWholeSweep()) return;
  expectWorth("plane", "band", layers, scene, {57, 51, 43.5});
  expectWorth("plane", "step", layers, scene, {52, 48, 39});
}

TEST_F(Surfaces, ASphereIsLitAndCutsTheSplats) {
  const auto scene = sphereScene();
  const auto layers = sphereLayer(kCentre, kRadius, glm::dvec3(kGrey));
  expectWorth("sphere", "smooth", layers, scene, {48.5, 46, 44}, 2);
}

/// A line.
std::shared_ptr<SurfaceScene> curveScene(const std::vector<glm::dvec3>& points, double width) {
  auto scene = std::make_shared<SurfaceScene>();
  Curves& one = scene->curves.emplace_back();
  one.set = std::make_shared<CurveSet>(curveSetOf(points, {0, static_cast<uint32_t>(points.size())}, {}));
  one.width = width;
  one.in_pixels = false;
  one.colour = kGrey;
  return scene;
}

/// The nearer side of an endless cylinder, as planeLayer() lights it.
ReferenceLayers cylinderLayer(const glm::dvec3& point, const glm::dvec3& axis, double radius) {
  return [=, along = glm::normalize(axis)](const glm::dvec3& origin,
                                           const glm::dvec3& direction) -> std::vector<ReferenceLayer> {
    const auto across = [&](const glm::dvec3& v) { return v - glm::dot(v, along) * along; };
    const glm::dvec3 d = across(direction), o = across(origin - point);
    const double a = glm::dot(d, d), b = glm::dot(d, o), c = glm::dot(o, o) - radius * radius;
    if (!(b * b > a * c)) return {};
    const double distance = (-b - std::sqrt(b * b - a * c)) / a;
    const glm::dvec3 normal = (o + distance * d) / radius;
    return planeLayer(origin + distance * direction, normal, glm::dvec3(kGrey))(origin, direction);
  };
}

TEST_F(Surfaces, APointIsALitSphereAndALineATube) {
  if (faults::isWholeSweep()) {  // otherwise the sphere above and the line below
    const auto sphere = curveScene({kCentre}, 2 * kRadius);
    expectWorth("point", "smooth", sphereLayer(kCentre, kRadius, glm::dvec3(kGrey)), sphere, {46, 45.5, 44.5},
                2);
  }
  const glm::dvec3 axis(3, -2, 2.4);
  std::vector<glm::dvec3> points;
  for (int n = 0; n <= 20; ++n) points.push_back(kCentre + (n - 10) / 10.0 * axis);
  const auto tube = curveScene(points, 0.2);
  if (faults::isWholeSweep())
    expectWorth("line", "smooth", cylinderLayer(kCentre, axis, 0.1), tube, {43.5, 43, 42.5}, 2);
  // A translucent one has its nearer side alone, and no joints.
  tube->curves[0].opacity = 0.5;
  const ReferenceLayers half = [opaque = cylinderLayer(kCentre, axis, 0.1)](const glm::dvec3& origin,
                                                                            const glm::dvec3& direction) {
    std::vector<ReferenceLayer> layers = opaque(origin, direction);
    for (ReferenceLayer& layer : layers) layer.opacity = 0.5;
    return layers;
  };
  expectWorth("translucent line", "smooth", half, tube, {49, 48.5, 48}, 2);
}

/// The root of the mean squared difference of pixels around which the slice goes on for `margin` pixels.
double rmsInside(const Image& picture, const Image& reference, const ReferenceLayers& slice,
                 const Camera& camera, int margin) {
  const ImageSize size = picture.size;
  std::vector<uint8_t> there(size.pixels());
  const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.view_up)),
                   up = glm::cross(right, forward);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const double unit = camera.parallel_scale / size.height;
      const glm::dvec3 origin =
          camera.position + unit * (static_cast<double>(2 * x + 1 - size.width) * right +
                                    static_cast<double>(size.height - 2 * y - 1) * up);
      there[static_cast<size_t>(y * size.width + x)] = !slice(origin, forward).empty();
    }
  double sum = 0;
  int count = 0;
  for (int y = margin; y < size.height - margin; ++y)
    for (int x = margin; x < size.width - margin; ++x) {
      bool inside = true;
      for (int v = -margin; v <= margin; ++v)
        for (int u = -margin; u <= margin; ++u)
          inside = inside && there[static_cast<size_t>((y + v) * size.width + x + u)];
      if (!inside) continue;
      for (int c = 0; c < 3; ++c)
        sum += std::pow(double{picture.pixel(x, y)[c]} - double{reference.pixel(x, y)[c]}, 2) / 3;
      ++count;
    }
  EXPECT_GT(count, 1000);
  return std::sqrt(sum / count);
}

TEST_F(Surfaces, SlicesHaveTheScalarsColours) {
  // Whose red is the scalar, as are green and blue.
  const OpticalFunction exact = [](double f) { return OpticalProperties{glm::dvec3(f), 0}; };
  TransferFunctionDefinition grey = presetDefinition("grey");
  grey.colour_space = ColourSpace::kRgb;
  grey.colours = {{0, {0, 0, 0}}, {1, {1, 1, 1}}};
  const std::pair<double, double> range(0, 1);
  const TransferFunction function(grey, &range, 1);
  const auto slice = sliceLayer(field_, exact, kPlane.point, kPlane.normal);
  const Image reference =
      toImage(referenceMarch(field_, exact, camera_, kSurfacePicture, stepsFor(field_), {nullptr, slice}));
  const auto scene = std::make_shared<SurfaceScene>();
  scene->slices = {kPlane};
  scene->volume = false;
  const struct {
    double pixels, least_db;  // of the root of the mean squared difference inside, in the scalar's range
    int margin;
  } levels[] = {{0, 69.1, 1}, {4, 57.7, 4}, {8, 46.9, 8}};
  for (const auto& level : levels) {
    if (level.pixels == 4 && !faults::isWholeSweep()) continue;
    DirectOptions options;
    options.scene = scene;
    options.voxel = voxelOf(level.pixels);
    const SceneGridSource source(annulus_, {128, 64, 64}, 4);
    const auto db = [&] {
      const Image picture = drawDirectly(source, 0, options, function, camera_, kSurfacePicture);
      return -20 * std::log10(rmsInside(picture, reference, slice, camera_, level.margin));
    };
    const double all = db();
    EXPECT_GE(all, level.least_db) << level.pixels;
    options.slices.common_gradient = false;
    if (level.pixels > 0) {
      const double own = db();
      fmt::print("slice, {} pixels: by own gradients {:.1f} dB\n", level.pixels, own);
      EXPECT_LT(own, level.least_db) << level.pixels;
    }
    options.slices.slopes = false;
    const double means = db();
    fmt::print("slice, {} pixels: {:.1f} dB, by means {:.1f} dB\n", level.pixels, all, means);
    EXPECT_LT(means, level.least_db) << level.pixels;
  }
}

TEST_F(Surfaces, IsosurfacesAreOfOneField) {
  constexpr double kValue = 0.5;
  const KnownFunction function = KnownFunction::of("smooth");
  const OpticalFunction nothing = [](double) { return OpticalProperties{}; };
  const auto layer = isoLayer(*annulus_, kValue, function.table.at(kValue).colour);
  const Image reference = marched({nothing, function.table}, layer, 2);
  const auto scene = std::make_shared<SurfaceScene>();
  scene->isovalues = {kValue};
  scene->volume = false;
  const SceneGridSource source(annulus_, {128, 64, 64}, 4);
  // What a correction is worth, at the coarsest level above all.
  const struct {
    double pixels, least_db, least_gain;
  } levels[] = {{0, 39, -0.2}, {4, 39, -0.2}, {8, 37, 0.5}};
  for (const auto& level : levels) {
    if (level.pixels == 4 && !faults::isWholeSweep()) continue;
    const auto db = [&](const IsoCorrections& corrections) {
      DirectOptions options;
      options.scene = scene;
      options.voxel = voxelOf(level.pixels);
      options.isosurfaces = corrections;
      return compareImages(drawDirectly(source, 0, options, function.table, camera_, kSurfacePicture),
                           reference)
          .psnr_db;
    };
    const double all = db({});
    EXPECT_GE(all, level.least_db) << level.pixels;
    if (level.least_gain < 0 && !faults::isWholeSweep()) continue;
    const double own = db({.common_field = false}), unended = db({.ended = false}),
                 rough = db({.smooth = false});
    fmt::print(
        "isosurface, {} pixels: {:.1f} dB; by own fields {:.1f}, without ends {:.1f}, with one ray {:.1f} "
        "dB\n",
        level.pixels, all, own, unended, rough);
    for (const double without : {own, unended, rough})
      EXPECT_GE(all, without + level.least_gain) << level.pixels;
  }
}

TEST_F(Surfaces, TranslucentSlicesLieInTheVolume) {
  const KnownFunction function = KnownFunction::of("smooth");
  const auto scene = std::make_shared<SurfaceScene>();
  scene->slices = {kPlane};
  scene->slice_opacity = 0.5;
  const auto slice = sliceLayer(field_, function.exact, kPlane.point, kPlane.normal, 0.5);
  const Image reference = marched(function, slice);
  DirectOptions options;
  options.scene = scene;
  const Image picture = drawDirectly(source_, 0, options, function.table, camera_, kSurfacePicture);
  EXPECT_LT(rmsInside(picture, reference, slice, camera_, 1), 1.5e-3);
}

constexpr ImageSize kSheetSize{160, 160};
// Sheets across the half-annulus, obliquely; one behind the other.
const glm::dvec3 kNormal{0.6, 0.5, -0.7};
const glm::dvec3 kPoints[] = {{-0.4, 0, 0.5}, {-0.55, -0.1, 0.7}, {-0.3, 0.1, 0.3}};

/// Squares that are larger than the picture, in one mesh.
std::shared_ptr<SurfaceScene> squares(float opacity) {
  RawMesh raw;
  const glm::dvec3 n = glm::normalize(kNormal), u = 8.0 * glm::normalize(glm::cross(n, {0.3, 0.4, 0.8})),
                   v = glm::cross(n, u);
  for (const glm::dvec3& p : kPoints) {
    const auto first = static_cast<uint32_t>(raw.positions.size());
    raw.positions.insert(raw.positions.end(), {p - u - v, p + u - v, p + u + v, p - u + v});
    raw.triangles.insert(raw.triangles.end(), {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  }
  auto scene = std::make_shared<SurfaceScene>();
  Surface& surface = scene->surfaces.emplace_back();
  surface.mesh = std::make_shared<TriangleMesh>(meshOf(std::move(raw)));
  surface.colour = kGrey;
  surface.opacity.factor = double{opacity};
  return scene;
}

class Sheets : public testing::Test {
 protected:
  Image marched(const KnownFunction& function, const ReferenceLayers& layers) const {
    return toImage(
        referenceMarch(field_, function.exact, camera_, kSheetSize, stepsFor(field_), {nullptr, layers}));
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
  const SceneGridSource source_{annulus_, {64, 32, 32}, 4};
  const Camera camera_ = halfAnnulusCamera();
};

TEST_F(Sheets, WhatLiesBehindATranslucentSurfaceIsSeenThroughIt) {
  const KnownFunction function = KnownFunction::of("smooth");
  for (const float opacity : {0.4f, 1.0f}) {
    const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
      std::vector<ReferenceLayer> found;
      const double facing = std::abs(glm::dot(glm::normalize(kNormal), direction));
      const glm::dvec3 lit = (0.3 + 0.7 * facing) * glm::dvec3(kGrey);
      for (const glm::dvec3& p : kPoints)
        found.push_back({glm::dot(kNormal, p - origin) / glm::dot(kNormal, direction), lit, double{opacity}});
      std::sort(found.begin(), found.end(),
                [](const auto& a, const auto& b) { return a.distance < b.distance; });
      return found;
    };
    DirectOptions options;
    options.scene = squares(opacity);
    const double db = compareImages(drawDirectly(source_, 0, options, function.table, camera_, kSheetSize),
                                    marched(function, layers))
                          .psnr_db;
    fmt::print("three squares of opacity {}: {:.1f} dB\n", opacity, db);
    EXPECT_GE(db, 60);
  }
}

TEST_F(Sheets, ASliceHasTheOpacityOfTheFunction) {
  for (const char* name : {"smooth", "band"}) {
    const KnownFunction function = KnownFunction::of(name);
    const double unit = function.table.opacityUnit();
    const glm::dvec3 p = kPoints[0];
    const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
      const double distance = glm::dot(kNormal, p - origin) / glm::dot(kNormal, direction);
      const glm::dvec3 at = origin + distance * direction;
      std::vector<ReferenceLayer> found;
      if (!annulus_->contains(at)) return found;
      const OpticalProperties value = function.exact(annulus_->scalar(at));
      found.push_back({distance, value.colour, 0.8 * -std::expm1(-value.extinction * unit)});
      return found;
    };
    const Image reference = marched(function, layers);
    DirectOptions options;
    auto scene = std::make_shared<SurfaceScene>();
    scene->slices = {{p, kNormal}};
    scene->slice_opacity = 0.8;
    options.scene = scene;
    const auto db = [&] {
      return compareImages(drawDirectly(source_, 0, options, function.table, camera_, kSheetSize), reference)
          .psnr_db;
    };
    const double even = db();
    scene->slices_by_function = true;
    const double by_function = db();
    fmt::print("slice with the opacity of {}: {:.1f} dB, evenly {:.1f} dB\n", name, by_function, even);
    EXPECT_GE(by_function, 46) << name;  // outlines of the slice are smooth here
    EXPECT_LT(even, 40) << name;
  }
}

}  // namespace
}  // namespace curvisplat
