#include "render/film/film.h"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "render/colour/function_blend.h"
#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;
using Planes = std::vector<ClipPlane>;

// Squares of larger lengths overflow.
constexpr double kLargestNumber = 1e30;

ClipPlane between(const ClipPlane& a, const ClipPlane& b, double part) {
  glm::dvec3 across(0.0);  // for opposite normals: the axis that is the furthest from them
  const glm::dvec3 size = glm::abs(a.normal);
  across[size.x <= size.y && size.x <= size.z ? 0 : size.y <= size.z ? 1 : 2] = 1;
  return {glm::mix(a.point, b.point, part), directionBetween(a.normal, b.normal, across, part)};
}

Planes between(const Planes& a, const Planes& b, double part) {
  Planes planes = a;
  if (a.size() != b.size()) return planes;
  for (size_t n = 0; n < a.size(); ++n) planes[n] = between(a[n], b[n], part);
  return planes;
}

/// Parts of one map stay parts: what blended() makes of their definitions, shorter. nullopt for others.
std::optional<FunctionParts> between(const std::optional<FunctionParts>& a,
                                     const std::optional<FunctionParts>& b, double part) {
  if (!a || !b || a->map != b->map || a->asinh || b->asinh || a->opacities.size() != b->opacities.size())
    return std::nullopt;
  FunctionParts parts = *a;
  parts.range = {std::lerp(a->range.first, b->range.first, part),
                 std::lerp(a->range.second, b->range.second, part)};
  for (size_t n = 0; n < parts.opacities.size(); ++n)
    parts.opacities[n] = {std::lerp(a->opacities[n].x, b->opacities[n].x, part),
                          std::lerp(a->opacities[n].opacity, b->opacities[n].opacity, part)};
  parts.opacity_unit = std::exp(std::lerp(std::log(a->opacity_unit), std::log(b->opacity_unit), part));
  return parts;
}

KeyLook between(const KeyLook& a, const KeyLook& b, double part) {
  KeyLook look;
  if (const auto parts = between(a.parts, b.parts, part))
    look.setFunction(*parts);
  else if (a.function)
    look.function = blended(*a.function, *b.function, part);
  look.clip_box = a.clip_box;
  if (a.clip_box && b.clip_box)
    look.clip_box = WorldBox{glm::mix(a.clip_box->lower, b.clip_box->lower, part),
                             glm::mix(a.clip_box->upper, b.clip_box->upper, part)};
  if (a.clip_planes) look.clip_planes = between(*a.clip_planes, *b.clip_planes, part);
  if (a.slices) look.slices = between(*a.slices, *b.slices, part);
  return look;
}

/// The function as a file has it: by options' names, or as a preset of ParaView's.
Json functionJson(const KeyLook& look) {
  if (look.parts) return jsonOf(*look.parts);
  return Json::parse(toParaViewPreset(*look.function)).front();
}

/// Numbers that JSON lists; exactly `count`, of magnitudes that can be squared.
std::vector<double> numbersFrom(const JsonField& field, size_t count, const char* what) {
  std::vector<double> numbers = field.numbers();
  if (numbers.size() != count) field.fail(what);
  for (const double number : numbers)
    if (!(std::abs(number) <= kLargestNumber)) field.fail(what);
  return numbers;
}

std::optional<Planes> planesFrom(const JsonField& fields, const char* name, size_t most) {
  const auto list = fields.find(name);
  if (!list) return std::nullopt;
  Planes planes;
  for (const JsonField& entry : list->elements(most)) {
    const std::vector<double> n = numbersFrom(entry, 6, "six numbers, px,py,pz,nx,ny,nz");
    planes.push_back({{n[0], n[1], n[2]}, {n[3], n[4], n[5]}});
    if (!isUsable(planes.back())) entry.fail("a normal nx,ny,nz other than 0,0,0");
  }
  return planes;
}

