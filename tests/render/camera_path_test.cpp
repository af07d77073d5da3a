#include "render/camera/camera_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>

#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

Camera cameraAt(const glm::dvec3& position, const glm::dvec3& focal_point = glm::dvec3(0),
                const glm::dvec3& view_up = {0, 0, 1}) {
  Camera camera;
  camera.position = position;
  camera.focal_point = focal_point;
  camera.view_up = view_up;
  return camera;
}

void expectNear(const glm::dvec3& a, const glm::dvec3& b, double tolerance = 1e-12) {
  EXPECT_NEAR(glm::distance(a, b), 0, tolerance)
      << a.x << " " << a.y << " " << a.z << " and " << b.x << " " << b.y << " " << b.z;
}

void expectSameCamera(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.position, b.position);
  EXPECT_EQ(a.focal_point, b.focal_point);
  EXPECT_EQ(a.view_up, b.view_up);
  EXPECT_EQ(a.parallel_scale, b.parallel_scale);
  EXPECT_EQ(a.view_angle_deg, b.view_angle_deg);
  EXPECT_EQ(a.projection, b.projection);
}

TEST(Orbit, GoesAroundTheFocalPointAboutViewUp) {
  const Camera camera = cameraAt({4, 2, 5}, {1, 2, 3});
  expectNear(orbited(camera, 90).position, {1, 5, 5});
  expectNear(orbited(camera, 180).position, {-2, 2, 5});
  expectNear(orbited(camera, -90).position, {1, -1, 5});
  const Camera tilted = cameraAt({4, 2, 5}, {1, 2, 3}, {1, 1, 2});
  for (const double degrees : {10.0, 77.0, 200.0, 1234.5}) {
    const glm::dvec3 arm = orbited(tilted, degrees).position - tilted.focal_point;
    EXPECT_NEAR(glm::length(arm), std::sqrt(13), 1e-12);
    EXPECT_NEAR(glm::dot(arm, tilted.view_up), glm::dot(glm::dvec3(3, 0, 2), tilted.view_up), 1e-12);
    EXPECT_EQ(orbited(tilted, degrees).focal_point, tilted.focal_point);
    EXPECT_EQ(orbited(tilted, degrees).view_up, tilted.view_up);
  }
}

TEST(Orbit, AWholeTurnIsTheSameCameraBitForBit) {
  const Camera camera = cameraAt({0.1, 0.2, 0.3}, {1.1, 2.7, 3.9}, {0.3, 0.1, 0.9});
  for (const double degrees : {0.0, 360.0, -360.0, 7200.0})
    expectSameCamera(orbited(camera, degrees), camera);
  expectSameCamera(orbited(camera, 361), orbited(camera, 1));
}

TEST(Orbit, ViewUpAlongTheViewIsReplaced) {
  const Camera moved = orbited(cameraAt({0, 0, 5}), 90);
  EXPECT_GT(glm::distance(moved.position, {0, 0, 5}), 1);
  EXPECT_NEAR(glm::length(moved.position), 5, 1e-12);
}

/// VTK 9.1, of vtkCamera's Azimuth(), Elevation(), Roll() and Zoom() in this order.
TEST(Turns, AreVtks) {
  const Camera camera = cameraAt({5, 1, 2}, {1, 1, 1});
  const Camera aside = orbited(camera, 40), up = elevated(aside, 30), tilted = rolled(up, 25);
  expectNear(aside.position, {4.0641777724759125, 3.571150438746157, 2.0});
  expectNear(up.position, {3.270633571116265, 2.905287792062408, 3.8660254037844393});
  EXPECT_EQ(up.view_up, camera.view_up);
  EXPECT_EQ(tilted.position, up.position);
  expectNear(tilted.view_up, {-0.15942607428718542, 0.26283496408270157, 0.9515782198500667});
  Camera seen = camera;
  seen.parallel_scale = 3;
  EXPECT_EQ(magnified(seen, 1.5).parallel_scale, 2);
  seen.projection = Projection::kPerspective;
  EXPECT_EQ(magnified(seen, 1.5).view_angle_deg, 20);
  EXPECT_EQ(magnified(seen, 1.5).position, seen.position);
}

