#include "render/camera/camera.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

const glm::dvec3 kLower(-3, 10, 0.5), kUpper(5, 11, 4);
const char* const kViews[] = {"iso", "+x", "-x", "+y", "-y", "+z", "-z"};

glm::dvec3 boxCorner(int n) {
  return {n & 1 ? kUpper.x : kLower.x, n & 2 ? kUpper.y : kLower.y, n & 4 ? kUpper.z : kLower.z};
}

/// The place of a point in the image: -1..1 from the left and from the bottom.
glm::dvec2 inImage(const Camera& camera, const glm::dvec3& world, ImageSize size) {
  const glm::dvec3 view(camera.viewFromWorld() * glm::dvec4(world, 1));
  const double half_height = camera.projection == Projection::kOrthographic
                                 ? camera.parallel_scale
                                 : -view.z * std::tan(camera.view_angle_deg * std::numbers::pi / 360);
  return {view.x / half_height * size.height / size.width, view.y / half_height};
}

void expectPointNear(const glm::dvec3& a, const glm::dvec3& b, double tolerance = 1e-12) {
  EXPECT_NEAR(glm::distance(a, b), 0, tolerance)
      << a.x << " " << a.y << " " << a.z << " and " << b.x << " " << b.y << " " << b.z;
}

TEST(Camera, NamedViewsHoldTheBoxAndFillTheImage) {
  for (const auto projection : {Projection::kOrthographic, Projection::kPerspective})
    for (const ImageSize size : {ImageSize{600, 600}, ImageSize{800, 200}, ImageSize{200, 800}})
      for (const double angle : {1.0, 30.0, 100.0})
        for (const char* view : kViews) {
          const Camera camera = Camera::named(view, kLower, kUpper, size, projection, angle);
          double furthest = 0;
          for (int n = 0; n < 8; ++n) {
            const glm::dvec2 at = inImage(camera, boxCorner(n), size);
            furthest = std::max({furthest, std::abs(at.x), std::abs(at.y)});
            EXPECT_LT((camera.viewFromWorld() * glm::dvec4(boxCorner(n), 1)).z, 0) << view << " is in front";
          }
          EXPECT_LT(furthest, 0.999) << view;
          // Beside a wide angle the nearest corner, not the margin, decides.
          if (angle < 100) {
            EXPECT_GT(furthest, 0.9) << view << ": the image is not used";
          }
        }
}

/// Cameras fit the box from any direction as named views do, and from a named view's direction as that view.
TEST(Camera, FitsTheBoxFromWhereItLooks) {
  const ImageSize size{300, 200};
  for (const auto projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const Camera iso = Camera::named("iso", kLower, kUpper, size, projection, 30);
    Camera camera = iso;
    camera.position = iso.focal_point + 7.0 * (iso.position - iso.focal_point);
    camera.parallel_scale = 17;
    camera.fit(kLower, kUpper, size);
    expectPointNear(camera.position, iso.position, 1e-9);
    EXPECT_NEAR(camera.parallel_scale, iso.parallel_scale, 1e-9);
    camera.position = camera.focal_point + glm::dvec3(0.1, -3, 0.4);
    camera.fit(kLower, kUpper, size);
    double furthest = 0;
    for (int n = 0; n < 8; ++n) {
      const glm::dvec2 at = inImage(camera, boxCorner(n), size);
      furthest = std::max({furthest, std::abs(at.x), std::abs(at.y)});
    }
    EXPECT_LT(furthest, 0.999);
    EXPECT_GT(furthest, 0.9);
  }
}