Json jsonOf(const Planes& planes) {
  Json json = Json::array();
  for (const auto& [p, n] : planes) json.push_back({p.x, p.y, p.z, n.x, n.y, n.z});
  return json;
}

/// Points of functions between key frames must not overflow.
template <typename Point>
bool hasModestPlaces(const std::vector<Point>& points) {
  return std::ranges::all_of(points, [](const Point& p) { return std::abs(p.x) <= kLargestNumber; });
}

void takeFunction(const JsonField& field, const std::string& place, KeyLook& look) {
  if (!field.has("map")) {
    look.function = parseParaViewPreset(field.json().dump(), place);
    if (!(look.function->opacity_unit > 0)) field.at("ScalarOpacityUnitDistance");  // is missing
    if (!hasModestPlaces(look.function->colours) || !hasModestPlaces(look.function->opacities))
      field.fail("points at scalars up to 1e30");
    TransferFunction(*look.function, nullptr, 1);  // throws where a logarithmic scale has points below zero
    return;
  }
  const FunctionParts parts = functionPartsFrom(field);
  if (!(std::max(std::abs(parts.range.first), std::abs(parts.range.second)) <= kLargestNumber))
    field.at("range").fail("numbers up to 1e30");
  try {
    look.setFunction(parts);
  } catch (const UsageError&) {
    field.at("map").fail("the name of a colour map (curvisplat colormaps lists them)");
  }
}

glm::dvec3 scaleFrom(const JsonField& field) {
  const glm::dvec3 scale = field.point(kMaxScale);
  if (!(scale.x >= kMinScale && scale.y >= kMinScale && scale.z >= kMinScale))
    field.fail("three numbers between 1e-6 and 1e6");
  return scale;
}

KeyLook lookFrom(const JsonField& fields, const std::string& place) {
  KeyLook look;
  if (const auto function = fields.find("function")) takeFunction(*function, place + ".function", look);
  if (const auto box = fields.find("clip_box")) {
    const auto n = numbersFrom(*box, 6, "six numbers, x0,x1,y0,y1,z0,z1");
    look.clip_box = WorldBox{{n[0], n[2], n[4]}, {n[1], n[3], n[5]}};
    if (!(n[0] < n[1] && n[2] < n[3] && n[4] < n[5])) box->fail("x0 < x1, y0 < y1 and z0 < z1");
  }
  look.clip_planes = planesFrom(fields, "clip_planes", kMaxClipPlanes);
  look.slices = planesFrom(fields, "slices", kMaxSlices);
  return look;
}

}  // namespace

void KeyLook::setFunction(const FunctionParts& from) {
  function = from.definition();
  function->opacity_unit = from.opacity_unit;
  parts = from;
}

Film::Film(CameraPath cameras, std::vector<KeyLook> looks, std::string scalar, const std::string& name,
           std::optional<glm::dvec3> scale)
    : cameras_(std::move(cameras)), looks_(std::move(looks)), scalar_(std::move(scalar)), scale_(scale) {
  CURVISPLAT_CHECK_OP(looks_.size(), ==, cameras_.keyFrames().size());
  for (size_t n = 0; n < looks_.size(); ++n) {
    const auto &first = looks_[0].function, &function = looks_[n].function;
    if (function.has_value() != first.has_value())
      throw Error("{}: key frame {} has {} but the first one has {}; all key frames need it, or none", name,
                  n, function ? "a function" : "no function", first ? "one" : "none");
    if (function && function->log_scale != first->log_scale)
      throw Error(
          "{}: the function of key frame {} has a {} scale but that of the first one has not; all need the "
          "same",
          name, n, function->log_scale ? "logarithmic" : "linear");
    stated_.functions |= function.has_value();
    stated_.clip_boxes |= looks_[n].clip_box.has_value();
    stated_.clip_planes |= looks_[n].clip_planes.has_value();
    stated_.slices |= looks_[n].slices.has_value();
    if (n > 0 && function && functionJson(looks_[n]) != functionJson(looks_[n - 1])) functions_change_ = true;
  }
  for (KeyLook& look : looks_) {
    if (stated_.clip_planes && !look.clip_planes) look.clip_planes.emplace();
    if (stated_.slices && !look.slices) look.slices.emplace();
  }
}