TEST(Turns, APictureDoesNotTurnOverWhereTheCameraPassesAboveItsFocalPoint) {
  const auto rightOf = [](const Camera& camera) {
    const glm::dmat4 view = camera.viewFromWorld();
    return glm::dvec3(view[0].x, view[1].x, view[2].x);
  };
  for (const glm::dvec3& from : {glm::dvec3(3, 0, 0), {0, -3, 0}, {1, 2, 0.5}}) {
    const Camera camera = cameraAt(from);
    for (const double degrees : {-120.0, -90.0, -30.0, 60.0, 89.9, 90.0, 150.0, 200.0}) {
      const Camera up = elevated(camera, degrees);
      EXPECT_NEAR(glm::length(up.position), glm::length(from), 1e-12);
      expectNear(rightOf(up), rightOf(camera), 1e-9);
    }
    expectSameCamera(elevated(camera, 720), camera);
    expectSameCamera(rolled(camera, -360), camera);
  }
}

/// Key frames along a curve.
CameraPath pathAlong(const std::function<glm::dvec3(double)>& curve, const std::vector<double>& times) {
  std::vector<KeyFrame> keys;
  for (const double time : times) keys.push_back({time, cameraAt(curve(time), {0, 0, -100})});
  return CameraPath(keys, "test");
}

TEST(CameraPath, MeetsItsKeyFramesExactly) {
  std::vector<KeyFrame> keys;
  for (int n = 0; n < 5; ++n) {
    Camera camera = cameraAt({std::sin(3.0 * n), std::cos(2.0 * n), 0.1 * n * n},
                             {0.3 * n, -5, 1.0 / (n + 1)}, {std::sin(1.0 * n), 0.2, std::cos(1.0 * n)});
    camera.parallel_scale = std::exp(0.7 * n) / 3;
    keys.push_back({-1 + 0.1 * n * n, camera});
  }
  const CameraPath path(keys, "test");
  EXPECT_EQ(path.begin(), -1);
  EXPECT_EQ(path.end(), keys.back().time);
  for (const KeyFrame& key : keys) expectSameCamera(path.at(key.time), key.camera);
  expectSameCamera(path.at(-50), keys.front().camera);
  expectSameCamera(path.at(50), keys.back().camera);
  // And comes close to them from both sides.
  for (const KeyFrame& key : keys)
    for (const double nearby : {key.time - 1e-9, key.time + 1e-9}) {
      expectNear(path.at(nearby).position, key.camera.position, 1e-6);
      expectNear(glm::normalize(path.at(nearby).view_up), glm::normalize(key.camera.view_up), 1e-6);
      EXPECT_NEAR(path.at(nearby).parallel_scale, key.camera.parallel_scale, 1e-6);
    }
}

TEST(CameraPath, IsALineBetweenTwoKeyFramesAndThroughEvenOnes) {
  const auto line = [](double t) { return glm::dvec3(1 + t, 2 - 3 * t, 0.5 * t); };
  for (const auto& times : {std::vector<double>{0, 2}, std::vector<double>{0, 0.3, 1.1, 2}}) {
    const CameraPath path = pathAlong(line, times);
    for (double t = 0; t <= 2; t += 0.17) expectNear(path.at(t).position, line(t));
  }
}

TEST(CameraPath, FollowsAParabolaBetweenInnerKeyFrames) {
  const auto parabola = [](double t) { return glm::dvec3(t, t * t, 1 - 2 * t + 3 * t * t); };
  const CameraPath path = pathAlong(parabola, {0, 0.5, 1.7, 2, 3});
  for (double t = 0.5; t <= 2; t += 0.09) expectNear(path.at(t).position, parabola(t));
}

TEST(CameraPath, HasNoCornersAtKeyFrames) {
  const auto zigzag = [](double t) { return glm::dvec3(t, std::fmod(t, 2), -3 * std::fmod(t, 3)); };
  const CameraPath path = pathAlong(zigzag, {0, 1, 1.5, 2.5, 4});
  constexpr double kStep = 1e-6;
  for (const double t : {1.0, 1.5, 2.5}) {
    const glm::dvec3 at = path.at(t).position;
    const glm::dvec3 before = (at - path.at(t - kStep).position) / kStep,
                     after = (path.at(t + kStep).position - at) / kStep;
    expectNear(before, after, 1e-3);
  }
}