TEST(Camera, NamedViewsLookFromWhereTheySay) {
  const struct {
    const char* view;
    glm::dvec3 from, right, up;
  } expected[] = {{"+x", {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},  {"-x", {-1, 0, 0}, {0, -1, 0}, {0, 0, 1}},
                  {"+y", {0, 1, 0}, {-1, 0, 0}, {0, 0, 1}}, {"-y", {0, -1, 0}, {1, 0, 0}, {0, 0, 1}},
                  {"+z", {0, 0, 1}, {1, 0, 0}, {0, 1, 0}},  {"-z", {0, 0, -1}, {-1, 0, 0}, {0, 1, 0}}};
  for (const auto& e : expected) {
    const Camera camera = Camera::named(e.view, kLower, kUpper, {}, Projection::kOrthographic);
    expectPointNear(camera.focal_point, 0.5 * (kLower + kUpper));
    expectPointNear(glm::normalize(camera.position - camera.focal_point), e.from);
    const glm::dmat4 view = camera.viewFromWorld();
    expectPointNear(glm::dvec3(view * glm::dvec4(e.right, 0)), {1, 0, 0});
    expectPointNear(glm::dvec3(view * glm::dvec4(e.up, 0)), {0, 1, 0});
    expectPointNear(glm::dvec3(view * glm::dvec4(e.from, 0)), {0, 0, 1});
  }
  const Camera iso = Camera::named("iso", kLower, kUpper, {}, Projection::kOrthographic);
  expectPointNear(glm::normalize(iso.position - iso.focal_point), glm::dvec3(1 / std::sqrt(3.0)));
  EXPECT_GT((iso.viewFromWorld() * glm::dvec4(0, 0, 1, 0)).y, 0.8);
}

TEST(Camera, ViewSpaceIsRightHandedWithThePositionAtItsOrigin) {
  Camera camera;
  camera.position = {3, -2, 7};
  camera.focal_point = {-1, 4, 2};
  camera.view_up = {0.2, 0.1, 1};
  const glm::dmat4 view = camera.viewFromWorld();
  EXPECT_NEAR(glm::determinant(view), 1, 1e-12);
  expectPointNear(glm::dvec3(view * glm::dvec4(camera.position, 1)), {0, 0, 0});
  expectPointNear(glm::dvec3(view * glm::dvec4(camera.focal_point, 1)),
                  {0, 0, -glm::distance(camera.position, camera.focal_point)});
  const glm::dvec3 up(view * glm::dvec4(camera.view_up, 0));
  EXPECT_NEAR(up.x, 0, 1e-12);
  EXPECT_GT(up.y, 0);
}

TEST(Camera, AnUpAlongTheViewIsReplacedAsVtkDoes) {
  Camera camera;
  camera.position = {0, 0, 5};
  camera.view_up = {0, 0, 1};  // VTK: (-z, x, y) = (-1, 0, 0)
  expectPointNear(glm::dvec3(camera.viewFromWorld() * glm::dvec4(-1, 0, 0, 0)), {0, 1, 0});
  // VTK's replacement of (1, -1, 1) lies along it again; zero and nearly parallel vectors do not help either.
  for (const glm::dvec3& up : {glm::dvec3(1, -1, 1), glm::dvec3(0), glm::dvec3(1.00001, -1, 1)}) {
    camera.position = {2, -2, 2};
    camera.view_up = up;
    const glm::dmat4 view = camera.viewFromWorld();
    EXPECT_NEAR(glm::determinant(view), 1, 1e-9);
  }
}

TEST(Camera, PositionAtTheFocalPointIsWrongUsage) {
  Camera camera;
  camera.position = camera.focal_point = {1, 2, 3};
  EXPECT_THROW(camera.viewFromWorld(), UsageError);
  EXPECT_THROW(Camera::named("front", kLower, kUpper, {}, Projection::kOrthographic), UsageError);
}

TEST(Camera, ABoxWithoutExtentIsLookedAtFromSomewhere) {
  for (const auto projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const Camera camera = Camera::named("iso", kLower, kLower, {}, projection);
    EXPECT_GT(camera.parallel_scale, 0);
    EXPECT_GT(glm::distance(camera.position, camera.focal_point), 0);
  }
}

TEST(Camera, ParallelScaleForHoldsABoxAwayFromTheFocalPoint) {
  Camera camera;
  camera.position = {100, 0, 0};
  camera.focal_point = {0, 0, 0};
  camera.view_up = {0, 0, 1};
  // Seen along x: y of the box reaches 11, z reaches 4.
  EXPECT_NEAR(camera.parallelScaleFor(kLower, kUpper, {600, 600}), 11 * 1.05, 1e-9);
  EXPECT_NEAR(camera.parallelScaleFor(kLower, kUpper, {1200, 300}), 4 * 1.05, 1e-9);
}

}  // namespace
}  // namespace curvisplat
