// Reads camera paths; tools/REFERENCE.md describes the file.
#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <string_view>

#include "render/camera/camera_path.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_text.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxKeyFrames = 100'000;
// Squares of larger lengths overflow.
constexpr double kLargestNumber = 1e30;

/// `value`, or its type, as one short line.
std::string kind(const Json& value) {
  if (value.is_structured()) return fmt::format("a JSON {}", value.type_name());
  return value.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 60);
}

/// The JSON object of one key frame, with its place in the file for messages.
class KeyFrameObject {
 public:
  KeyFrameObject(const std::string& file, size_t number, const Json& object)
      : place_(fmt::format("{}, key frame {}", file, number)), object_(object) {
    if (!object.is_object()) throw Error("{}: expected a JSON object, found {}", place_, kind(object));
  }

  bool has(const char* field) const { return object_.contains(field); }

  double number(const char* field, double least, double below, std::string_view expected) const {
    const double value = numberIn(field, at(field, expected), expected);
    if (!(value > least && value < below)) fail(field, expected, fmt::format("{}", value));
    return value;
  }

  glm::dvec3 point(const char* field) const {
    constexpr std::string_view kExpected = "three numbers [x, y, z]";
    const Json& value = at(field, kExpected);
    if (!value.is_array()) fail(field, kExpected, kind(value));
    if (value.size() != 3) fail(field, kExpected, fmt::format("{} values", value.size()));
    return {numberIn(field, value[0], kExpected), numberIn(field, value[1], kExpected),
            numberIn(field, value[2], kExpected)};
  }

  [[noreturn]] void fail(std::string_view field, std::string_view expected, std::string_view found) const {
    throw Error("{}, field {}: expected {}, found {}", place_, field, expected, found);
  }

 private:
  const Json& at(const char* field, std::string_view expected) const {
    const auto found = object_.find(field);
    if (found == object_.end()) fail(field, expected, "no such field");
    return *found;
  }
  double numberIn(const char* field, const Json& value, std::string_view expected) const {
    if (!value.is_number()) fail(field, expected, kind(value));
    const double number = value.get<double>();
    if (!(std::abs(number) <= kLargestNumber))
      fail(field, fmt::format("numbers up to {}", kLargestNumber), kind(value));
    return number;
  }

  const std::string place_;
  const Json& object_;
};

KeyFrame keyFrame(const KeyFrameObject& object) {
  KeyFrame key;
  key.time = object.number("time", -INFINITY, INFINITY, "a number, in seconds");
  key.camera.position = object.point("position");
  key.camera.focal_point = object.point("focal_point");
  if (key.camera.position == key.camera.focal_point)
    object.fail("focal_point", "another point than position", "the same");
  key.camera.view_up = object.point("view_up");
  if (!(glm::length(key.camera.view_up) > 0)) object.fail("view_up", "a direction", "[0, 0, 0]");
  if (object.has("parallel_scale") == object.has("view_angle"))
    object.fail("parallel_scale", "it or view_angle", object.has("view_angle") ? "both" : "neither");
  if (object.has("view_angle")) {
    key.camera.projection = Projection::kPerspective;
    key.camera.view_angle_deg = object.number("view_angle", 0, 180, "degrees between 0 and 180");
  } else {
    key.camera.parallel_scale = object.number("parallel_scale", 0, INFINITY, "a number above zero");
  }
  if (object.has("series_time"))
    key.series_time = object.number("series_time", -INFINITY, INFINITY, "a time of the series, a number");
  return key;
}

}  // namespace

CameraPath CameraPath::fromFile(const std::filesystem::path& path) {
  const std::string name = path.string();
  const std::string text = readTextFile(path);
  requireShallowJson(text, name);
  Json file;
  try {
    file = Json::parse(text);
  } catch (const Json::exception& error) {
    throw Error("{}: expected a camera path in JSON, found {}", name, jsonFault(text, error));
  }
  const auto list = file.is_object() ? file.find("key_frames") : file.end();
  if (!file.is_object() || list == file.end())
    throw Error("{}: expected a camera path, an object with a list \"key_frames\"; found {}", name,
                file.is_object() ? "no such field" : kind(file));
  if (!list->is_array()) throw Error("{}, field key_frames: expected a list, found {}", name, kind(*list));
  if (list->size() > kMaxKeyFrames)
    throw Error("{}, field key_frames: expected at most {} key frames, found {}", name, kMaxKeyFrames,
                list->size());
  std::vector<KeyFrame> key_frames;
  for (size_t n = 0; n < list->size(); ++n) key_frames.push_back(keyFrame({name, n, (*list)[n]}));
  return CameraPath(std::move(key_frames), name);
}

}  // namespace curvisplat
