#include "render/project/projection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/glm.hpp>
#include <random>

#include "render/project/footprint.h"
#include "render/project/tile_key.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// One splat in double precision, and the brick that holds it alone.
struct TestSplat {
  Splat splat;
  SplatScalar scalar;

  void appendTo(SplatGeometry& geometry, SplatVariable& variable, const glm::dvec3& cell_min) const {
    const size_t i = geometry.size();
    geometry.resize(i + 1);
    variable.resize(i + 1);
    const glm::vec3 at(splat.position - cell_min);
    geometry.x[i] = at.x, geometry.y[i] = at.y, geometry.z[i] = at.z;
    const std::array<float*, 6> shape{&geometry.axis0[i],   &geometry.axis1[i],   &geometry.axis2[i],
                                      &geometry.shear10[i], &geometry.shear20[i], &geometry.shear21[i]};
    for (size_t n = 0; n < 3; ++n) {
      *shape[n] = static_cast<float>(splat.axis[n]);
      *shape[n + 3] = static_cast<float>(splat.shear[n]);
    }
    geometry.weight[i] = static_cast<float>(splat.weight);
    variable.mean[i] = static_cast<float>(scalar.mean);
    variable.slope0[i] = static_cast<float>(scalar.slope.x);
    variable.slope1[i] = static_cast<float>(scalar.slope.y);
    variable.slope2[i] = static_cast<float>(scalar.slope.z);
    variable.variance[i] = static_cast<float>(scalar.variance);
  }
};

class Random {
 public:
  explicit Random(uint32_t seed) : engine_(seed) {}
  double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  glm::dvec3 point(double low, double high) { return {in(low, high), in(low, high), in(low, high)}; }
  glm::dvec3 direction() {
    while (true) {
      const glm::dvec3 v = point(-1, 1);
      if (glm::length(v) > 0.1 && glm::length(v) < 1) return glm::normalize(v);
    }
  }

  /// A splat with axes of `size` and up to `aspect` times smaller, near `around`.
  TestSplat splat(double size, double aspect, const glm::dvec3& around) {
    TestSplat made;
    made.splat.position = around + point(-0.1, 0.1);
    for (double& axis : made.splat.axis) axis = size * std::pow(aspect, -in(0, 1));
    for (double& shear : made.splat.shear) shear = in(-1, 1);
    made.splat.weight = in(0.5, 2) * made.splat.axis[0] * made.splat.axis[1] * made.splat.axis[2];
    made.scalar = {in(0, 1), point(-0.2, 0.2), in(0, 1) < 0.5 ? 0.0 : in(0, 0.01)};
    return made;
  }

 private:
  std::mt19937 engine_;
};

const ClassificationTable& opaque() {
  static const ClassificationTable table(
      [](double) {
        return TransferFunction::Value{glm::dvec3(1.0), 1};
      },
      0, 1);
  return table;
}

ScreenSplat projectOne(const TestSplat& splat, const ProjectionSettings& settings,
                       const glm::dvec3& cell_min) {
  SplatGeometry geometry;
  SplatVariable variable;
  splat.appendTo(geometry, variable, cell_min);
  BrickProjector projector;
  projector.project(settings, opaque(), cell_min, geometry, variable);
  const size_t records = projector.splats().size() > 1 && isRecord(projector.splats().front()) ? 1 : 0;
  EXPECT_EQ(projector.splats().size(), 1 + records);
  return projector.splats().empty() ? ScreenSplat{} : projector.splats().back();
}

/// V K(|A⁻¹(x - mu)|) / det A, integrated along origin + t direction around the splat, in stretched space.
double integralAlong(const TestSplat& splat, const glm::dvec3& scale, const glm::dvec3& origin,
                     const glm::dvec3& direction) {
  const glm::dmat3 stretch(scale.x, 0, 0, 0, scale.y, 0, 0, 0, scale.z);
  const glm::dmat3 factor = stretch * splat.splat.factor();
  const glm::dmat3 inverse = glm::inverse(factor);
  const glm::dvec3 start = inverse * (origin - scale * splat.splat.position), step = inverse * direction;
  const double nearest = -glm::dot(start, step) / glm::dot(step, step);
  const double half = kKernelSupport / glm::length(step);
  double sum = 0;
  constexpr int kSteps = 4000;
  for (int n = 0; n < kSteps; ++n) {
    const double t = nearest + half * (2 * (n + 0.5) / kSteps - 1);
    sum += kernel(glm::length(start + t * step)) * 2 * half / kSteps;
  }
  const double volume = splat.splat.weight * scale.x * scale.y * scale.z;
  return sum * volume / std::abs(glm::determinant(factor));
}

