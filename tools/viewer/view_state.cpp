#include "tools/viewer/view_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

#include "render/automatic/first_choice.h"
#include "render/mesh/mesh_file.h"
#include "stream/base/error.h"
#include "stream/base/json_text.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMaxSurfaces = 64;

/// Fields of one object of a state file.
class Fields {
 public:
  Fields(const std::filesystem::path& path, std::string name, const Json& object)
      : path_(path), name_(std::move(name)), object_(object) {
    if (!object.is_object())
      throw Error("{}: {}expected an object, found {}", path_.string(),
                  name_.empty() ? "" : fmt::format("field {}: ", name_.substr(0, name_.size() - 1)),
                  object.dump().substr(0, 60));
  }

  Fields object(const char* field) const { return Fields(path_, name_ + field + ".", at(field)); }
  /// The objects of an array, of at most `most`.
  std::vector<Fields> objects(const char* field, size_t most) const {
    const Json& array = at(field);
    if (!array.is_array() || array.size() > most) fail(field, fmt::format("at most {} objects", most));
    std::vector<Fields> all;
    for (size_t n = 0; n < array.size(); ++n)
      all.emplace_back(path_, fmt::format("{}{}[{}].", name_, field, n), array[n]);
    return all;
  }
  bool has(const char* field) const { return object_.contains(field) && !object_.at(field).is_null(); }

  const Json& at(const char* field) const {
    const auto found = object_.find(field);
    if (found == object_.end()) fail(field, "a value");
    return *found;
  }
  double number(const char* field, double at_least, double at_most) const {
    const Json& value = at(field);
    if (!value.is_number() || !(value >= at_least && value <= at_most))
      fail(field, fmt::format("a number from {} to {}", at_least, at_most));
    return value.get<double>();
  }
  double positive(const char* field) const { return number(field, 1e-300, 1e300); }
  bool flag(const char* field) const {
    if (!at(field).is_boolean()) fail(field, "true or false");
    return at(field).get<bool>();
  }
  std::string text(const char* field) const {
    if (!at(field).is_string()) fail(field, "a string");
    return at(field).get<std::string>();
  }
  glm::dvec3 point(const char* field) const {
    const Json& value = at(field);
    if (!value.is_array() || value.size() != 3) fail(field, "three numbers");
    glm::dvec3 result;
    for (int axis = 0; axis < 3; ++axis) {
      const Json& number = value[static_cast<size_t>(axis)];
      if (!number.is_number() || !std::isfinite(number.get<double>())) fail(field, "three numbers");
      result[axis] = number.get<double>();
    }
    return result;
  }
  [[noreturn]] void fail(const char* field, std::string_view expected) const {
    const auto found = object_.is_object() ? object_.find(field) : object_.end();
    throw Error("{}: field {}{}: expected {}, found {}", path_.string(), name_, field, expected,
                found == object_.end() ? "none" : found->dump().substr(0, 60));
  }

 private:
  const std::filesystem::path& path_;
  std::string name_;
  const Json& object_;
};

Json jsonOf(const glm::dvec3& point) {
  return {point.x, point.y, point.z};
}

Json jsonOf(const std::vector<ClipPlane>& planes) {
  Json json = Json::array();
  for (const ClipPlane& plane : planes)
    json.push_back({{"point", jsonOf(plane.point)}, {"normal", jsonOf(plane.normal)}});
  return json;
}

/// At most `most`; states of earlier versions have none.
std::vector<ClipPlane> planesFrom(const Fields& fields, const char* name, size_t most) {
  std::vector<ClipPlane> planes;
  if (!fields.has(name)) return planes;
  for (const Fields& field : fields.objects(name, most)) {
    planes.push_back({field.point("point"), field.point("normal")});
    if (!isUsable(planes.back())) field.fail("normal", "a direction");
  }
  return planes;
}

Json jsonOf(const Camera& camera) {
  return {{"position", jsonOf(camera.position)},
          {"focal_point", jsonOf(camera.focal_point)},
          {"view_up", jsonOf(camera.view_up)},
          {"perspective", camera.projection == Projection::kPerspective},
          {"parallel_scale", camera.parallel_scale},
          {"view_angle", camera.view_angle_deg}};
}