TEST(CameraPath, ViewUpTurnsOnAGreatCircle) {
  const CameraPath quarter(
      {{0, cameraAt({5, 0, 0}, {}, {0, 0, 2})}, {1, cameraAt({5, 0, 0.1}, {}, {0, 7, 0})}}, "test");
  const double third = std::numbers::pi / 6;
  expectNear(quarter.at(1.0 / 3).view_up, {0, std::sin(third), std::cos(third)});
  // Opposite: about the line of sight, at every time across it.
  const CameraPath half({{0, cameraAt({5, 0, 0}, {}, {0, 0, 1})}, {1, cameraAt({6, 0, 0}, {}, {0, 0, -1})}},
                        "test");
  for (double t = 0; t <= 1; t += 0.1) {
    EXPECT_NEAR(glm::length(half.at(t).view_up), 1, 1e-12);
    EXPECT_NEAR(half.at(t).view_up.x, 0, 1e-12);
    EXPECT_NEAR(half.at(t).view_up.z, std::cos(std::numbers::pi * t), 1e-12);
  }
}

TEST(CameraPath, ScalesAndAnglesStayWhatTheyMustBe) {
  std::vector<KeyFrame> zoom, angle;
  const double scales[] = {1, 1e-4, 1e5, 1e5, 2}, angles[] = {179, 1, 178, 178.5, 0.1};
  for (int n = 0; n < 5; ++n) {
    Camera camera = cameraAt({1, 2, 3});
    camera.parallel_scale = scales[n];
    zoom.push_back({1.0 * n, camera});
    camera.projection = Projection::kPerspective;
    camera.view_angle_deg = angles[n];
    angle.push_back({1.0 * n, camera});
  }
  const CameraPath zooms(zoom, "test"), widens(angle, "test");
  for (double t = 0; t <= 4; t += 0.01) {
    EXPECT_GT(zooms.at(t).parallel_scale, 0);
    EXPECT_GT(widens.at(t).view_angle_deg, 0);
    EXPECT_LT(widens.at(t).view_angle_deg, 180);
  }
  // Zooming is even: half way to a hundredth is a tenth.
  zoom.resize(2);
  zoom[1].camera.parallel_scale = 0.01;
  EXPECT_NEAR(CameraPath(zoom, "test").at(0.5).parallel_scale, 0.1, 1e-12);
}

class CameraPathFile : public testing::Test {
 protected:
  CameraPath read(const std::string& text) {
    std::ofstream(folder_ / "path.json") << text;
    return CameraPath::fromFile(folder_ / "path.json");
  }
  void expectRefused(const std::string& text, const std::string& word) {
    SCOPED_TRACE(text.substr(0, 200));
    expectError([&] { read(text); }, {word, "path.json"});
    EXPECT_LT(errorOf([&] { read(text); }).size(), 500u);
  }

  TemporaryFolder folder_;
};

/// A key frame with one field written otherwise; an empty text leaves it out.
std::string keyFrame(const std::string& field = "", const std::string& text = "") {
  const std::pair<std::string, std::string> fields[] = {{"time", "1"},
                                                        {"position", "[1, 2, 3]"},
                                                        {"focal_point", "[0, 0, 0.5]"},
                                                        {"view_up", "[0, 0, 1]"},
                                                        {"parallel_scale", "1.5"}};
  std::string json;
  for (const auto& [name, value] : fields) {
    const std::string& written = name == field ? text : value;
    if (!written.empty()) json += (json.empty() ? "" : ", ") + ("\"" + name + "\": ") + written;
  }
  return "{" + json + "}";
}
std::string file(const std::string& key_frames) {
  return "{\"key_frames\": [" + key_frames + "]}";
}

