#include "render/camera/camera_path.h"

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"

namespace curvisplat {
namespace {

constexpr double kMinSpan = 1e-6;

/// `v` rotated by `angle` about the unit vector `axis` (Rodrigues' formula).
glm::dvec3 turned(const glm::dvec3& v, const glm::dvec3& axis, double angle) {
  const double cosine = std::cos(angle), sine = std::sin(angle);
  return cosine * v + sine * glm::cross(axis, v) + (1 - cosine) * glm::dot(axis, v) * axis;
}

/// The quantities that are interpolated as numbers.
struct Track {
  glm::dvec3 position{0.0}, focal_point{0.0};
  double zoom = 0;  // logarithm of the parallel scale, or of the half view angle's tangent

  explicit Track(const Camera& camera) : position(camera.position), focal_point(camera.focal_point) {
    zoom = camera.projection == Projection::kOrthographic
               ? std::log(camera.parallel_scale)
               : std::log(std::tan(0.5 * glm::radians(camera.view_angle_deg)));
  }
  Track(const glm::dvec3& position_, const glm::dvec3& focal_point_, double zoom_)
      : position(position_), focal_point(focal_point_), zoom(zoom_) {}

  friend Track operator+(const Track& a, const Track& b) {
    return {a.position + b.position, a.focal_point + b.focal_point, a.zoom + b.zoom};
  }
  friend Track operator*(double f, const Track& a) { return {f * a.position, f * a.focal_point, f * a.zoom}; }
  friend Track operator-(const Track& a, const Track& b) { return a + -1.0 * b; }
};

/// Change per unit of time between two key frames.
Track secant(const KeyFrame& a, const KeyFrame& b) {
  return 1 / (b.time - a.time) * (Track(b.camera) - Track(a.camera));
}

Track slopeAt(const std::vector<KeyFrame>& keys, size_t n) {
  if (n == 0) return secant(keys[0], keys[1]);
  if (n + 1 == keys.size()) return secant(keys[n - 1], keys[n]);
  const double before = keys[n].time - keys[n - 1].time, after = keys[n + 1].time - keys[n].time;
  return 1 / (before + after) *
         (after * secant(keys[n - 1], keys[n]) + before * secant(keys[n], keys[n + 1]));
}

}  // namespace

glm::dvec3 directionBetween(const glm::dvec3& from_, const glm::dvec3& to_, const glm::dvec3& around,
                            double part) {
  const glm::dvec3 from = glm::normalize(from_), to = glm::normalize(to_);
  const glm::dvec3 across = glm::cross(from, to);
  const double angle = std::atan2(glm::length(across), glm::dot(from, to));
  if (angle == 0) return from_;
  const bool opposite = glm::length(across) < 1e-9;
  const glm::dvec3 axis = opposite ? around - glm::dot(around, from) * from : across;
  return turned(from, glm::normalize(axis), part * angle);
}

Camera orbited(const Camera& camera, double degrees) {
  const double angle = glm::radians(std::remainder(degrees, 360.0));
  if (angle == 0) return camera;
  Camera moved = camera;
  moved.view_up = camera.usableViewUp();
  const glm::dvec3 arm = camera.position - camera.focal_point;
  moved.position = camera.focal_point + turned(arm, glm::normalize(moved.view_up), angle);
  return moved;
}

Camera elevated(const Camera& camera, double degrees) {
  const double angle = glm::radians(std::remainder(degrees, 360.0));
  if (angle == 0) return camera;
  const double nearest = std::cos(glm::radians(1.0));
  Camera moved = camera;
  const glm::dvec3 up = camera.usableViewUp(), arm = camera.position - camera.focal_point;
  const glm::dvec3 left = glm::normalize(glm::cross(arm, up));
  const glm::dvec3 moved_arm = turned(arm, left, angle);
  moved.position = camera.focal_point + moved_arm;
  const bool over = glm::dot(glm::cross(moved_arm, up), left) <= 0;
  const bool along = std::abs(glm::dot(moved_arm, up)) > nearest * glm::length(arm) * glm::length(up);
  moved.view_up = over || along ? turned(up, left, angle) : up;
  return moved;
}

Camera rolled(const Camera& camera, double degrees) {
  const double angle = glm::radians(std::remainder(degrees, 360.0));
  if (angle == 0) return camera;
  Camera moved = camera;
  moved.view_up = turned(camera.usableViewUp(), glm::normalize(camera.focal_point - camera.position), angle);
  return moved;
}

Camera magnified(const Camera& camera, double factor) {
  Camera nearer = camera;
  if (camera.projection == Projection::kOrthographic)
    nearer.parallel_scale /= factor;
  else
    nearer.view_angle_deg /= factor;
  return nearer;
}

Camera rescaled(const Camera& camera, const glm::dvec3& from, const glm::dvec3& to) {
  Camera moved = camera;
  const glm::dvec3 way = camera.focal_point * (to / from - 1.0);
  moved.focal_point += way;
  moved.position += way;
  return moved;
}

CameraPath::CameraPath(std::vector<KeyFrame> key_frames, std::string name)
    : key_frames_(std::move(key_frames)), name_(std::move(name)) {
  if (key_frames_.empty()) throw Error("{}: a camera path needs at least one key frame, found none", name_);
  for (size_t n = 1; n < key_frames_.size(); ++n) {
    if (!(key_frames_[n].time - key_frames_[n - 1].time >= kMinSpan))
      throw Error(
          "{}: key frame {} is at time {} and the one before it at {}; times must increase by a microsecond "
          "or "
          "more",
          name_, n, key_frames_[n].time, key_frames_[n - 1].time);
    if (key_frames_[n].camera.projection != key_frames_[0].camera.projection)
      throw Error(
          "{}: key frame {} is {} but the first one is not; all key frames need the same projection", name_,
          n, key_frames_[n].camera.projection == Projection::kPerspective ? "perspective" : "orthographic");
    if (key_frames_[n].series_time.has_value() != key_frames_[0].series_time.has_value())
      throw Error("{}: key frame {} has {} but the first one has {}; all key frames need it, or none", name_,
                  n, key_frames_[n].series_time ? "a series_time" : "no series_time",
                  key_frames_[0].series_time ? "one" : "none");
  }
}

double CameraPath::seriesTimeAt(double time) const {
  const auto after = std::upper_bound(key_frames_.begin(), key_frames_.end(), time,
                                      [](double t, const KeyFrame& key) { return t < key.time; });
  if (after == key_frames_.begin()) return *key_frames_.front().series_time;
  const KeyFrame& a = *(after - 1);
  if (after == key_frames_.end()) return *a.series_time;
  const double part = (time - a.time) / (after->time - a.time);
  return *a.series_time + part * (*after->series_time - *a.series_time);
}

Camera CameraPath::at(double time) const {
  const auto after = std::upper_bound(key_frames_.begin(), key_frames_.end(), time,
                                      [](double t, const KeyFrame& key) { return t < key.time; });
  if (after == key_frames_.begin()) return key_frames_.front().camera;
  const auto n = static_cast<size_t>(after - key_frames_.begin()) - 1;
  const KeyFrame& a = key_frames_[n];
  if (after == key_frames_.end() || time == a.time) return a.camera;
  const KeyFrame& b = *after;

  const double span = b.time - a.time, s = (time - a.time) / span, r = 1 - s;
  const Track track = r * r * (1 + 2 * s) * Track(a.camera) + s * s * (1 + 2 * r) * Track(b.camera) +
                      span * s * r * (r * slopeAt(key_frames_, n) - s * slopeAt(key_frames_, n + 1));
  Camera camera = a.camera;
  camera.position = track.position;
  camera.focal_point = track.focal_point;
  if (camera.position == camera.focal_point)
    throw Error(
        "{}: at time {}, after key frame {}, the camera passes through its focal point; add a key frame",
        name_, time, n);
  if (camera.projection == Projection::kOrthographic)
    camera.parallel_scale = std::exp(track.zoom);
  else
    camera.view_angle_deg = 2 * glm::degrees(std::atan(std::exp(track.zoom)));
  camera.view_up =
      directionBetween(a.camera.view_up, b.camera.view_up, a.camera.focal_point - a.camera.position, s);
  return camera;
}

// Key frames from JSON; tools/REFERENCE.md, "Cameras", describes the file.

namespace {

constexpr size_t kMaxKeyFrames = 100'000;
// Squares of larger lengths overflow.
constexpr double kLargestNumber = 1e30;

double numberOf(const JsonField& field) {
  return field.number(-kLargestNumber, kLargestNumber);
}

KeyFrame keyFrame(const JsonField& fields) {
  KeyFrame key;
  key.time = numberOf(fields.at("time"));
  key.camera.position = fields.at("position").point(kLargestNumber);
  key.camera.focal_point = fields.at("focal_point").point(kLargestNumber);
  if (key.camera.position == key.camera.focal_point)
    fields.at("focal_point").fail("another point than position");
  key.camera.view_up = fields.at("view_up").point(kLargestNumber);
  if (!(glm::length(key.camera.view_up) > 0)) fields.at("view_up").fail("a direction");
  const auto scale = fields.find("parallel_scale"), angle = fields.find("view_angle");
  if (scale.has_value() == angle.has_value())
    fields.fail(fmt::format("one of parallel_scale and view_angle, not {}", scale ? "both" : "neither"));
  if (angle) {
    key.camera.projection = Projection::kPerspective;
    key.camera.view_angle_deg = numberOf(*angle);
    if (!(key.camera.view_angle_deg > 0 && key.camera.view_angle_deg < 180))
      angle->fail("degrees between 0 and 180");
  } else {
    key.camera.parallel_scale = numberOf(*scale);
    if (!(key.camera.parallel_scale > 0)) scale->fail("a number above zero");
  }
  if (const auto time = fields.find("series_time")) key.series_time = numberOf(*time);
  return key;
}

}  // namespace

CameraPath CameraPath::fromFile(const std::filesystem::path& path) {
  const JsonDocument document(readTextFile(path), path.string(), "a camera path");
  return fromJson(document.root(), path.string());
}

CameraPath CameraPath::fromJson(const JsonField& root, std::string name) {
  std::vector<KeyFrame> key_frames;
  for (const JsonField& key : root.at("key_frames").elements(kMaxKeyFrames))
    key_frames.push_back(keyFrame(key));
  return CameraPath(std::move(key_frames), std::move(name));
}

}  // namespace curvisplat