Camera randomCamera(Random& random, Projection projection) {
  Camera camera;
  camera.focal_point = random.point(-0.05, 0.05);
  camera.position = camera.focal_point + 3.0 * random.direction();
  camera.view_up = random.direction();
  camera.projection = projection;
  camera.parallel_scale = 0.3;
  camera.view_angle_deg = 12;
  return camera;
}

constexpr ImageSize kLargePicture{4000, 3000};  // the least low-pass, 0.01 px², is next to nothing then
constexpr double kMinLowPass = 0.01;

// The optical depth of a ray through a pixel that meets the splat must be what the screen splat says.
void checkOpticalDepths(Projection projection, double size, double tolerance) {
  Random random(11);
  for (int n = 0; n < 200; ++n) {
    const glm::dvec3 scale = n % 2 ? glm::dvec3(1, 1, 1) : glm::dvec3(0.7, 1.3, 2);
    const TestSplat splat = random.splat(size, 8, glm::dvec3(0));
    const ProjectionSettings settings{
        ScreenView::of(randomCamera(random, projection), kLargePicture, scale, kMinLowPass, 1e-3)};
    const ScreenView& view = settings.view;
    const ScreenSplat drawn = projectOne(splat, settings, {-0.3, -0.2, -0.4});
    const double peak = drawn.amplitude * footprint(0);
    for (int k = 0; k < 8; ++k) {
      const double rho = random.in(0, 1.5), angle = random.in(0, 6.3);
      const glm::dvec2 u = rho * glm::dvec2(std::cos(angle), std::sin(angle));
      const glm::dvec2 d(drawn.l11 * u.x, drawn.l21 * u.x + drawn.l22 * u.y);
      const glm::dvec2 from_middle =
          (glm::dvec2(drawn.x, drawn.y) + d - 0.5 * glm::dvec2(kLargePicture.width, kLargePicture.height)) /
          view.focal_px;
      const glm::dvec3 across = from_middle.x * view.right + from_middle.y * view.down;
      const bool perspective = projection == Projection::kPerspective;
      const double depth = integralAlong(splat, scale, perspective ? view.eye : view.eye + across,
                                         perspective ? glm::normalize(view.forward + across) : view.forward);
      EXPECT_NEAR(drawn.amplitude * footprint(rho), depth, tolerance * peak) << n << ", rho " << rho;
    }
  }
}

TEST(Projection, OrthographicOpticalDepthIsTheIntegralAlongTheRay) {
  checkOpticalDepths(Projection::kOrthographic, 0.05, 2e-3);
}

TEST(Projection, PerspectiveOpticalDepthIsTheIntegralAlongTheRay) {
  checkOpticalDepths(Projection::kPerspective, 0.02, 0.03);
  checkOpticalDepths(Projection::kPerspective, 0.005, 0.008);
}

/// DESIGN.md, "Projection", by its formulas: h2ᵀ (S2 + 0.01)⁻¹ and s² = sigma²(|w|² - h2ᵀ(S2 + 0.01)⁻¹h2) + r, at
/// least sigma²(w·n)² + r, in double precision.
struct Conditioned {
  glm::dvec2 gradient;  // per pixel
  double deviation;
};

Conditioned condition(const TestSplat& splat, const ScreenView& view, const glm::dvec3& row0,
                      const glm::dvec3& row1) {
  const glm::dmat3 factor = splat.splat.factor();
  const glm::dvec3 b0 = view.scale * row0 * factor, b1 = view.scale * row1 * factor;
  const glm::dvec3& w = splat.scalar.slope;
  const glm::dvec2 h(glm::dot(b0, w), glm::dot(b1, w));
  const glm::dmat2 s2(glm::dot(b0, b0) + 0.01, glm::dot(b0, b1), glm::dot(b0, b1), glm::dot(b1, b1) + 0.01);
  const glm::dvec2 gradient = glm::inverse(s2) * h;
  const double hidden = std::max(glm::dot(w, w) - glm::dot(h, gradient),
                                 std::pow(glm::dot(w, glm::normalize(glm::cross(b0, b1))), 2));
  return {gradient, std::sqrt(kKernelSigma * kKernelSigma * hidden + splat.scalar.variance)};
}

