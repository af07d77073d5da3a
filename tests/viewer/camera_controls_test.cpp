#include "tools/viewer/navigation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "render/camera/camera_path.h"
#include "render/project/screen_view.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{300, 200};

Camera cameraOf(Projection projection) {
  Camera camera;
  camera.position = {4, -3, 2};
  camera.focal_point = {0.5, 0.25, -0.5};
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  camera.parallel_scale = 1.7;
  camera.view_angle_deg = 40;
  return camera;
}

glm::dvec2 pixelOf(const Camera& camera, const glm::dvec3& point) {
  const ScreenView view = ScreenView::of(camera, kSize, glm::dvec3(1), 1, 1e-6);
  return view.pixelFromView(view.viewFromData(point));
}

void expectNear(const glm::dvec3& a, const glm::dvec3& b, double slack = 1e-9) {
  EXPECT_LE(glm::length(a - b), slack)
      << a.x << ' ' << a.y << ' ' << a.z << " is not " << b.x << ' ' << b.y << ' ' << b.z;
}

class CameraControls : public testing::TestWithParam<Projection> {
 protected:
  const Camera camera_ = cameraOf(GetParam());
};
INSTANTIATE_TEST_SUITE_P(, CameraControls,
                         testing::Values(Projection::kOrthographic, Projection::kPerspective));

/// A long box that is seen from its end is whole from its sides, too; in the first picture it may be smaller for that.
TEST_P(CameraControls, OnceAroundTheBoxIsWhole) {
  const glm::dvec3 lower(-5, -1, -1), upper(5, 1, 1);
  Camera camera = Camera::named("+x", lower, upper, kSize, GetParam());
  const auto outermost = [&](const Camera& seen_by) {
    double most = 0;
    for (int n = 0; n < 8; ++n) {
      const glm::dvec3 corner(n & 1 ? upper.x : lower.x, n & 2 ? upper.y : lower.y,
                              n & 4 ? upper.z : lower.z);
      const glm::dvec2 from =
          glm::abs(pixelOf(seen_by, corner) - glm::dvec2(150, 100)) / glm::dvec2(150, 100);
      most = std::max({most, from.x, from.y});
    }
    return most;
  };
  EXPECT_LT(outermost(camera), 1);
  EXPECT_GT(outermost(orbited(camera, 90)), 1);
  const Camera held = heldOnceAround(camera, lower, upper, kSize);
  double most = 0;
  for (int degrees = 0; degrees < 360; ++degrees) most = std::max(most, outermost(orbited(held, degrees)));
  EXPECT_LE(most, 1);
  EXPECT_GT(most, 0.95);
  // A detail stays as large as it is shown, and what is whole already is not moved.
  camera = zoomed(camera, 4);
  EXPECT_EQ(heldOnceAround(camera, lower, upper, kSize).position, camera.position);
  camera = zoomed(camera, 0.01);
  EXPECT_EQ(heldOnceAround(camera, lower, upper, kSize).position, camera.position);
}

TEST_P(CameraControls, APointAtTheFocalDepthFollowsThePan) {
  const Camera after = panned(camera_, {31, -17}, kSize);
  const glm::dvec2 movement = pixelOf(after, camera_.focal_point) - pixelOf(camera_, camera_.focal_point);
  EXPECT_NEAR(movement.x, 31, 1e-9);
  EXPECT_NEAR(movement.y, -17, 1e-9);
}

TEST_P(CameraControls, RotationKeepsDistanceAndFocalPoint) {
  const Camera after = rotated(camera_, {40, 25}, kSize);
  expectNear(after.focal_point, camera_.focal_point);
  EXPECT_NEAR(glm::length(after.position - after.focal_point),
              glm::length(camera_.position - camera_.focal_point), 1e-12);
}

TEST_P(CameraControls, RotationTurnsWhatIsInFrontWithTheMouse) {
  const glm::dvec3 front = camera_.focal_point + 0.1 * (camera_.position - camera_.focal_point);
  const glm::dvec2 before = pixelOf(camera_, front);
  EXPECT_GT(pixelOf(rotated(camera_, {20, 0}, kSize), front).x, before.x + 1);
  EXPECT_GT(pixelOf(rotated(camera_, {0, 20}, kSize), front).y, before.y + 1);
}

TEST_P(CameraControls, RotationGoesOverThePoleAndBack) {
  Camera camera = camera_;
  for (int n = 0; n < 36; ++n) camera = rotated(camera, {0, kSize.height * 10.0 / 200}, kSize);
  expectNear(camera.position, camera_.position, 1e-9);
}

TEST_P(CameraControls, ZoomScalesTheFocalPlane) {
  EXPECT_NEAR(unitsPerPixel(zoomed(camera_, 2), kSize), unitsPerPixel(camera_, kSize) / 2, 1e-15);
}

TEST_P(CameraControls, ZoomKeepsWhatIsUnderTheMouse) {
  const Camera aside = panned(camera_, {31, -17}, kSize);
  const glm::dvec3 point = aside.focal_point;  // in the focal plane, not in the middle
  const glm::dvec2 mouse = pixelOf(camera_, point);
  ASSERT_GT(glm::length(mouse - glm::dvec2(150, 100)), 30);
  for (const double factor : {0.5, 1.1, 3.0}) {
    const Camera after = zoomedAt(camera_, factor, mouse, kSize);
    EXPECT_LE(glm::length(pixelOf(after, point) - mouse), 1e-6) << factor;
    EXPECT_NEAR(unitsPerPixel(after, kSize), unitsPerPixel(camera_, kSize) / factor, 1e-15);
  }
}

