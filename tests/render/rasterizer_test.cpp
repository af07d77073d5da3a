// Triangles at the samples of pixels, against a slow twin that asks every triangle at every sample.
#include "render/surface/rasterizer.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "render/mesh/curve_set.h"
#include "render/surface/scene_layers.h"
#include "stream/base/progress.h"

namespace curvisplat {
namespace {

// Neither side is a multiple of a tile's.
constexpr ImageSize kUnevenPicture{300, 70};

Camera cameraOf(Projection projection) {
  Camera camera;
  camera.position = {0, 0, 5};
  camera.projection = projection;
  camera.parallel_scale = 1;
  camera.view_angle_deg = 24;
  return camera;
}

/// Triangles of sizes from a hundredth of a pixel to many times the picture, some out of it, some without an area.
SurfaceScene randomScene(double deepest) {
  std::mt19937 random(7);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967295.0;
  };
  SurfaceScene scene;
  for (int surface = 0; surface < 2; ++surface) {
    auto mesh = std::make_shared<TriangleMesh>();
    for (uint32_t n = 0; n < 1500; ++n) {
      const double size = std::pow(10, between(-3, n % 200 == 0 ? 1.5 : -0.5));
      const glm::vec3 at(between(-4.5, 4.5), between(-1.2, 1.2), between(-1, deepest));
      for (int corner = 0; corner < 3; ++corner)
        mesh->positions.push_back(
            at + glm::vec3(between(-size, size), between(-size, size), between(-size, size)));
      if (n % 50 == 0) mesh->positions.back() = at;
      mesh->triangles.push_back({3 * n, 3 * n + 1, 3 * n + 2});
    }
    mesh->normals.assign(mesh->positions.size(), {0, 0, 1});
    scene.surfaces.push_back({mesh});
  }
  return scene;
}

/// Whether a triangle covers a sample, in the exact arithmetic of whole numbers.
bool covers(const std::array<ScreenVertex, 3>& v, int64_t x, int64_t y) {
  int64_t gx[3], gy[3];
  for (size_t n = 0; n < 3; ++n)
    gx[n] = std::llrint(double{v[n].x} * 16), gy[n] = std::llrint(double{v[n].y} * 16);
  const int64_t area = (gx[1] - gx[0]) * (gy[2] - gy[0]) - (gy[1] - gy[0]) * (gx[2] - gx[0]);
  if (area == 0) return false;
  for (size_t n = 0; n < 3; ++n) {
    const size_t m = (n + 1) % 3;
    const int64_t sign = area < 0 ? -1 : 1, a = -sign * (gy[m] - gy[n]), b = sign * (gx[m] - gx[n]);
    const int64_t at = a * (x - gx[n]) + b * (y - gy[n]);
    if (at < 0 || (at == 0 && !(a > 0 || (a == 0 && b > 0)))) return false;
  }
  return true;
}

double valueAt(const std::array<ScreenVertex, 3>& v, double x, double y) {
  const auto cross = [](double ax, double ay, double bx, double by) { return ax * by - ay * bx; };
  const double dx1 = double{v[1].x} - double{v[0].x}, dy1 = double{v[1].y} - double{v[0].y};
  const double dx2 = double{v[2].x} - double{v[0].x}, dy2 = double{v[2].y} - double{v[0].y};
  const double px = x - double{v[0].x}, py = y - double{v[0].y};
  const double area = cross(dx1, dy1, dx2, dy2);
  return double{v[0].value} + cross(px, py, dx2, dy2) / area * (double{v[1].value} - double{v[0].value}) +
         cross(dx1, dy1, px, py) / area * (double{v[2].value} - double{v[0].value});
}

/// The parts behind the near plane, as the rasterizer has them.
std::vector<std::array<ScreenVertex, 3>> partsOf(const SceneTriangles& triangles, size_t surface,
                                                 uint32_t n) {
  const auto& corners = triangles.scene().surfaces[surface].mesh->triangles[n];
  const std::array<ScreenVertex, 3> at{triangles.vertex(surface, corners[0]),
                                       triangles.vertex(surface, corners[1]),
                                       triangles.vertex(surface, corners[2])};
  if (!std::isnan(at[0].value + at[1].value + at[2].value)) return {at};
  const NearPolygon polygon = triangles.behindNear(surface, corners);
  std::vector<std::array<ScreenVertex, 3>> parts;
  for (size_t v = 2; v < polygon.count; ++v)
    parts.push_back({polygon.vertices[0], polygon.vertices[v - 1], polygon.vertices[v]});
  return parts;
}

class Rasterizer : public testing::TestWithParam<Projection> {};

TEST_P(Rasterizer, SeesWhatIsNearestAtEverySample) {
  const SurfaceScene scene = randomScene(GetParam() == Projection::kPerspective ? 5.5 : 3);
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const SceneTriangles triangles(scene, view, 0);
  const TriangleBins bins(triangles);
  size_t nothing = 0, compared = 0;
  SampleTile tile;
  for (int row = 0; row < bins.rows(); ++row)
    for (int column = 0; column < bins.columns(); ++column) {
      const bool any = tile.draw(triangles, bins, column, row);
      struct Truth {
        double value = INFINITY;
        bool near_other = false;  // another lies so near that rounding decides
        uint32_t number = PixelSamples::kNothing;
      };
      const auto width = static_cast<size_t>(tile.x1() - tile.x0() + 1);
      std::vector<Truth> truth(kSamples * width * static_cast<size_t>(tile.y1() - tile.y0() + 1));
      for (uint32_t number = 0; number < triangles.count(); ++number) {
        const auto [surface, n] = triangles.placeOf(number);
        for (const auto& part : partsOf(triangles, surface, n)) {
          const auto [left, right] = std::minmax({part[0].x, part[1].x, part[2].x});
          const auto [top, bottom] = std::minmax({part[0].y, part[1].y, part[2].y});
          const auto within = [](float at, int low, int high) {
            return static_cast<int>(std::clamp(at, static_cast<float>(low), static_cast<float>(high)));
          };
          if (right < static_cast<float>(tile.x0() - 1) || bottom < static_cast<float>(tile.y0() - 1))
            continue;
          for (int y = within(top - 1, tile.y0(), tile.y1() + 1); y <= within(bottom + 1, 0, tile.y1()); ++y)
            for (int x = within(left - 1, tile.x0(), tile.x1() + 1); x <= within(right + 1, 0, tile.x1());
                 ++x)
              for (size_t s = 0; s < kSamples; ++s) {
                const int sx = 16 * x + 8 + kSampleOffsets[s][0], sy = 16 * y + 8 + kSampleOffsets[s][1];
                if (!covers(part, sx, sy)) continue;
                const auto [least, most] = std::minmax({part[0].value, part[1].value, part[2].value});
                const double value =
                    std::clamp(valueAt(part, sx / 16.0, sy / 16.0), double{least}, double{most});
                Truth& at = truth[kSamples * (static_cast<size_t>(y - tile.y0()) * width +
                                              static_cast<size_t>(x - tile.x0())) +
                                  s];
                const double tolerance = 2e-4 * std::max(1.0, double{most} - double{least});
                at.near_other = std::abs(value - at.value) < tolerance || (at.near_other && value > at.value);
                if (value < at.value) at.value = value, at.number = number;
              }
        }
      }
      size_t wrong = 0;
      for (int y = tile.y0(); y <= tile.y1(); ++y)
        for (int x = tile.x0(); x <= tile.x1(); ++x)
          for (size_t s = 0; s < kSamples; ++s) {
            const Truth& at = truth[kSamples * (static_cast<size_t>(y - tile.y0()) * width +
                                                static_cast<size_t>(x - tile.x0())) +
                                    s];
            const uint32_t seen = any ? tile.at(x, y).numbers[s] : PixelSamples::kNothing;
            nothing += seen == PixelSamples::kNothing;
            if (at.near_other) continue;
            ++compared;
            wrong += seen != at.number;
          }
      EXPECT_EQ(wrong, 0u) << "tile " << column << ", " << row;
    }
  EXPECT_GT(nothing, 1000u);
  EXPECT_GT(compared, kSamples * kUnevenPicture.pixels() / 2);
}

/// A line of the points.
Curves lineOf(const std::vector<glm::dvec3>& points, double width) {
  Curves curves;
  curves.set = std::make_shared<CurveSet>(curveSetOf(points, {0, static_cast<uint32_t>(points.size())}, {}));
  curves.width = width;
  curves.in_pixels = false;
  return curves;
}

/// Segments and points of many sizes, one a curve.
SurfaceScene randomCurves(int count) {
  std::mt19937 random(3);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967295.0;
  };
  SurfaceScene scene;
  for (int n = 0; n < count; ++n) {
    const double size = n % 5 == 0 ? 0 : std::pow(10, between(-2, 0.5));
    const glm::dvec3 at(between(-4.5, 4.5), between(-1.2, 1.2), between(-1, 3));
    const glm::dvec3 way(between(-size, size), between(-size, size), between(-0.3 * size, 0.3 * size));
    scene.curves.push_back(
        lineOf(size > 0 ? std::vector{at, at + way} : std::vector{at}, std::pow(10, between(-1.5, -0.3))));
  }
  return scene;
}