void expectConditioned(const ScreenSplat& drawn, const Conditioned& expected, double tolerance) {
  // The slope along L's columns is Lᵀ times the gradient.
  EXPECT_NEAR(drawn.slope0, drawn.l11 * expected.gradient.x + drawn.l21 * expected.gradient.y, tolerance);
  EXPECT_NEAR(drawn.slope1, drawn.l22 * expected.gradient.y, tolerance);
  EXPECT_NEAR(drawn.half_width, std::sqrt(3.0) * expected.deviation, tolerance);
}

TEST(Projection, MeanAndDeviationFollowTheDesign) {
  Random random(5);
  for (const double low_pass : {0.01, 1.5}) {
    for (int n = 0; n < 500; ++n) {
      const glm::dvec3 scale = n % 2 ? glm::dvec3(1, 1, 1) : glm::dvec3(0.7, 1.3, 2);
      const TestSplat splat = random.splat(n % 3 ? 0.05 : 0.002, 20, glm::dvec3(0));
      const ProjectionSettings settings{ScreenView::of(randomCamera(random, Projection::kOrthographic),
                                                       kLargePicture, scale, low_pass, 1e-3)};
      const ScreenView& view = settings.view;
      expectConditioned(projectOne(splat, settings, {-0.3, -0.2, -0.4}),
                        condition(splat, view, view.focal_px * view.right, view.focal_px * view.down), 2e-4);
    }
  }
}

TEST(Projection, StaysExactForPencilsAndSheets) {
  Random random(6);
  for (const double aspect : {1e3, 1e5})
    for (int n = 0; n < 500; ++n) {
      const TestSplat splat = random.splat(0.3, aspect, glm::dvec3(0));
      const ProjectionSettings settings{ScreenView::of(randomCamera(random, Projection::kOrthographic),
                                                       kLargePicture, glm::dvec3(1), 1.5, 1e-3)};
      const ScreenView& view = settings.view;
      const ScreenSplat drawn = projectOne(splat, settings, {-0.3, -0.2, -0.4});
      const glm::dvec3 row0 = view.focal_px * view.right, row1 = view.focal_px * view.down;
      expectConditioned(drawn, condition(splat, view, row0, row1), 3e-3);
      const glm::dvec3 b0 = row0 * splat.splat.factor(), b1 = row1 * splat.splat.factor();
      const double determinant =
          (glm::dot(b0, b0) + 1.5) * (glm::dot(b1, b1) + 1.5) - std::pow(glm::dot(b0, b1), 2);
      EXPECT_NEAR(
          drawn.amplitude * std::sqrt(determinant) / (splat.splat.weight * view.focal_px * view.focal_px), 1,
          1e-4);
      EXPECT_NEAR(double{drawn.l11} * drawn.l22 / std::sqrt(determinant), 1, 1e-4);
    }
}

