// Reads camera paths; tools/REFERENCE.md describes the file.
#include <cmath>
#include <glm/geometric.hpp>

#include "render/camera/camera_path.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"

namespace curvisplat {
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
  std::vector<KeyFrame> key_frames;
  for (const JsonField& key : document.root().at("key_frames").elements(kMaxKeyFrames))
    key_frames.push_back(keyFrame(key));
  return CameraPath(std::move(key_frames), path.string());
}

}  // namespace curvisplat