/// How far a point lies from a segment.
double distanceTo(const std::vector<glm::vec3>& ends, const glm::dvec3& origin, const glm::dvec3& point) {
  const glm::dvec3 a = origin + glm::dvec3(ends.front()), way = origin + glm::dvec3(ends.back()) - a;
  const double length2 = glm::dot(way, way);
  const double part = length2 > 0 ? std::clamp(glm::dot(point - a, way) / length2, 0.0, 1.0) : 0;
  return glm::length(point - a - part * way);
}

TEST_P(Rasterizer, TheLayersAreTheSameForAnyThreads) {
  SurfaceScene scene = randomScene(GetParam() == Projection::kPerspective ? 5.5 : 3);
  scene.curves = randomCurves(20).curves;
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const SceneLook look{colours, {}, {}, 0};
  const auto drawn = [&](int threads) {
    tbb::task_arena arena(threads);
    return arena.execute([&] { return layersOf(scene, view, {}, look); });
  };
  const PixelLayers one = drawn(1), two = drawn(2);
  size_t layers = 0;
  for (int y = 0; y < kUnevenPicture.height; ++y)
    for (int x = 0; x < kUnevenPicture.width; ++x) {
      const auto a = one.at(x, y), b = two.at(x, y);
      ASSERT_EQ(a.size(), b.size());
      layers += a.size();
      for (size_t n = 0; n < a.size(); ++n) {
        ASSERT_EQ(a[n].depth, b[n].depth);
        ASSERT_EQ(a[n].colour, b[n].colour);
      }
    }
  EXPECT_GT(layers, 1000u);
}