// The plane of a splat is its mean depth at each pixel, by the ellipsoid itself: the low-pass is none of its slope.
TEST(Projection, ThinSplatsLeanAsTheirPlanesDo) {
  constexpr double kMinExplained = 2;
  Random random(11);
  int leaning = 0, upright = 0, held = 0;
  for (int n = 0; n < 3000; ++n) {
    const glm::dvec3 scale = n % 2 ? glm::dvec3(1, 1, 1) : glm::dvec3(0.7, 1.3, 2);
    const Projection projection = n % 5 < 3 ? Projection::kOrthographic : Projection::kPerspective;
    const TestSplat splat = random.splat(n % 3 ? 0.05 : 0.002, n % 7 ? 30 : 1000, glm::dvec3(0));
    ProjectionSettings settings{
        ScreenView::of(randomCamera(random, projection), kLargePicture, scale, 1.5, 1e-3)};
    if (n % 4 == 0) settings.clip_planes = {{splat.splat.position, random.direction()}};
    const ScreenView& view = settings.view;
    const glm::dvec3 at = view.viewFromData(splat.splat.position);
    const bool perspective = projection == Projection::kPerspective;
    const double pixels = view.focal_px / (perspective ? at.z : 1), x = perspective ? at.x / at.z : 0,
                 y = perspective ? at.y / at.z : 0;
    const glm::dmat3 view_from_data = glm::transpose(
        glm::dmat3(scale * pixels * (view.right - x * view.forward),
                   scale * pixels * (view.down - y * view.forward), scale * pixels * view.forward));
    const glm::dmat3 a = view_from_data * splat.splat.factor(), s = a * glm::transpose(a);
    const double determinant = s[0][0] * s[1][1] - s[0][1] * s[0][1], trace = s[0][0] + s[1][1];
    if (determinant < 1e-3 * trace * trace) continue;  // nearly edge-on
    const glm::dvec2 slope =
        glm::inverse(glm::dmat2(s[0][0], s[0][1], s[0][1], s[1][1])) * glm::dvec2(s[2][0], s[2][1]);
    const double explained = glm::dot(slope, glm::dvec2(s[2][0], s[2][1])), rest = s[2][2] - explained;
    if (std::abs(explained / rest - kMinExplained) < 0.02) continue;
    const bool leans = explained > kMinExplained * rest;
    const double steep = glm::length(slope);
    const glm::dvec2 expected = leans ? std::min(1.0, kSteepest / steep) * slope : glm::dvec2(0);
    const ScreenSplat drawn = projectOne(splat, settings, {-0.3, -0.2, -0.4});
    EXPECT_NEAR(drawn.key_slope0, expected.x, 5e-3 * (leans ? 1 + steep : 0)) << n;
    EXPECT_NEAR(drawn.key_slope1, expected.y, 5e-3 * (leans ? 1 + steep : 0)) << n;
    leaning += leans;
    upright += !leans;
    held += leans && steep > kSteepest;
  }
  EXPECT_GT(leaning, 300);
  EXPECT_GT(upright, 300);
  EXPECT_GT(held, 5);
}

// A pencil has no plane. It leans along itself alone.
TEST(Projection, PencilsLeanAlongThemselves) {
  Random random(12);
  for (int n = 0; n < 200; ++n) {
    TestSplat splat;
    splat.splat.position = random.point(-0.1, 0.1);
    splat.splat.axis = {0.1, 1e-9, 1e-9};
    splat.splat.shear = {random.in(-1, 1), random.in(-1, 1), 0};
    splat.splat.weight = 1e-6;
    splat.scalar = {0.5, {0, 0, 0}, 0};
    const ProjectionSettings settings{ScreenView::of(randomCamera(random, Projection::kOrthographic),
                                                     kLargePicture, glm::dvec3(1), 1.5, 1e-3)};
    const ScreenView& view = settings.view;
    const glm::dvec3 along = view.focal_px * splat.splat.factor()[0];
    const glm::dvec2 on_screen(glm::dot(view.right, along), glm::dot(view.down, along));
    const glm::dvec2 slope = glm::dot(view.forward, along) / glm::dot(on_screen, on_screen) * on_screen;
    const double steep = glm::length(slope);
    if (steep > 0.9 * kSteepest) continue;
    const ScreenSplat drawn = projectOne(splat, settings, {-0.3, -0.2, -0.4});
    EXPECT_NEAR(drawn.key_slope0, slope.x, 0.01 * (0.1 + steep)) << n;
    EXPECT_NEAR(drawn.key_slope1, slope.y, 0.01 * (0.1 + steep)) << n;
  }
}

