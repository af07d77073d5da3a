#include "tools/view/view_state.h"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "render/automatic/first_choice.h"
#include "render/camera/camera_path.h"
#include "render/colour/function_parts.h"
#include "render/mesh/triangle_mesh.h"
#include "render/project/screen_view.h"
#include "stream/base/error.h"
#include "stream/base/json_document.h"
#include "stream/base/text.h"
#include "tools/view/stated_function.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMaxIsovalues = 64, kMaxMarkers = 1000;

double positive(const JsonField& field) {
  return field.number(1e-300, 1e300);
}

Json jsonOf(const glm::dvec3& point) {
  return {point.x, point.y, point.z};
}

Json jsonOf(const std::vector<ListedPlane>& planes) {
  Json json = Json::array();
  for (const ListedPlane& plane : planes)
    json.push_back(
        {{"point", jsonOf(plane.point)}, {"normal", jsonOf(plane.normal)}, {"visible", plane.visible}});
  return json;
}

/// States of earlier versions have nothing that is hidden.
bool visibleFrom(const JsonField& fields) {
  const auto visible = fields.find("visible");
  return !visible || visible->flag();
}

/// Reads clip planes, at most `most`; states of earlier versions have none.
std::vector<ListedPlane> planesFrom(const JsonField& fields, const char* name, size_t most) {
  std::vector<ListedPlane> planes;
  const auto list = fields.find(name);
  if (!list) return planes;
  for (const JsonField& entry : list->elements(most)) {
    planes.push_back({{entry.at("point").point(), entry.at("normal").point()}, visibleFrom(entry)});
    if (!isUsable(planes.back())) entry.at("normal").fail("a direction");
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

Camera cameraFrom(const JsonField& fields) {
  Camera camera;
  camera.position = fields.at("position").point();
  camera.focal_point = fields.at("focal_point").point();
  camera.view_up = fields.at("view_up").point();
  camera.projection = fields.at("perspective").flag() ? Projection::kPerspective : Projection::kOrthographic;
  camera.parallel_scale = positive(fields.at("parallel_scale"));
  camera.view_angle_deg = fields.at("view_angle").number(1e-3, 179);
  if (camera.position == camera.focal_point) fields.at("position").fail("another point than focal_point");
  return camera;
}

/// The parts of a function as options state them; null if they cannot.
Json partsOf(const EditedFunction& function) {
  const auto parts = function.parts();
  if (!parts) return nullptr;
  return jsonOf(*parts);
}

/// The function of `fields`: preset, parts and points. States of earlier versions have no parts.
EditedFunction functionFrom(const JsonField& fields, const std::filesystem::path& path, double opacity_unit) {
  const JsonField preset = fields.at("preset");
  const bool automatic = preset.text() == EditedFunction::kAutomatic;
  try {
    std::optional<FunctionParts> read;
    if (const auto parts = fields.find("parts")) {
      read = functionPartsFrom(*parts);
      EditedFunction function(*read);
      if (automatic) function.setAutomatic();
      // The points are what counts: who changes them may not know of the parts.
      const Json points = Json::parse(toParaViewPreset(function.definition())).front();
      if (points == fields.at("function").json() && function.preset() == preset.text()) return function;
    }
    const TransferFunctionDefinition points = parseParaViewPreset(fields.at("function").json().dump(), path);
    if (const auto stated = partsOfPoints(points, read, opacity_unit);
        stated && !automatic && preset.text().empty()) {
      const EditedFunction function(*stated);
      if (function.parts()) return function;
    }
    EditedFunction function(points, opacity_unit);
    if (automatic)
      function.setAutomatic();
    else if (!preset.text().empty())
      return EditedFunction(preset.text(), function.range().first, function.range().second,
                            function.opacityUnit());
    return function;
  } catch (const UsageError&) {
    preset.fail("the name of a colour map (curvisplat colormaps lists them)");
  }
}

void put(Json& json, const EditedFunction& function) {
  json["preset"] = function.preset();
  json["parts"] = partsOf(function);
  json["function"] = Json::parse(toParaViewPreset(function.definition())).front();
}

void put(Json& json, const OpacityScalar& opacities) {
  json = {{"variable", opacities.variable}};
  put(json, opacities.function);
}

glm::vec3 colourFrom(const JsonField& field) {
  const glm::dvec3 colour = field.point();
  for (int c = 0; c < 3; ++c)
    if (!(colour[c] >= 0 && colour[c] <= 1)) field.fail("three numbers from 0 to 1");
  return glm::vec3(colour);
}

void putSurfaces(Json& json, const ViewState& state) {
  json["surfaces"] = Json::array();
  for (const SurfaceFile& surface : state.surfaces)
    json["surfaces"].push_back({{"file", surface.path.string()},
                                {"colour", jsonOf(glm::dvec3(surface.colour))},
                                {"opacity", surface.opacity},
                                {"visible", surface.visible}});
  json["faces"] = Json::array();
  for (const NamedFaces& named : state.faces)
    json["faces"].push_back({{"name", named.name},
                             {"colour", jsonOf(glm::dvec3(named.colour))},
                             {"opacity", named.opacity.factor},
                             {"by_function", named.opacity.by_function},
                             {"visible", named.visible}});
  json["faces_by"] = nullptr;
  if (state.faces_by) {
    json["faces_by"] = {{"variable", state.faces_by->variable}};
    put(json["faces_by"], state.faces_by->function);
  }
  json["slices"] = jsonOf(state.slices);
  json["slice_opacity"] = state.slice_opacity.factor;
  json["slices_by_function"] = state.slice_opacity.by_function;
  json["isovalues"] = Json::array();  // those of the opacities' scalar, for readers of earlier versions
  for (const Isosurface& one : state.isosurfaces)
    if (one.visible && one.scalar == state.opacityScalar()) json["isovalues"].push_back(one.value);
  json["isosurfaces"] = Json::array();
  for (const Isosurface& one : state.isosurfaces) {
    json["isosurfaces"].push_back(
        {{"scalar", one.scalar}, {"value", one.value}, {"visible", one.visible}, {"colour", nullptr}});
    if (one.colour) json["isosurfaces"].back()["colour"] = jsonOf(glm::dvec3(*one.colour));
  }
  json["isosurfaces_of_all_scalars"] = true;
  json["iso_opacity"] = state.iso_opacity.factor;
  json["isosurfaces_by_function"] = state.iso_opacity.by_function;
  json["volume"] = state.volume;
}

Json jsonOf(const Marker& marker) {
  return {{"name", marker.name},
          {"point", jsonOf(marker.point)},
          {"scalar", marker.scalar},
          {"unit", marker.unit},
          {"value", marker.value},
          {"block", marker.block},
          {"i", marker.i},
          {"j", marker.j},
          {"k", marker.k}};
}

Marker markerFrom(const JsonField& fields) {
  const auto index = [&](const char* name) { return static_cast<uint64_t>(fields.at(name).number(0, 1e15)); };
  return {fields.at("name").text(),
          fields.at("point").point(),
          fields.at("scalar").text(),
          fields.at("unit").text(),
          fields.at("value").number(-1e300, 1e300),
          static_cast<uint32_t>(fields.at("block").number(0, 4e9)),
          index("i"),
          index("j"),
          index("k")};
}

WorldBox boxFrom(const JsonField& fields) {
  const WorldBox box{fields.at("lower").point(), fields.at("upper").point()};
  for (int axis = 0; axis < 3; ++axis)
    if (box.lower[axis] > box.upper[axis]) fields.at("lower").fail("less than upper");
  return box;
}

OpacityScalar opacityScalarFrom(const JsonField& fields, const std::filesystem::path& path,
                                const Manifest& manifest, double opacity_unit) {
  const JsonField variable = fields.at("variable");
  if (!manifest.variable(variable.text())) variable.fail("a scalar of the cache");
  return {variable.text(), functionFrom(fields, path, opacity_unit)};
}

double defaultOpacityUnit(const Manifest& manifest, const glm::dvec3& scale) {
  const double diagonal = glm::length(scale * (manifest.upper - manifest.lower));
  return diagonal > 0 ? diagonal / 100 : 1;
}

/// Puts the isosurfaces of one scalar into a scene that has those of the opacities' scalar, the first, without a name.
void putIsosurfaces(const std::vector<Isosurface>& group, const ViewState& state, const Manifest& manifest,
                    SurfaceScene& scene) {
  const VariableInfo* const variable = manifest.variable(group.front().scalar);
  if (!variable) return;
  FurtherIsosurfaces put{static_cast<size_t>(variable - manifest.variables.data())};
  for (const Isosurface& one : group) {
    put.values.push_back(one.value);
    put.own_colours.push_back(one.colour);
  }
  if (group.front().scalar != state.opacityScalar()) {
    scene.further_isosurfaces.push_back(std::move(put));
    return;
  }
  scene.isovalues = std::move(put.values);
  scene.iso_colours = std::move(put.own_colours);
}

/// Hides isosurfaces of scalars that the cache lacks.
void hideOthers(std::vector<Isosurface>& isosurfaces, const Manifest& manifest) {
  for (Isosurface& one : isosurfaces) one.visible &= manifest.variable(one.scalar) != nullptr;
}

/// Hides isosurfaces that the program which wrote a state did not draw: earlier versions drew those of one scalar, whose values
/// they list in "isovalues".
void hideUndrawn(const JsonField& fields, std::vector<Isosurface>& isosurfaces) {
  const auto drawn = fields.find("isovalues");
  if (!drawn || fields.has("isosurfaces_of_all_scalars")) return;
  std::vector<double> values;
  for (const JsonField& value : drawn->elements(kMaxIsovalues)) values.push_back(value.number(-1e300, 1e300));
  if (values.empty()) return;
  for (Isosurface& one : isosurfaces) one.visible &= std::ranges::find(values, one.value) != values.end();
}

/// States of earlier versions lack some.
void takeSurfaces(const JsonField& fields, const std::filesystem::path& path, const Manifest& manifest,
                  ViewState& state) {
  if (const auto surfaces = fields.find("surfaces"))
    for (const JsonField& surface : surfaces->elements(kMaxSurfaces)) {
      SurfaceFile& file = state.surfaces.emplace_back(
          SurfaceFile{surface.at("file").text(), colourFrom(surface.at("colour"))});
      if (const auto opacity = surface.find("opacity")) file.opacity = opacity->number(1e-3, 1);
      file.visible = visibleFrom(surface);
    }
  if (const auto faces = fields.find("faces"))
    for (const JsonField& named : faces->elements(kMaxSurfaces))
      state.faces.push_back({named.at("name").text(),
                             colourFrom(named.at("colour")),
                             {named.at("opacity").number(1e-3, 1), named.at("by_function").flag()},
                             visibleFrom(named)});
  if (const auto by = fields.find("faces_by")) {
    const JsonField variable = by->at("variable");
    if (!manifest.variable(variable.text())) variable.fail("a scalar of the cache");
    state.faces_by =
        FacesScalar{variable.text(), functionFrom(*by, path, defaultOpacityUnit(manifest, state.scale))};
  }
  state.slices = planesFrom(fields, "slices", kMaxSlices);
  if (const auto opacity = fields.find("slice_opacity"))
    state.slice_opacity.factor = opacity->number(1e-3, 1);
  if (const auto by = fields.find("slices_by_function")) state.slice_opacity.by_function = by->flag();
  if (const auto isosurfaces = fields.find("isosurfaces")) {
    for (const JsonField& one : isosurfaces->elements(kMaxIsovalues)) {
      state.isosurfaces.push_back(
          {one.at("scalar").text(), one.at("value").number(-1e300, 1e300), visibleFrom(one)});
      if (const auto colour = one.find("colour")) state.isosurfaces.back().colour = colourFrom(*colour);
    }
    hideUndrawn(fields, state.isosurfaces);
  } else if (const auto values = fields.find("isovalues")) {  // earlier versions had those of one scalar
    for (const JsonField& value : values->elements(kMaxIsovalues))
      state.isosurfaces.push_back({state.opacityScalar(), value.number(-1e300, 1e300)});
  }
  hideOthers(state.isosurfaces, manifest);
  if (const auto opacity = fields.find("iso_opacity")) state.iso_opacity.factor = opacity->number(1e-3, 1);
  if (const auto by = fields.find("isosurfaces_by_function")) state.iso_opacity.by_function = by->flag();
  if (const auto volume = fields.find("volume")) state.volume = volume->flag();
}

}  // namespace

uint64_t nextIsosurfaceId() {
  static std::atomic<uint64_t> last = 0;
  return ++last;
}

std::vector<std::vector<Isosurface>> ViewState::drawnIsosurfaces() const {
  std::vector<std::vector<Isosurface>> drawn;
  const auto take = [&](bool of_opacities) {
    for (const Isosurface& one : isosurfaces) {
      if (!one.visible || (one.scalar == opacityScalar()) != of_opacities) continue;
      const auto same = std::ranges::find_if(
          drawn, [&](const std::vector<Isosurface>& group) { return group.front().scalar == one.scalar; });
      if (same == drawn.end())
        drawn.push_back({one});
      else
        same->push_back(one);
    }
  };
  take(true);
  take(false);
  return drawn;
}

AskedDifferences ViewState::askedDifferences(const CacheReader& cache) const {
  AskedDifferences asked{{{cache.variableNamed(variable), function.axis()}}};
  if (opacity_by && drawsVolume())
    asked.axes.push_back({cache.variableNamed(opacity_by->variable), opacity_by->function.axis()});
  if (faces_by && std::ranges::any_of(faces, &NamedFaces::visible))
    asked.axes.push_back({cache.variableNamed(faces_by->variable), faces_by->function.axis()});
  for (const std::vector<Isosurface>& group : drawnIsosurfaces()) {
    if (!cache.manifest().variable(group.front().scalar)) continue;
    AskedIsovalues& values = asked.isosurfaces.emplace_back();
    values.variable = cache.variableNamed(group.front().scalar);
    for (const Isosurface& one : group) values.values.push_back(one.value);
  }
  return asked;
}

bool ViewState::hasSheets() const {
  const auto has_visible = [](const auto& list) {
    return std::ranges::any_of(list, [](const auto& one) { return one.visible; });
  };
  return given || has_visible(isosurfaces) || has_visible(surfaces) || has_visible(faces) ||
         has_visible(slices);
}

bool ViewState::coloursSheets() const {
  const bool has_faces = faces_by && std::ranges::any_of(faces, &NamedFaces::visible);
  return has_faces || std::ranges::any_of(slices, &ListedPlane::visible);
}

SheetOpacity ViewState::opacityOf(const NamedFaces& named) const {
  return {named.opacity.factor, named.opacity.by_function && (faces_by || opacity_by)};
}

ViewState ViewState::withTinted(const std::string& faces_name) const {
  ViewState shown = *this;
  const NamedFaces tinted{faces_name, {1, 0.55f, 0.1f}, {0.7}, true, true};
  const auto listed = std::ranges::find(shown.faces, faces_name, &NamedFaces::name);
  if (listed != shown.faces.end())
    *listed = tinted;
  else
    shown.faces.push_back(tinted);
  return shown;
}

FaceNames ViewState::faceNames() const {
  FaceNames names{{}, faces_by ? faces_by->variable : "", ""};
  for (const NamedFaces& named : faces) {
    if (!named.visible) continue;
    const bool has_opacities = named.opacity.by_function && opacity_by && opacity_by->variable != variable;
    names.faces.push_back({named.name, has_opacities});
    if (has_opacities) names.opacity_by = opacity_by->variable;
  }
  return names;
}

std::vector<ClipPlane> visiblePlanes(const std::vector<ListedPlane>& planes) {
  std::vector<ClipPlane> visible;
  for (const ListedPlane& plane : planes)
    if (plane.visible) visible.push_back(plane);
  return visible;
}

std::optional<glm::dvec3> ViewState::lightFrom() const {
  if (light_direction || shadow == 0) return light_direction;
  return Light::kShadowsFrom;
}

double ViewState::verticalScale(const std::optional<Globe>& globe) const {
  return scale.z * (globe ? std::abs(globe->vertical_scale) : 1);
}

void ViewState::setVerticalScale(double factor, const std::optional<Globe>& globe) {
  const double stretched = factor / (globe ? std::abs(globe->vertical_scale) : 1);
  const glm::dvec3 to(scale.x, scale.y, stretched);
  camera = rescaled(camera, std::exchange(scale, to), to);
}

FrameOptions ViewState::frameOptions(ImageSize size, const Manifest& manifest) const {
  FrameOptions options;
  options.size = size;
  options.classification = classification;
  options.lod_pixels = lod_pixels;
  options.scale = scale;
  options.clip_box = clip_box;
  options.clip_planes = visiblePlanes(clip_planes);
  if (lit) {
    Light& light = options.light.emplace();
    light.shadow = static_cast<float>(shadow);
    light.ambient_occlusion = static_cast<float>(ambient_occlusion);
    light.towards = lightFrom();
    if (light_strength != kLightStrength) {
      light.diffuse = static_cast<float>(light_strength);
      light.ambient = static_cast<float>(1 - light_strength);
    }
  }
  options.gradient_opacity = gradient_opacity;
  if (hasSheets()) {
    auto scene = std::make_shared<SurfaceScene>();
    for (const SurfaceFile& surface : surfaces)
      if (surface.mesh && surface.visible)
        scene->surfaces.push_back({surface.mesh, surface.colour, false, nullptr, {surface.opacity}});
    std::shared_ptr<const TransferFunction> of_faces;
    std::shared_ptr<const ColourTable> colours;  // none: the picture's
    if (faces_by && faces_by->variable != variable && !faces.empty()) {
      of_faces = std::make_shared<TransferFunction>(faces_by->function.function());
      colours = std::make_shared<ColourTable>(*of_faces);
    }
    for (const NamedFaces& named : faces) {
      if (!named.visible) continue;
      GridSurface& surface = scene->grid_surfaces.emplace_back();
      surface.colour = named.colour;
      surface.opacity = opacityOf(named);
      surface.function = of_faces;
      surface.colours = colours;
      surface.own_colour = named.tinted;
      if (named.tinted) continue;
      if (given && given->earth && named.name == given->faces_with_map) surface.map = given->earth->map;
    }
    if (given) {
      if (given->earth) scene->surfaces.push_back(*given->earth);
      scene->curves = given->curves;
      for (Curves& curves : scene->curves) {
        if (curves.title != variable) continue;
        curves.function = nullptr;  // the picture's
        curves.colours = nullptr;
      }
    }
    scene->slices = visiblePlanes(slices);
    scene->slice_opacity = slice_opacity.factor;
    for (const std::vector<Isosurface>& group : drawnIsosurfaces())
      putIsosurfaces(group, *this, manifest, *scene);
    scene->iso_opacity = iso_opacity;
    scene->slices_by_function = slice_opacity.by_function;
    scene->volume = volume;
    options.scene = std::move(scene);
  }
  options.background = annotations.lieBehind() ? glm::vec4(0) : background();
  options.memory_bytes = memory_bytes;
  return options;
}

std::string signOf(const Marker& marker, const std::string& scalar) {
  const bool is_shown = marker.scalar == scalar;
  return fmt::format("{}: {}{}{:.4g}{}{}", marker.name, is_shown ? "" : marker.scalar, is_shown ? "" : " ",
                     marker.value, marker.unit.empty() ? "" : " ", marker.unit);
}

void ViewState::setTitle(std::string text) {
  text.resize(firstBytes(text, kLongestTitle).size());
  title = std::move(text);
  annotations.texts = !title.empty();
}

void ViewState::suitBackground() {
  function.suitBackground(dark);
  if (faces_by) faces_by->function.suitBackground(dark);
}

ViewState firstViewOf(const Manifest& manifest, ImageSize picture) {
  if (manifest.variables.empty())
    throw Error("{}: the cache contains no scalar; convert the grid again with a scalar", manifest.title);
  const VariableInfo& variable = manifest.variables[firstVaryingVariable(manifest)];
  ViewState state{variable.name,
                  {},
                  EditedFunction(kMapsOnDark.sequential, variable.min, variable.max,
                                 defaultOpacityUnit(manifest, glm::dvec3(1)))};
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
  const VariableInfo* const variable = manifest.variable(name);
  if (!variable) {
    std::string names;
    for (const VariableInfo& one : manifest.variables) names += (names.empty() ? "" : ", ") + one.name;
    throw UsageError("the cache has no scalar {}; expected one of {}", name, names);
  }
  state.variable = name;
  state.function.fitRange(variable->min, variable->max);
}

void leaveOtherScalars(ViewState& state, const Manifest& manifest, const std::string& shown) {
  if (state.opacity_by && !manifest.variable(state.opacity_by->variable)) state.opacity_by.reset();
  if (state.faces_by && !manifest.variable(state.faces_by->variable)) state.faces_by.reset();
  hideOthers(state.isosurfaces, manifest);
  if (!manifest.variable(state.variable)) chooseVariable(state, manifest, shown);
}

std::string toJson(const ViewState& state) {
  Json json = {{"curvisplat_view", 1}, {"variable", state.variable}, {"camera", jsonOf(state.camera)}};
  put(json, state.function);
  json["opacity_by"] = nullptr;
  if (state.opacity_by) put(json["opacity_by"], *state.opacity_by);
  json["lod_pixels"] = state.lod_pixels;
  json["memory_bytes"] = state.memory_bytes;
  json["flat"] = state.classification == Classification::kFlat;
  json["scale"] = jsonOf(state.scale);
  json["clip_box"] = nullptr;
  if (state.clip_box)
    json["clip_box"] = {{"lower", jsonOf(state.clip_box->lower)}, {"upper", jsonOf(state.clip_box->upper)}};
  json["clip_planes"] = jsonOf(state.clip_planes);
  putSurfaces(json, state);
  json["lit"] = state.lit;
  json["shadow"] = state.shadow;
  json["ambient_occlusion"] = state.ambient_occlusion;
  json["light_strength"] = state.light_strength;
  json["light_direction"] = nullptr;
  if (state.light_direction) json["light_direction"] = jsonOf(*state.light_direction);
  json["gradient_opacity"] = textOf(state.gradient_opacity);
  json["dark"] = state.dark;
  json["scalar_bar"] = state.annotations.scalar_bar;
  json["axes"] = state.annotations.axes;
  json["axes_grid"] = state.annotations.axes_grid;
  json["outline"] = state.annotations.outline;
  json["title"] = state.title;
  json["markers"] = Json::array();
  for (const Marker& marker : state.markers) json["markers"].push_back(jsonOf(marker));
  return json.dump(1) + "\n";
}

std::string scalarOfViewState(const std::string& text, const std::filesystem::path& path) {
  const JsonDocument document(text, path.string(), "the state of a window");
  return document.root().at("variable").text();
}

ViewState viewStateFromJson(const std::string& text, const std::filesystem::path& path,
                            const Manifest& manifest) {
  const JsonDocument document(text, path.string(), "the state of a window");
  const JsonField fields = document.root();
  if (const JsonField version = fields.at("curvisplat_view"); version.json() != 1)
    version.fail("1, the only version this program reads");
  const JsonField variable = fields.at("variable"), scale = fields.at("scale");
  if (!manifest.variable(variable.text())) variable.fail("a scalar of the cache");
  const glm::dvec3 factors = scale.point(kMaxScale);
  if (!(std::min({factors.x, factors.y, factors.z}) >= kMinScale))
    scale.fail("three numbers between 1e-6 and 1e6");

  ViewState state{variable.text(), cameraFrom(fields.at("camera")),
                  functionFrom(fields, path, defaultOpacityUnit(manifest, factors))};
  state.lod_pixels = fields.at("lod_pixels").number(0, 1e6);
  state.memory_bytes = static_cast<uint64_t>(fields.at("memory_bytes").number(1, 1e18));
  state.classification = fields.at("flat").flag() ? Classification::kFlat : Classification::kPixel;
  state.scale = factors;
  if (const auto box = fields.find("clip_box")) state.clip_box = boxFrom(*box);
  state.clip_planes = planesFrom(fields, "clip_planes", kMaxClipPlanes);
  if (const auto lit = fields.find("lit")) state.lit = lit->flag();
  if (const auto shadow = fields.find("shadow")) state.shadow = shadow->number(0, 1);
  if (const auto occlusion = fields.find("ambient_occlusion"))
    state.ambient_occlusion = occlusion->number(0, 1);
  if (const auto strength = fields.find("light_strength")) state.light_strength = strength->number(0, 1);
  if (const auto direction = fields.find("light_direction")) {
    state.light_direction = direction->point(1e100);  // its length is squared
    if (!(glm::length(*state.light_direction) > 0)) direction->fail("a direction");
  }
  if (const auto gradient = fields.find("gradient_opacity"); gradient && !gradient->text().empty())
    state.gradient_opacity = opacitiesFrom(*gradient);
  state.dark = fields.at("dark").flag();
  state.annotations = {fields.at("scalar_bar").flag(), fields.at("axes").flag(), fields.at("outline").flag()};
  if (const auto grid = fields.find("axes_grid")) state.annotations.axes_grid = grid->flag();
  if (const auto title = fields.find("title")) state.setTitle(title->text());
  const double unit = defaultOpacityUnit(manifest, factors);
  if (const auto opacity = fields.find("opacity_by"))
    state.opacity_by = opacityScalarFrom(*opacity, path, manifest, unit);
  takeSurfaces(fields, path, manifest, state);
  if (const auto markers = fields.find("markers"))
    for (const JsonField& marker : markers->elements(kMaxMarkers))
      state.markers.push_back(markerFrom(marker));
  return state;
}

}  // namespace curvisplat
