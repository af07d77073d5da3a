// The specification itself is held to closed forms.
#include "tests/reference/reference_march.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

// The box [0, 2] x [0, 1] x [0, 1] with f = x / 2.
class Box : public Scene {
 public:
  Box() : Scene("box") {}
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const glm::dvec3 uvw(world.x / 2, world.y, world.z);
    for (int axis = 0; axis < 3; ++axis)
      if (!(uvw[axis] >= 0 && uvw[axis] <= 1)) return std::nullopt;
    return uvw;
  }
  double scalar(const glm::dvec3& world) const override { return world.x / 2; }
  double volume() const override { return 2; }
  // Larger than the box, so that its faces have to be found.
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return {{-0.3, -0.4, -0.5}, {2.3, 1.4, 1.5}}; }
  glm::dvec3 alongU(double u) const override { return {2 * u, 0, 0}; }
  glm::dvec3 alongV(double v) const override { return {0, v, 0}; }
  glm::dvec3 alongW(double w) const override { return {0, 0, w}; }
  glm::dvec3 join(const glm::dvec3& u, const glm::dvec3& v, const glm::dvec3& w) const override {
    return u + v + w;
  }
};

OpticalProperties homogeneous(double) {
  return {{0.25, 0.5, 0.75}, 1.5};
}

// Looks along the x axis, half a pixel's height being 0.1.
Camera alongX(Projection projection) {
  Camera camera;
  camera.position = {-3, 0.5, 0.5};
  camera.focal_point = {0, 0.5, 0.5};
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  camera.parallel_scale = 1;
  camera.view_angle_deg = 40;
  return camera;
}

TEST(ReferenceMarch, MatchesAHomogeneousBox) {
  Camera camera = alongX(Projection::kOrthographic);
  camera.parallel_scale = 0.9;
  const ReferenceImage image = referenceMarch(Box(), homogeneous, camera, {10, 10}, 0.03);
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      const bool hit = x >= 2 && x < 8 && y >= 2 && y < 8;  // centres 0.09, 0.27, ... from the middle
      const double t = hit ? std::exp(-1.5 * 2) : 1;
      EXPECT_NEAR(image.at(x, y).transmittance, t, 1e-12) << x << " " << y;
      EXPECT_NEAR(image.at(x, y).colour.r, t + (1 - t) * 0.25, 1e-12);
      EXPECT_NEAR(image.at(x, y).colour.b, t + (1 - t) * 0.75, 1e-12);
    }
}

TEST(ReferenceMarch, MatchesAHomogeneousBoxInPerspective) {
  const int n = 40;
  const ReferenceImage image =
      referenceMarch(Box(), homogeneous, alongX(Projection::kPerspective), {2 * n, n}, 0.03);
  const double half_height = std::tan(20 * 3.14159265358979323846 / 180);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < 2 * n; ++x) {
      // From the eye at distance 3: the slab x in [0, 2], cut by the walls at half a unit from the axis.
      const double right = half_height * (2 * (x + 0.5) / n - 2), up = half_height * (1 - 2 * (y + 0.5) / n);
      const double leaves = std::min(5.0, 0.5 / std::max(std::abs(right), std::abs(up)));
      const double length = std::max(0.0, leaves - 3) * std::sqrt(1 + right * right + up * up);
      if (length > 0 && length < 0.03) continue;
      EXPECT_NEAR(image.at(x, y).transmittance, std::exp(-1.5 * length), 1e-12) << x << " " << y;
    }
}

TEST(ReferenceMarch, HasTheImageTheRightWayUp) {
  Camera camera = alongX(Projection::kOrthographic);
  camera.focal_point += glm::dvec3(0, 0.5, 0.5);  // the box moves to the lower right: -y is on the right
  camera.position += glm::dvec3(0, 0.5, 0.5);
  const ReferenceImage image = referenceMarch(Box(), homogeneous, camera, {10, 10}, 0.03);
  EXPECT_LT(image.at(6, 8).transmittance, 1);
  EXPECT_EQ(image.at(3, 8).transmittance, 1);
  EXPECT_EQ(image.at(6, 1).transmittance, 1);
}

TEST(ReferenceMarch, IntegratesTransferFunctions) {
  const Camera camera = alongX(Projection::kOrthographic);
  const auto centre = [&](const OpticalFunction& function) {
    return referenceMarch(Box(), function, camera, {1, 1}, 0.03).at(0, 0).transmittance;
  };
  // f = x / 2 over a length of 2: twice the integral over f.
  EXPECT_NEAR(centre(smoothFunction), std::exp(-2 * 8 / 3.0), 1e-6);
  EXPECT_NEAR(centre(stepFunction), std::exp(-16.0), 1e-9);
  EXPECT_NEAR(centre(bandFunction), std::exp(-2 * 24 * std::sqrt(3.14159265358979323846 * 0.0018)), 1e-5);
}

TEST(ReferenceMarch, MeetsAJumpWhereItIs) {
  // From the other side, where the jump is seen first: colour comes from the very edge of f > 0.5.
  const auto edge = [](double f) {
    return OpticalProperties{glm::dvec3(f > 0.37 ? 1 : 0, 0, 0), f > 0.37 ? 0.5 : 0.0};
  };
  const auto pixel = referenceMarch(Box(), edge, alongX(Projection::kOrthographic), {1, 1}, 0.03).at(0, 0);
  EXPECT_NEAR(pixel.transmittance, std::exp(-0.5 * 2 * 0.63), 2e-5);
  EXPECT_NEAR(pixel.colour.r, 1, 1e-12);
}

TEST(ReferenceMarch, ConvergesOnTheHalfAnnulus) {
  const auto scene = makeScene("half-annulus");
  const auto difference = [&](const OpticalFunction& function) {
    const ReferenceImage coarse = referenceMarch(*scene, function, halfAnnulusCamera(), {48, 48}, 0.004);
    const ReferenceImage fine = referenceMarch(*scene, function, halfAnnulusCamera(), {48, 48}, 0.001);
    double sum = 0;
    for (size_t n = 0; n < fine.pixels.size(); ++n) {
      const glm::dvec3 d = fine.pixels[n].colour - coarse.pixels[n].colour;
      sum += glm::dot(d, d) / 3;
    }
    return -10 * std::log10(sum / static_cast<double>(fine.pixels.size()));
  };
  EXPECT_GT(difference(smoothFunction), 90);
  EXPECT_GT(difference(bandFunction), 80);
  EXPECT_GT(difference(stepFunction), 75);
}

}  // namespace
}  // namespace curvisplat