Camera cameraFrom(const Fields& fields) {
  Camera camera;
  camera.position = fields.point("position");
  camera.focal_point = fields.point("focal_point");
  camera.view_up = fields.point("view_up");
  camera.projection = fields.flag("perspective") ? Projection::kPerspective : Projection::kOrthographic;
  camera.parallel_scale = fields.positive("parallel_scale");
  camera.view_angle_deg = fields.number("view_angle", 1e-3, 179);
  if (camera.position == camera.focal_point) fields.fail("position", "another point than focal_point");
  return camera;
}

const VariableInfo* find(const Manifest& manifest, const std::string& name) {
  const auto found = std::find_if(manifest.variables.begin(), manifest.variables.end(),
                                  [&](const VariableInfo& variable) { return variable.name == name; });
  return found == manifest.variables.end() ? nullptr : &*found;
}

double defaultOpacityUnit(const Manifest& manifest, const glm::dvec3& scale) {
  const double diagonal = glm::length(scale * (manifest.upper - manifest.lower));
  return diagonal > 0 ? diagonal / 100 : 1;
}

/// `word` quoted for a shell.
std::string quoted(const std::string& word) {
  const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
    return std::isalnum(c) ||
           std::string_view("_-./,:=+@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string numbers(const glm::dvec3& point) {
  return fmt::format("{},{},{}", point.x, point.y, point.z);
}

}  // namespace

FrameOptions ViewState::frameOptions(ImageSize size) const {
  FrameOptions options;
  options.size = size;
  options.classification = classification;
  options.lod_pixels = lod_pixels;
  options.scale = scale;
  options.clip_box = clip_box;
  options.clip_planes = clip_planes;
  if (lit) options.light = Light{};
  if (!surfaces.empty() || !faces.empty() || !slices.empty() || !isovalues.empty()) {
    auto scene = std::make_shared<SurfaceScene>();
    for (const SurfaceFile& surface : surfaces)
      if (surface.mesh) scene->surfaces.push_back({surface.mesh, surface.colour});
    for (const NamedFaces& named : faces) scene->grid_surfaces.push_back(named.surface);
    scene->slices = slices;
    scene->slice_opacity = slice_opacity;
    // Inside the volume they share a table with the function, which is linear then.
    if (!volume || !function.function().logScale()) scene->isovalues = isovalues;
    scene->iso_opacity = iso_opacity;
    scene->volume = volume;
    options.scene = std::move(scene);
  }
  options.background = background();
  options.memory_bytes = memory_bytes;
  return options;
}

ViewState firstViewOf(const Manifest& manifest, ImageSize picture) {
  if (manifest.variables.empty())
    throw Error("{}: the cache contains no scalar; convert the grid again with a scalar", manifest.title);
  const VariableInfo& variable = manifest.variables[firstVaryingVariable(manifest)];
  ViewState state{
      variable.name,
      {},
      EditedFunction("viridis", variable.min, variable.max, defaultOpacityUnit(manifest, glm::dvec3(1)))};
  state.camera = Camera::named("iso", manifest.lower, manifest.upper,
                               dataSize(state.annotations, picture, state.function.function()),
                               Projection::kOrthographic);
  return state;
}

void loadSurfaces(ViewState& state) {
  for (SurfaceFile& surface : state.surfaces)
    if (!surface.mesh) surface.mesh = std::make_shared<TriangleMesh>(readMeshFile(surface.path));
}

void chooseVariable(ViewState& state, const Manifest& manifest, const std::string& name) {
  const VariableInfo* const variable = find(manifest, name);
  if (!variable) {
    std::string names;
    for (const VariableInfo& one : manifest.variables) names += (names.empty() ? "" : ", ") + one.name;
    throw UsageError("the cache has no scalar {}; expected one of {}", name, names);
  }
  state.variable = name;
  state.function.fitRange(variable->min, variable->max);
}