// A plane across the ray leaves the depths beyond it, distributed as a biweight (screen_splat.h): what is seen nearer than
// their middle shrinks with their deviation and, since painters take the optical depth of the whole, with their share.
TEST(Projection, WhatAPlaneLeavesHidesLessOfItself) {
  Random random(13);
  for (int n = 0; n < 200; ++n) {
    const TestSplat splat = random.splat(0.05, 5, glm::dvec3(0));
    ProjectionSettings settings{ScreenView::of(randomCamera(random, Projection::kOrthographic), kLargePicture,
                                               glm::dvec3(1), kMinLowPass, 1e-3)};
    const ScreenView& view = settings.view;
    const glm::dmat3 a = glm::transpose(glm::dmat3(view.right, view.down, view.forward)) *
                         splat.splat.factor(),
                     s = a * glm::transpose(a);
    const glm::dvec2 across(s[2][0], s[2][1]);
    const double deviation =
        kKernelSigma *
        std::sqrt(s[2][2] -
                  glm::dot(across, glm::inverse(glm::dmat2(s[0][0], s[0][1], s[0][1], s[1][1])) * across));
    const double at = random.in(-2, 2), side = n % 2 ? 1 : -1;  // deviations behind the middle; what is left
    const double along = projectOne(splat, settings, {-0.3, -0.2, -0.4}).along;
    settings.clip_planes = {{splat.splat.position + at * deviation * view.forward, side * view.forward}};
    double share = 0, mean = 0, square = 0;
    constexpr int kSteps = 20000;
    const double reach = std::sqrt(7.0);
    for (int step = 0; step < kSteps; ++step) {
      const double x = reach * (2 * (step + 0.5) / kSteps - 1);
      if (side * (x - at) < 0) continue;
      const double part = 15 / (16 * reach) * std::pow(1 - x * x / 7, 2) * 2 * reach / kSteps;
      share += part, mean += part * x, square += part * x * x;
    }
    mean /= share;
    const double left = std::sqrt(square / share - mean * mean);
    EXPECT_NEAR(projectOne(splat, settings, {-0.3, -0.2, -0.4}).along, along * share * left,
                3e-3 * std::abs(along))
        << n << ' ' << at << ' ' << side;
  }
}

// The colours' scalar is the splat's own times -2: it goes with the depth as strongly, the other way. Behind a clip plane, between
// two layers of the pixels, and both.
TEST(Projection, ColoursGoWithTheDepthAsTheirScalarDoes) {
  Random random(14);
  const ImageSize size{40, 30};
  const glm::dvec3 corner{-0.3, -0.2, -0.4};
  int cut = 0, placed = 0, strong = 0;
  for (int n = 0; n < 400; ++n) {
    const TestSplat splat = random.splat(0.05, 5, glm::dvec3(0));
    const Projection projection = n % 2 ? Projection::kOrthographic : Projection::kPerspective;
    ProjectionSettings settings{
        ScreenView::of(randomCamera(random, projection), size, glm::dvec3(1), 0.3, 1e-3)};
    const ScreenView& view = settings.view;
    if (n % 3 != 0) settings.clip_planes = {{splat.splat.position, random.direction()}};
    const glm::dvec3 at = view.viewFromData(splat.splat.position);
    const double depth = projection == Projection::kPerspective ? glm::length(at) : at.z;
    std::vector<PixelLayers::Row> rows(static_cast<size_t>(size.height));
    for (PixelLayers::Row& row : rows)
      for (int x = 0; x < size.width; ++x) {
        for (const double behind : {-0.01, 0.01})
          row.layers.push_back({static_cast<float>(depth + behind), {0.1f, 0.1f, 0.1f, 0.2f}});
        row.endPixel(row.layers.size() - 2);
      }
    const PixelLayers layers(size, std::move(rows), 0);
    if (n % 3 != 1) settings.layers = &layers;
    SplatGeometry geometry;
    SplatVariable own, colours;
    splat.appendTo(geometry, own, corner);
    colours = own;
    colours.mean[0] *= -2, colours.variance[0] *= 4;
    colours.slope0[0] *= -2, colours.slope1[0] *= -2, colours.slope2[0] *= -2;
    BrickProjector projector;
    const SplatRange all{0, 1};
    projector.project(settings, opaque(), corner, arraysOf(geometry),
                      BrickValues(arraysOf(own), arraysOf(colours)), {&all, 1});
    if (projector.splats().empty()) continue;  // behind the plane
    const ScreenSplat& drawn = projector.splats().back();
    const SplatRecords records = SplatRecords::beside(&drawn, -1, true);
    ASSERT_TRUE(records.colour);
    const ScreenColour colour = ScreenColour::of(*records.colour);
    double correlation = 0;
    if (records.cut) correlation = ScreenCut::of(*records.cut).correlation;
    if (records.depth) correlation = ScreenDepth::of(*records.depth).correlation;
    EXPECT_NEAR(colour.correlation, -correlation, 1e-4) << n;
    EXPECT_NEAR(colour.along, -2 * drawn.along, 1e-4 * std::abs(drawn.along)) << n;
    EXPECT_NEAR(colour.half_width, 2 * drawn.half_width, 1e-4 * drawn.half_width) << n;
    cut += records.cut && !records.depth;
    placed += records.depth != nullptr;
    strong += std::abs(correlation) > 0.3;
  }
  EXPECT_GT(cut, 80);
  EXPECT_GT(placed, 150);
  EXPECT_GT(strong, 150);
}