TEST_P(CameraControls, TheOtherProjectionKeepsTheFocalPlane) {
  const Camera other = withOtherProjection(camera_);
  EXPECT_NE(other.projection, camera_.projection);
  EXPECT_NEAR(unitsPerPixel(other, kSize), unitsPerPixel(camera_, kSize), 1e-15);
  EXPECT_NEAR(unitsPerPixel(withOtherProjection(other), kSize), unitsPerPixel(camera_, kSize), 1e-15);
}

TEST_P(CameraControls, RefittingShowsAllOfTheBox) {
  const glm::dvec3 lower(-10, 2, 3), upper(20, 5, 9);
  const Camera camera = refitted(camera_, lower, upper, kSize);
  for (int n = 0; n < 8; ++n) {
    const glm::dvec2 pixel =
        pixelOf(camera, {n & 1 ? upper.x : lower.x, n & 2 ? upper.y : lower.y, n & 4 ? upper.z : lower.z});
    EXPECT_GE(pixel.x, 0);
    EXPECT_GE(pixel.y, 0);
    EXPECT_LE(pixel.x, kSize.width);
    EXPECT_LE(pixel.y, kSize.height);
  }
  expectNear(glm::normalize(camera.focal_point - camera.position),
             glm::normalize(camera_.focal_point - camera_.position));
}

/// The corners of one picture are in the other, and those of a side are on its border.
TEST_P(CameraControls, HoldingShowsAllOfAnotherPicture) {
  const auto corner = [](const Camera& camera,
                         ImageSize size) {  // half of what is seen at the focal point's depth
    const double half_height = camera.projection == Projection::kOrthographic
                                   ? camera.parallel_scale
                                   : glm::length(camera.focal_point - camera.position) *
                                         std::tan(0.5 * camera.view_angle_deg * 3.14159265358979 / 180);
    return glm::dvec2(half_height * size.width / size.height, half_height);
  };
  const glm::dvec2 shown = corner(camera_, kSize);
  for (const ImageSize size : {ImageSize{600, 400}, ImageSize{100, 400}, ImageSize{900, 100}}) {
    const glm::dvec2 held = corner(holding(camera_, kSize, size), size);
    EXPECT_GE(held.x, shown.x - 1e-9) << size.width;
    EXPECT_GE(held.y, shown.y - 1e-9) << size.width;
    EXPECT_NEAR(std::min(held.x / shown.x, held.y / shown.y), 1, 1e-9) << size.width;
  }
}

TEST_P(CameraControls, FlyingMovesAlongTheView) {
  const Camera after = flown(camera_, {0, 0, 2});
  expectNear(after.position - camera_.position, 2.0 * glm::normalize(camera_.focal_point - camera_.position));
  expectNear(after.focal_point - after.position, camera_.focal_point - camera_.position);
}

/// The camera after a command that turns, rolls or zooms.
Camera afterCommand(Camera camera, Command command) {
  Navigation navigation;
  EXPECT_TRUE(navigation.run(command, camera, kSize));
  return camera;
}

TEST_P(CameraControls, KeysTurnTheCameraAboutTheFocalPoint) {
  const glm::dvec3 before = camera_.position - camera_.focal_point;
  const auto degreesAround = [](const glm::dvec3& at) { return glm::degrees(std::atan2(at.y, at.x)); };
  const auto degreesUp = [](const glm::dvec3& at) { return glm::degrees(std::asin(at.z / glm::length(at))); };
  const struct {
    Command command;
    double around, up;
  } cases[] = {{Command::kTurnRight, 15, 0},
               {Command::kTurnLeft, -15, 0},
               {Command::kTurnUp, 0, 15},
               {Command::kTurnDown, 0, -15}};
  for (const auto& [command, around, up] : cases) {
    const Camera after = afterCommand(camera_, command);
    expectNear(after.focal_point, camera_.focal_point);
    const glm::dvec3 now = after.position - after.focal_point;
    EXPECT_NEAR(glm::length(now), glm::length(before), 1e-9);
    EXPECT_NEAR(degreesAround(now), degreesAround(before) + around, 1e-9);
    EXPECT_NEAR(degreesUp(now), degreesUp(before) + up, 1e-9);
  }
}

TEST_P(CameraControls, KeysRollAndZoomThePicture) {
  const glm::dvec2 middle = pixelOf(camera_, camera_.focal_point);
  const ViewAxes axes = camera_.axes();
  const glm::dvec3 point = camera_.focal_point + 0.3 * axes.right;  // to the right of the middle
  const double length = glm::length(pixelOf(camera_, point) - middle);
  const double tilt = glm::radians(15.0);
  const struct {
    Command command;
    glm::dvec2 expected;  // from the middle; y is down
  } cases[] = {{Command::kRollLeft, {length * std::cos(tilt), -length * std::sin(tilt)}},
               {Command::kRollRight, {length * std::cos(tilt), length * std::sin(tilt)}},
               {Command::kZoomIn, {1.2 * length, 0}},
               {Command::kZoomOut, {length / 1.2, 0}}};
  for (const auto& [command, expected] : cases) {
    const glm::dvec2 now = pixelOf(afterCommand(camera_, command), point) - middle;
    EXPECT_NEAR(now.x, expected.x, 1e-9);
    EXPECT_NEAR(now.y, expected.y, 1e-9);
  }
}

TEST(CameraLooking, TurnsOnTheSpotByTheViewAngle) {
  const Camera camera = cameraOf(Projection::kPerspective);
  const Camera after = looking(camera, {0, static_cast<double>(kSize.height)}, kSize);
  expectNear(after.position, camera.position);
  const double cosine = glm::dot(glm::normalize(after.focal_point - after.position),
                                 glm::normalize(camera.focal_point - camera.position));
  EXPECT_NEAR(std::acos(cosine) * 180 / 3.14159265358979, camera.view_angle_deg, 1e-6);
}

}  // namespace
}  // namespace curvisplat