std::string toJson(const ViewState& state) {
  Json json = {{"curvisplat_view", 1}, {"variable", state.variable}, {"camera", jsonOf(state.camera)}};
  json["preset"] = state.function.preset();
  json["function"] = Json::parse(toParaViewPreset(state.function.definition())).front();
  json["lod_pixels"] = state.lod_pixels;
  json["memory_bytes"] = state.memory_bytes;
  json["flat"] = state.classification == Classification::kFlat;
  json["scale"] = jsonOf(state.scale);
  json["clip_box"] = nullptr;
  if (state.clip_box)
    json["clip_box"] = {{"lower", jsonOf(state.clip_box->lower)}, {"upper", jsonOf(state.clip_box->upper)}};
  json["clip_planes"] = jsonOf(state.clip_planes);
  json["surfaces"] = Json::array();
  for (const SurfaceFile& surface : state.surfaces)
    json["surfaces"].push_back(
        {{"file", surface.path.string()}, {"colour", jsonOf(glm::dvec3(surface.colour))}});
  json["slices"] = jsonOf(state.slices);
  json["slice_opacity"] = state.slice_opacity;
  json["volume"] = state.volume;
  json["lit"] = state.lit;
  json["dark"] = state.dark;
  json["scalar_bar"] = state.annotations.scalar_bar;
  json["axes"] = state.annotations.axes;
  json["axes_grid"] = state.annotations.axes_grid;
  json["outline"] = state.annotations.outline;
  return json.dump(1) + "\n";
}

ViewState viewStateFromJson(const std::string& text, const std::filesystem::path& path,
                            const Manifest& manifest) {
  requireShallowJson(text, path.string());
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::exception& error) {
    throw Error("{}: expected the state of a window in JSON, found {}", path.string(),
                jsonFault(text, error));
  }
  const Fields fields(path, "", json);
  if (fields.number("curvisplat_view", 0, 1e9) != 1)
    fields.fail("curvisplat_view", "1, the only version this program reads");

  const std::string variable = fields.text("variable");
  if (!find(manifest, variable)) fields.fail("variable", "a scalar of the cache");
  const Camera camera = cameraFrom(fields.object("camera"));
  const glm::dvec3 scale = fields.point("scale");
  if (!(std::min({scale.x, scale.y, scale.z}) > 0)) fields.fail("scale", "three numbers above zero");
  EditedFunction function(parseParaViewPreset(fields.at("function").dump(), path),
                          defaultOpacityUnit(manifest, scale));
  if (const std::string preset = fields.text("preset"); preset == EditedFunction::kAutomatic) {
    function.setAutomatic();
  } else if (!preset.empty()) {
    try {
      function =
          EditedFunction(preset, function.range().first, function.range().second, function.opacityUnit());
    } catch (const UsageError&) {
      fields.fail("preset", "the name of a colour map (curvisplat colormaps lists them)");
    }
  }

  ViewState state{variable, camera, function};
  state.lod_pixels = fields.number("lod_pixels", 0, 1e6);
  state.memory_bytes = static_cast<uint64_t>(fields.number("memory_bytes", 1, 1e18));
  state.classification = fields.flag("flat") ? Classification::kFlat : Classification::kPixel;
  state.scale = scale;
  if (fields.has("clip_box")) {
    const Fields box = fields.object("clip_box");
    state.clip_box = WorldBox{box.point("lower"), box.point("upper")};
    for (int axis = 0; axis < 3; ++axis)
      if (state.clip_box->lower[axis] > state.clip_box->upper[axis]) box.fail("lower", "less than upper");
  }
  state.clip_planes = planesFrom(fields, "clip_planes", kMaxClipPlanes);
  state.slices = planesFrom(fields, "slices", kMaxSlices);
  if (fields.has("surfaces"))
    for (const Fields& field : fields.objects("surfaces", kMaxSurfaces)) {
      const glm::dvec3 colour = field.point("colour");
      for (int c = 0; c < 3; ++c)
        if (!(colour[c] >= 0 && colour[c] <= 1)) field.fail("colour", "three numbers from 0 to 1");
      state.surfaces.push_back({field.text("file"), glm::vec3(colour)});
    }
  if (fields.has("slice_opacity")) state.slice_opacity = fields.number("slice_opacity", 1e-3, 1);
  if (fields.has("volume")) state.volume = fields.flag("volume");
  state.lit = fields.has("lit") && fields.flag("lit");
  state.dark = fields.flag("dark");
  state.annotations = {fields.flag("scalar_bar"), fields.flag("axes"), fields.flag("outline"),
                       fields.has("axes_grid") && fields.flag("axes_grid")};
  return state;
}