TEST_P(Rasterizer, SeesCapsulesWhereRaysThatStepByDistanceMeetThem) {
  constexpr ImageSize kSmall{150, 40};
  const SurfaceScene scene = randomCurves(60);
  const ScreenView view = ScreenView::of(cameraOf(GetParam()), kSmall, glm::dvec3(1.0), kLowPass, 0.1);
  const bool perspective = GetParam() == Projection::kPerspective;
  const SceneTriangles triangles(scene, view, 0);
  const TriangleBins bins(triangles);
  size_t seen = 0, wrong = 0;
  SampleTile tile;
  for (int row = 0; row < bins.rows(); ++row)
    for (int column = 0; column < bins.columns(); ++column) {
      ASSERT_TRUE(tile.draw(triangles, bins, column, row));
      for (int y = tile.y0(); y <= tile.y1(); ++y)
        for (int x = tile.x0(); x <= tile.x1(); ++x)
          for (size_t s = 0; s < kSamples; ++s) {
            const double across =
                (x + 0.5 + kSampleOffsets[s][0] / 16.0 - 0.5 * kSmall.width) / view.focal_px;
            const double down = (y + 0.5 + kSampleOffsets[s][1] / 16.0 - 0.5 * kSmall.height) / view.focal_px;
            const glm::dvec3 aside = across * view.right + down * view.down;
            const glm::dvec3 start = view.eye + (perspective ? glm::dvec3(0.0) : aside);
            const glm::dvec3 step = view.forward + (perspective ? aside : glm::dvec3(0.0));
            double nearest = INFINITY;
            for (const Curves& curves : scene.curves) {
              double t = 0.1, away = INFINITY;
              for (int n = 0; n < 200 && t < std::min(nearest, 8.0) && away > 1e-7; ++n) {
                away = distanceTo(curves.set->positions, curves.set->origin, start + t * step) -
                       0.5 * curves.width;
                t += std::max(away, 0.0) / glm::length(step);
              }
              if (away < 1e-5) nearest = std::min(nearest, t);
            }
            const double value = double{tile.at(x, y).values[s]}, depth = perspective ? -1 / value : value;
            seen += nearest < INFINITY;
            const bool any = tile.at(x, y).numbers[s] != PixelSamples::kNothing;
            wrong += any != (nearest < INFINITY) || (any && std::abs(depth - nearest) > 2e-3);
          }
    }
  EXPECT_GT(seen, 4'000u);
  EXPECT_LT(wrong, seen / 500);  // at outlines rounding decides
}

TEST_P(Rasterizer, TheOrderOfCapsulesDoesNotMatter) {
  SurfaceScene scene = randomCurves(3000), reversed = scene;
  std::reverse(reversed.curves.begin(), reversed.curves.end());
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const SceneTriangles triangles(scene, view, 0), others(reversed, view, 0);
  const TriangleBins bins(triangles), other_bins(others);
  SampleTile tile, other;
  for (int row = 0; row < bins.rows(); ++row)
    for (int column = 0; column < bins.columns(); ++column) {
      ASSERT_TRUE(tile.draw(triangles, bins, column, row));
      ASSERT_TRUE(other.draw(others, other_bins, column, row));
      for (int y = tile.y0(); y <= tile.y1(); ++y)
        for (int x = tile.x0(); x <= tile.x1(); ++x)
          ASSERT_EQ(tile.at(x, y).values, other.at(x, y).values) << x << ", " << y;
    }
}

TEST(CapsuleQueueOrder, BeginsWithTheNearestAndKeepsAll) {
  std::mt19937 random(5);
  CapsuleQueue queue;
  constexpr uint32_t kCount = 5000;
  for (uint32_t n = 0; n < kCount; ++n) {
    const auto value = [&] { return static_cast<float>(random()) / 4294967296.0f; };
    queue.add({{{0, 0, value()}, {1, 1, value()}}, n, {n, n}});
  }
  std::vector<bool> seen(kCount, false);
  float before = 0;
  for (const CapsuleQueue::Entry& entry : queue.sorted()) {
    const float nearest = std::min(entry.capsule.a.value, entry.capsule.b.value);
    EXPECT_GE(nearest, before - 0.001f);
    before = std::max(before, nearest);
    EXPECT_FALSE(seen[entry.number]);
    EXPECT_EQ(entry.inside.first, entry.number);
    seen[entry.number] = true;
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), true), kCount);
  // All at the same depth, as in a plane that faces the viewer.
  queue.clear();
  for (uint32_t n = 0; n < 3; ++n) queue.add({{{0, 0, 2}, {1, 1, 2}}, n, {}});
  EXPECT_EQ(queue.sorted().size(), 3U);
}