TEST_F(CameraPathFile, IsReadAsItIsWritten) {
  const CameraPath path = read(file(keyFrame() + ", " + keyFrame("time", "2.5")));
  EXPECT_EQ(path.begin(), 1);
  EXPECT_EQ(path.end(), 2.5);
  Camera expected = cameraAt({1, 2, 3}, {0, 0, 0.5});
  expected.parallel_scale = 1.5;
  expectSameCamera(path.at(1), expected);

  const CameraPath perspective = read(
      R"({"note": "ours", "key_frames": [{"time": -1, "position": [1, 0, 0], "focal_point": [0, 0, 0],
          "view_up": [0, 1, 0], "view_angle": 40}]})");
  EXPECT_EQ(perspective.at(0).projection, Projection::kPerspective);
  EXPECT_EQ(perspective.at(0).view_angle_deg, 40);
}

TEST_F(CameraPathFile, NamesTheWrongField) {
  expectRefused("", "expected a camera path");
  expectRefused("[1, 2", "expected a camera path");
  expectRefused("\xff\xfe\x01", "expected a camera path");
  expectRefused("[]", "found [], expected an object");
  expectRefused("{}", "key_frames");
  expectRefused(R"({"key_frames": 7})", "expected a list");
  expectRefused(file(""), "at least one key frame");
  expectRefused(file("null"), "key_frames[0]");
  expectRefused(file(keyFrame() + ", [1]"), "key_frames[1]");
  expectRefused(file(keyFrame() + "," + keyFrame()), "times must increase");
  expectRefused(file(keyFrame() + "," + keyFrame("time", "1.0000000001")), "times must increase");
  expectRefused(file(keyFrame() + "," + keyFrame("time", "0")), "key frame 1 is at time 0");
  expectRefused(file(keyFrame() + R"(, {"time": 3, "position": [1, 0, 0], "focal_point": [0, 0, 0],
                                      "view_up": [0, 1, 0], "view_angle": 40})"),
                "perspective");
  expectRefused(std::string(100'000, '['), "brackets more than 64 deep");
  std::string many = keyFrame();
  for (int n = 0; n < 100'000; ++n) many += ",0";
  expectRefused(file(many), "at most 100000");

  const struct {
    const char *field, *text, *word;
  } cases[] = {{"time", "", "is missing"},
               {"time", "\"now\"", "\"now\""},
               {"time", "1e31", "1e+30"},
               {"time", "1e999", "JSON"},
               {"time", "null", "null"},
               {"position", "", "is missing"},
               {"position", "[1, 2]", "three numbers"},
               {"position", "[1, 2, 3, 4]", "three numbers"},
               {"position", "[1, 2, \"3\"]", "position[2]"},
               {"position", "{\"x\": 1}", "found an object"},
               {"position", "[1, 2, -2e30]", "1e+30"},
               {"position", "[0, 0, 0.5]", "another point"},
               {"focal_point", "true", "true"},
               {"view_up", "", "is missing"},
               {"view_up", "[0, 0, 0]", "a direction"},
               {"parallel_scale", "", "neither"},
               {"parallel_scale", "0", "above zero"},
               {"parallel_scale", "-1", "above zero"},
               {"parallel_scale", "\"big\"", "\"big\""},
               {"parallel_scale", "1, \"view_angle\": 30", "both"}};
  for (const auto& c : cases) {
    SCOPED_TRACE(std::string(c.field) + " " + c.text);
    expectRefused(file(keyFrame("none") + "," + keyFrame(c.field, c.text)), c.word);
    if (std::string(c.word) != "JSON") expectRefused(file(keyFrame(c.field, c.text)), c.field);
  }
  for (const char* angle : {"0", "180", "-3", "1e30", "[]"})
    expectRefused(
        file(keyFrame("parallel_scale", "")).insert(17, std::string("\"view_angle\": ") + angle + ", "),
        "view_angle");
}

TEST_F(CameraPathFile, NamesTheTimeAtWhichTheCameraMeetsItsFocalPoint) {
  const CameraPath path = read(file(keyFrame("focal_point", "[0, 0, 0]") + "," +
                                    R"({"time": 2, "position": [-1, -2, -3], "focal_point": [0, 0, 0],
                                        "view_up": [0, 0, 1], "parallel_scale": 1})"));
  EXPECT_NO_THROW(path.at(1.25));
  EXPECT_THROW(path.at(1.5), Error);
}

}  // namespace
}  // namespace curvisplat