std::string renderCommand(const ViewState& state, const std::filesystem::path& cache, ImageSize size,
                          const std::filesystem::path& function_file) {
  std::string command = "curvisplat render " + quoted(cache.string()) + " -o picture.png";
  const auto add = [&](const std::string& option, const std::string& value) {
    // The parser would take a separate value with a minus sign for an option.
    command +=
        value.starts_with('-') ? " " + option + "=" + quoted(value) : " " + option + " " + quoted(value);
  };
  add("--size", fmt::format("{}x{}", size.width, size.height));
  add("--scalar", state.variable);
  const EditedFunction& function = state.function;
  if (!function.isPreset()) {
    add("--tf", function_file.string());
  } else {
    add("--tf", function.preset());
    add("--range", fmt::format("{},{}", function.range().first, function.range().second));
  }
  add("--opacity-unit", fmt::format("{}", function.opacityUnit()));
  add("--position", numbers(state.camera.position));
  add("--focal-point", numbers(state.camera.focal_point));
  add("--view-up", numbers(state.camera.view_up));
  if (state.camera.projection == Projection::kPerspective)
    add("--view-angle", fmt::format("{}", state.camera.view_angle_deg));
  else
    add("--parallel-scale", fmt::format("{}", state.camera.parallel_scale));
  add("--lod-pixels", fmt::format("{}", state.lod_pixels));
  if (state.classification == Classification::kFlat) add("--classify", "flat");
  if (state.scale != glm::dvec3(1.0)) add("--scale", numbers(state.scale));
  if (state.clip_box) {
    const auto& [lower, upper] = *state.clip_box;
    add("--clip-box", fmt::format("{},{},{},{},{},{}", lower.x, upper.x, lower.y, upper.y, lower.z, upper.z));
  }
  for (const ClipPlane& plane : state.clip_planes)
    add("--clip-plane", numbers(plane.point) + "," + numbers(plane.normal));
  if (state.lit) command += " --shade";
  const auto add_colour = [&](const glm::vec3& colour) {
    const glm::ivec3 rgb(255.0f * colour + 0.5f);
    add("--surface-colour", fmt::format("#{:02x}{:02x}{:02x}", rgb.r, rgb.g, rgb.b));
  };
  for (const SurfaceFile& surface : state.surfaces) add("--surface", surface.path.string());
  for (const NamedFaces& named : state.faces) add("--surface", named.name);
  for (const SurfaceFile& surface : state.surfaces) add_colour(surface.colour);
  for (const NamedFaces& named : state.faces) add_colour(named.surface.colour);
  if (!state.faces_by.empty()) add("--surface-by", state.faces_by);
  for (const ClipPlane& plane : state.slices)
    add("--slice", numbers(plane.point) + "," + numbers(plane.normal));
  if (state.slice_opacity != 1 && !state.slices.empty())
    add("--slice-opacity", fmt::format("{}", state.slice_opacity));
  if (!state.isovalues.empty()) {
    add("--iso", fmt::format("{}", fmt::join(state.isovalues, ",")));
    add("--iso-opacity", fmt::format("{}", state.iso_opacity));
  }
  if (!state.volume &&
      !(state.slices.empty() && state.surfaces.empty() && state.faces.empty() && state.isovalues.empty()))
    add("--volume", "off");
  add("--background", state.dark ? "black" : "white");
  if (state.annotations.scalar_bar) command += " --scalar-bar";
  if (state.annotations.axes) command += " --axes";
  if (state.annotations.axes_grid) command += " --axes-grid";
  if (state.annotations.outline) command += " --outline";
  return command;
}

}  // namespace curvisplat