TEST_P(Rasterizer, ATranslucentTubeIsOneLayer) {
  std::vector<glm::dvec3> arc;
  for (int n = 0; n <= 300; ++n)
    arc.emplace_back(3 * std::cos(0.01 * n), 0.7 * std::sin(0.01 * n), std::cos(0.02 * n));
  SurfaceScene scene;
  scene.curves.push_back(lineOf(arc, 0.2));
  scene.curves.back().opacity = 0.5;
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const PixelLayers layers = layersOf(scene, view, {}, {colours, {}, {}, 0});
  size_t whole = 0, several = 0;
  for (int y = 0; y < kUnevenPicture.height; ++y)
    for (int x = 0; x < kUnevenPicture.width; ++x) {
      const auto at = layers.at(x, y);
      whole += at.size() == 1 && at[0].colour.w == 0.5f;
      several += at.size() > 1;
    }
  EXPECT_GT(whole, 300u);
  EXPECT_LT(several, whole / 50);  // where its end turns away from the viewer
}

TEST_P(Rasterizer, TranslucentPointsNearOneAnotherAreLayersOfTheirOwn) {
  // Six overlapping spheres, one behind the other: five in one set, and one in the next.
  std::vector<glm::dvec3> places;
  for (int n = 1; n < 6; ++n) places.emplace_back(0, 0, 0.15 * n);
  SurfaceScene scene;
  scene.curves.push_back(lineOf(places, 0.4));
  scene.curves[0].set = std::make_shared<CurveSet>(pointsOf(*scene.curves[0].set));
  scene.curves.push_back(lineOf({{0, 0, 0}}, 0.4));
  for (Curves& curves : scene.curves) curves.opacity = 0.25;
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  const PixelLayers layers = layersOf(scene, view, {}, {colours, {}, {}, 0});
  float through = 1;
  for (const PixelLayer& layer : layers.at(kUnevenPicture.width / 2, kUnevenPicture.height / 2))
    through *= 1 - layer.colour.w;
  EXPECT_NEAR(through, std::pow(0.75, 6), 1e-5);
}

/// The first place where a ray from the eye meets a capsule, by steps of its distance; infinite if it does not.
double steppedTo(const CurveSet& set, double radius, const glm::dvec3& eye, const glm::dvec3& step) {
  double t = 0, away = INFINITY;
  for (int n = 0; n < 2000 && t < 20 && away > 1e-7; ++n) {
    away = distanceTo(set.positions, set.origin, eye + t * step) - radius;
    t += std::max(away, 0.0) / glm::length(step);
  }
  return away < 1e-5 ? t : INFINITY;
}