Film Film::inScale(const glm::dvec3& scale) const {
  Film moved = *this;
  if (!scale_ || *scale_ == scale) return moved;
  std::vector<KeyFrame> keys = cameras_.keyFrames();
  for (KeyFrame& key : keys) key.camera = rescaled(key.camera, *scale_, scale);
  moved.cameras_ = CameraPath(std::move(keys), cameras_.name());
  moved.scale_ = scale;
  return moved;
}

double Film::timeOf(uint64_t frame, uint64_t frames) const {
  if (frames <= 1) return cameras_.begin();
  if (frame + 1 == frames) return cameras_.end();
  const double step = (cameras_.end() - cameras_.begin()) / static_cast<double>(frames - 1);
  return cameras_.begin() + step * static_cast<double>(frame);
}

KeyLook Film::lookAt(double time) const {
  const std::vector<KeyFrame>& keys = cameras_.keyFrames();
  const auto after = std::ranges::upper_bound(keys, time, {}, &KeyFrame::time);
  if (after == keys.begin()) return looks_.front();
  const auto n = static_cast<size_t>(after - keys.begin()) - 1;
  if (after == keys.end() || time == keys[n].time) return looks_[n];
  return between(looks_[n], looks_[n + 1], (time - keys[n].time) / (after->time - keys[n].time));
}

Film Film::fromFile(const std::filesystem::path& path) {
  const JsonDocument document(readTextFile(path), path.string(), "a camera path");
  const JsonField root = document.root();
  CameraPath cameras = CameraPath::fromJson(root, path.string());
  std::vector<KeyLook> looks;
  for (const JsonField& key : root.at("key_frames").elements())
    looks.push_back(lookFrom(key, fmt::format("{}: key_frames[{}]", path.string(), looks.size())));
  const auto scalar = root.find("scalar"), scale = root.find("scale");
  return Film(std::move(cameras), std::move(looks), scalar ? scalar->text() : "", path.string(),
              scale ? std::optional(scaleFrom(*scale)) : std::nullopt);
}

std::string Film::toJson() const {
  const auto point = [](const glm::dvec3& p) { return Json{p.x, p.y, p.z}; };
  std::vector<std::string> keys;  // each a line, so that people can find and change it
  for (size_t n = 0; n < looks_.size(); ++n) {
    const auto& [time, camera, series_time] = cameras_.keyFrames()[n];
    const KeyLook& look = looks_[n];
    Json key = {{"time", time},
                {"position", point(camera.position)},
                {"focal_point", point(camera.focal_point)},
                {"view_up", point(camera.view_up)}};
    if (camera.projection == Projection::kPerspective)
      key["view_angle"] = camera.view_angle_deg;
    else
      key["parallel_scale"] = camera.parallel_scale;
    if (series_time) key["series_time"] = *series_time;
    if (look.function) key["function"] = functionJson(look);
    if (look.clip_box) {
      const auto& [lower, upper] = *look.clip_box;
      key["clip_box"] = {lower.x, upper.x, lower.y, upper.y, lower.z, upper.z};
    }
    if (look.clip_planes) key["clip_planes"] = jsonOf(*look.clip_planes);
    if (look.slices) key["slices"] = jsonOf(*look.slices);
    keys.push_back(key.dump());
  }
  std::string stated = scalar_.empty() ? "" : fmt::format("\"scalar\": {}, ", Json(scalar_).dump());
  if (scale_) stated += fmt::format("\"scale\": {}, ", point(*scale_).dump());
  return fmt::format("{{{}\"key_frames\": [\n{}]}}\n", stated, fmt::join(keys, ",\n"));
}

}  // namespace curvisplat