TEST(Projection, DepthOrdersAlongTheViewAndFromTheEye) {
  SplatGeometry geometry;
  SplatVariable variable;
  TestSplat splat;
  splat.splat.axis = {1e-3, 1e-3, 1e-3};
  splat.splat.weight = 1e-9;
  for (const glm::dvec3& at : {glm::dvec3(0, 0, 0), glm::dvec3(0.5, 0, 0), glm::dvec3(0, 0, -0.1)}) {
    splat.splat.position = at;
    splat.appendTo(geometry, variable, {-1, -1, -1});
  }
  Camera camera;
  camera.position = {0, 0, 2};
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    camera.projection = projection;
    BrickProjector projector;
    projector.project({ScreenView::of(camera, kLargePicture, glm::dvec3(1), 1.5, 1e-3)}, opaque(),
                      {-1, -1, -1}, geometry, variable);
    ASSERT_EQ(projector.depths().size(), 3u);
    const auto& depths = projector.depths();
    const double farther = projection == Projection::kOrthographic ? 0.1 : 1 / 2.0 - 1 / 2.1;
    EXPECT_NEAR(depths[2] - depths[0], farther, 1e-6);
    EXPECT_NEAR(depths[1] - depths[0], 0, 1e-6);
  }
}

TEST(Projection, CountsWhatItLeavesOut) {
  SplatGeometry geometry;
  SplatVariable variable;
  TestSplat splat;
  splat.splat.axis = {1e-3, 1e-3, 1e-3};
  const auto add = [&](const glm::dvec3& at, double mean, double weight) {
    splat.splat.position = at;
    splat.scalar.mean = mean;
    splat.splat.weight = weight;
    splat.appendTo(geometry, variable, glm::dvec3(-1));
  };
  add({0, 0, 0}, 0.8, 1e-9);    // seen
  add({0.1, 0, 0}, 0.2, 1e-9);  // transparent
  add({0.1, 0, 0}, 0.8, 0);     // without weight
  add({5, 0, 0}, 0.8, 1e-9);    // off screen
  add({0, 8, 0}, 0.8, 1e-9);    // clipped
  add({0, 0, 9}, 0.8, 1e-9);    // behind the eye
  const ClassificationTable table(
      [](double f) {
        return TransferFunction::Value{glm::dvec3(1), f > 0.5 ? 1.0 : 0.0};
      },
      0, 1);
  Camera camera;
  camera.position = {0, 0, 2};
  camera.projection = Projection::kPerspective;
  const WorldBox clip{{-20, -5, -20}, {20, 5, 20}};
  BrickProjector projector;
  projector.project(
      {ScreenView::of(camera, kLargePicture, glm::dvec3(1), 1.5, 1e-3), true, clipPlanesOf({}, clip)}, table,
      glm::dvec3(-1), geometry, variable);
  EXPECT_EQ(projector.counts().read, 6u);
  EXPECT_EQ(projector.counts().drawn, 1u);
  EXPECT_EQ(projector.counts().transparent, 2u);
  EXPECT_EQ(projector.counts().off_screen, 2u);
  EXPECT_EQ(projector.counts().clipped, 1u);
  EXPECT_EQ(projector.splats().size(), 1u);
}