TEST(RasterizerNear, ATubeThroughTheNearPlaneKeepsItsSides) {
  constexpr ImageSize kSmall{40, 24};
  constexpr double kNear = 1;
  Camera camera = cameraOf(Projection::kPerspective);
  camera.view_angle_deg = 70;
  std::mt19937 random(11);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967295.0;
  };
  size_t seen = 0, beside = 0, wrong = 0, wrong_beside = 0;
  for (int n = 0; n < 200; ++n) {
    // From 2 before the eye to 3 behind the near plane, and back.
    const double radius = between(0.2, 0.6);
    const glm::dvec3 before(between(-4, 4), between(-4, 4), 7), behind(between(-2, 2), between(-2, 2), 1);
    SurfaceScene scene;
    scene.curves.push_back(
        lineOf(n % 2 == 0 ? std::vector{before, behind} : std::vector{behind, before}, 2 * radius));
    const ScreenView view = ScreenView::of(camera, kSmall, glm::dvec3(1.0), kLowPass, kNear);
    if (distanceTo(scene.curves[0].set->positions, scene.curves[0].set->origin, view.eye) < 1.05 * radius)
      continue;
    const SceneTriangles triangles(scene, view, 0);
    const TriangleBins bins(triangles);
    SampleTile tile;
    for (int row = 0; row < bins.rows(); ++row) {
      const bool any_of_tile = tile.draw(triangles, bins, 0, row);
      for (int y = row * kSampleTileHeight; y < std::min(kSmall.height, (row + 1) * kSampleTileHeight); ++y)
        for (int x = 0; x < kSmall.width; ++x)
          for (size_t s = 0; s < kSamples; ++s) {
            const double across =
                (x + 0.5 + kSampleOffsets[s][0] / 16.0 - 0.5 * kSmall.width) / view.focal_px;
            const double down = (y + 0.5 + kSampleOffsets[s][1] / 16.0 - 0.5 * kSmall.height) / view.focal_px;
            const glm::dvec3 step = view.forward + across * view.right + down * view.down;
            const double at = steppedTo(*scene.curves[0].set, radius, view.eye, step);
            if (std::abs(at - kNear) < 1e-3) continue;
            const bool expected = at > kNear && at < INFINITY;
            const bool any = any_of_tile && tile.at(x, y).numbers[s] != PixelSamples::kNothing;
            seen += expected;
            const glm::dvec3 a = scene.curves[0].set->origin,
                             b = a + glm::dvec3(scene.curves[0].set->positions.back());
            const double part = glm::dot(view.eye + at * step - a, b - a) / glm::dot(b - a, b - a);
            const bool is_beside =
                expected && glm::dot(glm::mix(a, b, part) - view.eye, view.forward) < kNear;
            const bool is_wrong =
                any != expected || (any && std::abs(-1 / double{tile.at(x, y).values[s]} - at) > 2e-3 * at);
            beside += is_beside;
            wrong += is_wrong;
            wrong_beside += is_beside && is_wrong;
          }
    }
  }
  EXPECT_GT(seen, 10'000u);
  EXPECT_GT(beside, 100u);
  EXPECT_LT(wrong, seen / 500);  // at outlines rounding decides
  EXPECT_LT(wrong_beside, beside / 20);
}

TEST_P(Rasterizer, DrawsThePointsAtWhichALineOrItsValuesTurn) {
  std::vector<glm::dvec3> corner;
  for (int n = 0; n <= 1000; ++n)
    corner.emplace_back(n <= 400 ? -3 + 0.01 * n : 1, n > 400 ? 0.001 * n - 0.4 : 0, 0);
  SurfaceScene scene;
  scene.curves.push_back(lineOf(corner, 0.2));
  CurveSet with_values = *scene.curves[0].set;
  for (int n = 0; n <= 1000; ++n) with_values.values.push_back(static_cast<float>(std::min(n, 200)));
  scene.curves.push_back(scene.curves[0]);
  scene.curves[1].set = std::make_shared<CurveSet>(with_values);
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const SceneTriangles triangles(scene, view, 0);
  const auto pointsOf = [&](size_t curve) {
    std::vector<uint32_t> points;
    for (uint32_t n = 0; n <= 1000; ++n)
      if (triangles.beginOf(curve, n) != SceneTriangles::kNoCapsule) points.push_back(n);
    return points;
  };
  // A few points later lie less than a seventh of a pixel aside, and the values less than 1/256 of their range.
  const std::vector<uint32_t> plain = pointsOf(0), of_values = pointsOf(1);
  ASSERT_EQ(plain.size(), 2u);
  EXPECT_NEAR(plain[0], 400, 5);
  EXPECT_EQ(plain[1], 1000u);
  ASSERT_EQ(of_values.size(), 3u);
  EXPECT_NEAR(of_values[0], 200, 3);
  EXPECT_NEAR(of_values[1], 400, 5);
}

/// Chords of a helix pass all of its points, and values, closely: and they are not many more than those of an arc of that sagitta.
TEST_P(Rasterizer, ChordsPassAllPointsClosely) {
  constexpr int kPoints = 4000;
  constexpr double kRadius = 1, kTurns = 3, kSagitta = 0.15;
  std::vector<glm::dvec3> helix;
  for (int n = 0; n < kPoints; ++n) {
    const double angle = 2 * std::numbers::pi * kTurns * n / (kPoints - 1);
    helix.emplace_back(0.4 * angle / kTurns - 1, kRadius * std::cos(angle), kRadius * std::sin(angle));
  }
  SurfaceScene scene;
  scene.curves.push_back(lineOf(helix, 0.2));
  CurveSet set = *scene.curves[0].set;
  for (int n = 0; n < kPoints; ++n) set.values.push_back(static_cast<float>(std::sin(0.004 * n)));
  scene.curves[0].set = std::make_shared<CurveSet>(set);
  const ScreenView view =
      ScreenView::of(cameraOf(GetParam()), kUnevenPicture, glm::dvec3(1.0), kLowPass, 0.1);
  const SceneTriangles triangles(scene, view, 0);
  const bool perspective = GetParam() == Projection::kPerspective;
  size_t chords = 0;
  for (uint32_t end = 0; end < kPoints; ++end) {
    const uint32_t begin = triangles.beginOf(0, end);
    if (begin == SceneTriangles::kNoCapsule) continue;
    ++chords;
    const glm::dvec3 a = helix[begin], way = helix[end] - a;
    for (uint32_t n = begin; n <= end; ++n) {
      const double part = glm::dot(helix[n] - a, way) / glm::dot(way, way);
      const double pixel = (perspective ? view.viewFromData(helix[n]).z : 1) / view.focal_px;
      ASSERT_LT(glm::length(helix[n] - a - part * way), (kSagitta + (perspective ? 0.05 : 0.02)) * pixel)
          << begin << " " << n;
      ASSERT_NEAR(set.values[n], set.values[begin] + part * (set.values[end] - set.values[begin]), 2.1 / 256);
    }
  }
  const double nearest = perspective ? view.viewFromData({0, 0, 0}).z - kRadius : 1;
  const double radius_px = kRadius * view.focal_px / nearest;
  const double of_arcs = kTurns * std::numbers::pi / std::acos(1 - kSagitta / radius_px);
  EXPECT_GT(chords, 20u);
  EXPECT_LT(static_cast<double>(chords), 1.5 * of_arcs + 10);
}

TEST_P(Rasterizer, StopsWithinATileOfManyTriangles) {
  auto mesh = std::make_shared<TriangleMesh>();  // one triangle 100,000 times, which every tile sees
  mesh->positions = {{-90, -30, 0}, {90, -30, 0}, {0, 90, 0}};
  mesh->normals.assign(3, {0, 0, 1});
  mesh->triangles.assign(100'000, {0, 1, 2});
  SurfaceScene scene;
  scene.surfaces.push_back({mesh});
  const ScreenView view = ScreenView::of(cameraOf(GetParam()), {8, 8}, glm::dvec3(1.0), kLowPass, 0.1);
  const ColourTable colours(TransferFunction::preset("viridis", 0, 1, 1));
  int asked = 0;
  SceneLook look{colours, {}, {}, 0};
  look.throw_if_stopped = [&] {
    if (++asked == 3) throw Interrupted(0, "interrupted");
  };
  tbb::task_arena(1).execute([&] { EXPECT_THROW(layersOf(scene, view, {}, look), Interrupted); });
  EXPECT_EQ(asked, 3);
}

INSTANTIATE_TEST_SUITE_P(, Rasterizer, testing::Values(Projection::kOrthographic, Projection::kPerspective));

}  // namespace
}  // namespace curvisplat