TEST(Projection, DrawsFlatWhatHasNoFiniteReach) {
  // A painter that gets an infinite reach finds infinity minus infinity.
  SplatGeometry geometry;
  SplatVariable variable;
  TestSplat splat;
  splat.splat.axis = {1e-1, 1e-1, 1e-1};
  splat.splat.weight = 1e-3;
  for (const double slope : {1e25, 3e38}) {
    splat.scalar = {-0.9 * slope, glm::dvec3(slope), 0};
    splat.appendTo(geometry, variable, glm::dvec3(-1));
  }
  const ClassificationTable table(
      [](double) {
        return TransferFunction::Value{glm::dvec3(1), 1.0};
      },
      0, 1e25);
  Camera camera;
  camera.position = {0, 0, 2};
  BrickProjector projector;
  projector.project({ScreenView::of(camera, kLargePicture, glm::dvec3(1), 1.5, 1e-3), true}, table,
                    glm::dvec3(-1), geometry, variable);
  ASSERT_EQ(projector.splats().size(), 2u);
  for (const ScreenSplat& drawn : projector.splats()) {
    EXPECT_LT(drawn.mean, -1e24f);
    EXPECT_EQ(drawn.slope0, 0);
    EXPECT_EQ(drawn.slope1, 0);
    EXPECT_EQ(drawn.half_width, 0);
  }
}

TEST(Projection, LeavesNothingOutThatCanBeSeen) {
  // Splats that a coarse test calls transparent must have no extinction at any offset.
  Random random(8);
  const ClassificationTable table(
      [](double f) {
        return TransferFunction::Value{glm::dvec3(1), f > 0.7 ? 1.0 : 0.0};
      },
      0, 1);
  const Camera camera = randomCamera(random, Projection::kOrthographic);
  const ProjectionSettings settings{ScreenView::of(camera, kLargePicture, glm::dvec3(1), 1.5, 1e-3)};
  int left_out = 0;
  for (int n = 0; n < 2000; ++n) {
    const TestSplat splat = random.splat(n % 2 ? 0.02 : 0.0005, 20, glm::dvec3(0));
    SplatGeometry geometry;
    SplatVariable variable;
    splat.appendTo(geometry, variable, glm::dvec3(-1));
    BrickProjector projector;
    projector.project(settings, table, glm::dvec3(-1), geometry, variable);
    if (projector.counts().transparent == 0) continue;
    ++left_out;
    const ScreenSplat whole = projectOne(splat, settings, glm::dvec3(-1));
    for (int k = 0; k < 50; ++k) {
      const double rho = random.in(0, kKernelSupport), angle = random.in(0, 6.3);
      EXPECT_EQ(
          table
              .mean(whole.mean + rho * (whole.slope0 * std::cos(angle) + whole.slope1 * std::sin(angle)),
                    whole.half_width)
              .w,
          0);
    }
    // The bound that whole bricks are left out by reaches as far.
    const double reach = largestReach(1.5) * glm::length(splat.scalar.slope) * 1.001;
    EXPECT_LE(kKernelSupport * std::hypot(whole.slope0, whole.slope1), reach);
  }
  EXPECT_GT(left_out, 200);
}

TEST(ScreenView, RefusesViewsWithoutAPicture) {
  Camera camera;
  const auto of = [&](ImageSize size, const glm::dvec3& scale, double low_pass) {
    return ScreenView::of(camera, size, scale, low_pass, 1e-3);
  };
  EXPECT_NO_THROW(of({1, 1}, glm::dvec3(1), 1.5));
  EXPECT_THROW(of({0, 1}, glm::dvec3(1), 1.5), UsageError);
  EXPECT_THROW(of({1, 1}, {1, 0, 1}, 1.5), UsageError);
  EXPECT_THROW(of({1, 1}, {1, NAN, 1}, 1.5), UsageError);
  EXPECT_THROW(of({1, 1}, glm::dvec3(1), 0), UsageError);
  camera.parallel_scale = 0;
  EXPECT_THROW(of({1, 1}, glm::dvec3(1), 1.5), UsageError);
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = 180;
  EXPECT_THROW(of({1, 1}, glm::dvec3(1), 1.5), UsageError);
}

}  // namespace
}  // namespace curvisplat
