#include "tools/panels/scene_panels.h"

#include <fmt/format.h>
#include <imgui.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "render/annotate/annotations.h"
#include "tools/panels/labels.h"
#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

/// Says what the faces of a name are; empty for names that say it themselves.
std::string meaningOf(const std::string& faces) {
  constexpr const char* kNotCut = "clip planes and the clip box do not cut them";
  if (faces == "walls")
    return fmt::format(
        "walls, by the grid's boundary conditions, or, where it has none, faces on which the velocity is "
        "zero; {}",
        kNotCut);
  if (faces == "all") return fmt::format("all outer faces of the grid; {}", kNotCut);
  const bool is_lower = faces.ends_with("min"), is_upper = faces.ends_with("max");
  if (faces.size() != 4 || faces[0] < 'i' || faces[0] > 'k' || is_lower == is_upper) return {};
  return fmt::format("the faces of the grid where {} is {}; {}", faces[0], is_lower ? "least" : "greatest",
                     kNotCut);
}

/// The direction in which a plane's place is counted, of unit length, and its name.
struct PlaneScale {
  glm::dvec3 along;
  const char* name;
};

/// A plane across an axis is at a coordinate, whichever of its sides is kept.
PlaneScale planeScaleOf(const glm::dvec3& normal) {
  const glm::dvec3 along = glm::normalize(normal);
  constexpr std::array<const char*, 3> kNames{"x of plane", "y of plane", "z of plane"};
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 unit(0.0);
    unit[axis] = 1;
    if (std::abs(along[axis]) > 1 - 1e-12) return {unit, kNames[static_cast<size_t>(axis)]};
  }
  return {along, "position"};
}

/// How a coordinate of data between two ends is written: to a few thousandths of their distance, and 0 for a
/// rounding error.
std::string coordinateFormat(double coordinate, double lowest, double highest) {
  const double extent = highest - lowest;
  if (std::abs(coordinate) < 1e-6 * extent) return "0";
  const double largest = std::max(std::abs(lowest), std::abs(highest));
  const double further = extent > 0 ? std::ceil(std::log10(largest / extent)) : 0;
  return fmt::format("%.{}g", 4 + std::clamp(static_cast<int>(further), 0, 4));
}

/// `name`: of the widget.
void opacitySlider(const char* text, const std::string& name, double& opacity, PanelActions& actions) {
  auto value = static_cast<float>(opacity);
  label(text);
  if (slider(fmt::format("##{}", name).c_str(), value, 0.05f, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp)) {
    opacity = static_cast<double>(value);
    actions.changed = true;
  }
  actions.dragging |= isDragged();
  nameWidget(name);
}

/// Draws a checkbox that multiplies an opacity by the volume's. `name`: of the widget. Returns whether it changed.
bool opacityByFunction(bool& by_function, const std::string& name) {
  const bool changed = ImGui::Checkbox("transparent where the volume is", &by_function);
  nameWidget(name);
  hint("multiplies the opacity by that of the curve in Colour, at the value of each place");
  return changed;
}

/// Returns where a button "Remove" at the right end of a line begins.
float removeFrom() {
  return ImGui::GetContentRegionMax().x - ImGui::CalcTextSize("Remove").x -
         2 * ImGui::GetStyle().FramePadding.x;
}

bool removeButton(const std::string& name) {
  ImGui::SameLine(removeFrom());
  const bool removes = ImGui::Button("Remove");
  nameWidget("remove " + name);
  return removes;
}

/// Draws the line that begins an object: eye, colour, title and a button that removes it. Returns whether that was
/// pressed.
bool drawHead(bool& visible, const std::string& title, glm::vec3* colour, const std::string& name,
              PanelActions& actions) {
  ImGui::Separator();
  actions.changed |= eye(visible, name);
  ImGui::SameLine();
  if (colour) {
    actions.changed |= colourSwatch("##colour", glm::value_ptr(*colour), "colour of " + name);
    actions.dragging |= isDragged();
    ImGui::SameLine();
  }
  ImGui::AlignTextToFramePadding();
  const ImVec2 from = ImGui::GetCursorScreenPos();
  // A long name ends before the button.
  ImGui::PushClipRect(from,
                      {ImGui::GetWindowPos().x + removeFrom() - ImGui::GetStyle().ItemSpacing.x,
                       from.y + 2 * ImGui::GetFrameHeight()},
                      true);
  ImGui::TextColored(ImGui::GetStyleColorVec4(visible ? ImGuiCol_Text : ImGuiCol_TextDisabled), "%s",
                     title.c_str());
  ImGui::PopClipRect();
  hint(title.c_str());
  return removeButton(name);
}

void addButton(Command command, bool has_room, PanelActions& actions) {
  ImGui::BeginDisabled(!has_room);
  commandButton(command, actions);
  ImGui::EndDisabled();
}

template <typename List>
void removeAt(List& list, size_t at, PanelActions& actions) {
  if (at >= list.size()) return;
  list.erase(list.begin() + static_cast<ptrdiff_t>(at));
  actions.changed = true;
}

}  // namespace

void CutPanel::draw(ViewState& state, PanelActions& actions) {
  if (const Section open{"Slices", slices_seen_, state.slices.size()}) {
    addButton(Command::kAddSlice, state.slices.size() < kMaxSlices, actions);
    drawSliceOpacity(state, actions);
    drawPlanes(state.slices, state, actions);
  }
  if (const Section open{"Clip planes", planes_seen_, state.clip_planes.size()}) {
    addButton(Command::kAddClipPlane, state.clip_planes.size() < kMaxClipPlanes, actions);
    drawPlanes(state.clip_planes, state, actions);
  }
  if (const Section open{"Clip box", false}) drawClipBox(state, actions);
}

/// A plane's normal in data coordinates is its normal after --scale, times the scale.
ClipPlane planeBeforeViewer(const Manifest& manifest, const ViewState& state) {
  return {0.5 * (manifest.lower + manifest.upper),
          glm::normalize((state.camera.focal_point - state.camera.position) * state.scale)};
}

void CutPanel::drawClipBox(ViewState& state, PanelActions& actions) {
  const Manifest& manifest = cache_.manifest();
  bool on = state.clip_box.has_value();
  if (option("clip", on)) {
    if (on)
      state.clip_box = WorldBox{manifest.lower, manifest.upper};
    else
      state.clip_box.reset();
    actions.changed = true;
  }
  // The lines are always there: nothing moves when the box is switched on.
  const WorldBox whole{manifest.lower, manifest.upper};
  ImGui::BeginDisabled(!on);
  for (int axis = 0; axis < 3; ++axis) {
    constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
    const float lowest = static_cast<float>(manifest.lower[axis]);
    const float highest = static_cast<float>(manifest.upper[axis]);
    const WorldBox& box = state.clip_box ? *state.clip_box : whole;
    float lower = static_cast<float>(box.lower[axis]), upper = static_cast<float>(box.upper[axis]);
    const char* const name = kNames[static_cast<size_t>(axis)];
    const auto format = [&](float end) {
      return coordinateFormat(static_cast<double>(end), manifest.lower[axis], manifest.upper[axis]);
    };
    label(name);
    const std::string of_lower = format(lower), of_upper = format(upper);
    if (dragEnds(fmt::format("##clip {}", name).c_str(), lower, upper,
                 {(highest - lowest) / 500, lowest, highest, of_lower.c_str(), of_upper.c_str()})) {
      state.clip_box->lower[axis] = static_cast<double>(lower);
      state.clip_box->upper[axis] = static_cast<double>(std::max(lower, upper));
      actions.changed = true;
    }
    actions.dragging |= isDragged();
    nameWidget(fmt::format("clip {}", name));
    hint("drag to change; Ctrl + click to type a number");
  }
  ImGui::EndDisabled();
}

void CutPanel::drawPlanes(std::vector<ListedPlane>& planes, const ViewState& state, PanelActions& actions) {
  const bool clips = &planes == &state.clip_planes;
  size_t removed = planes.size();
  for (size_t n = 0; n < planes.size(); ++n) {
    ImGui::PushID(static_cast<int>(n));
    const std::string name = fmt::format("{} {}", clips ? "clip plane" : "slice", n + 1);
    if (drawHead(planes[n].visible, name, nullptr, name, actions)) removed = n;
    drawPlane(planes[n], name, state, actions);
    ImGui::PopID();
  }
  removeAt(planes, removed, actions);
}

/// A plane has a direction and a place along it, which can also be dragged in the picture.
void CutPanel::drawPlane(ListedPlane& plane, const std::string& name, const ViewState& state,
                         PanelActions& actions) {
  const Manifest& manifest = cache_.manifest();
  const glm::dvec3 middle = 0.5 * (manifest.lower + manifest.upper);
  const glm::dvec3 half = 0.5 * (manifest.upper - manifest.lower);
  const auto turn = [&](const char* text, const char* way, const glm::dvec3& normal) {
    const bool turns = ImGui::Button(text);
    nameWidget(fmt::format("{} {}", way, name));
    if (!turns) return;
    plane.normal = normal;
    actions.changed = true;
  };
  label("across");
  turn("x", "x", {1, 0, 0});
  ImGui::SameLine();
  turn("y", "y", {0, 1, 0});
  ImGui::SameLine();
  turn("z", "z", {0, 0, 1});
  ImGui::SameLine();
  turn("View", "view", planeBeforeViewer(manifest, state).normal);
  hint("facing you");
  if (name.starts_with("clip")) {
    ImGui::SameLine();
    turn("Flip", "flip", -plane.normal);
    hint("keep the other side");
  }
  drawNormal(plane, name, actions);
  // From the data's one end along the normal to the other; a plane across an axis has its coordinate there.
  const PlaneScale scale = planeScaleOf(plane.normal);
  const double centre = glm::dot(scale.along, middle), reach = glm::dot(half, glm::abs(scale.along));
  const double lowest = centre - reach, highest = centre + reach;
  double place = glm::dot(scale.along, plane.point);
  label(scale.name);
  if (slider("##place", place, lowest, highest, coordinateFormat(place, lowest, highest).c_str(), 0)) {
    plane.point = middle + (place - centre) * scale.along;
    actions.changed = true;
  }
  actions.dragging |= isDragged();
  nameWidget(name);
  nameWidget(fmt::format("{}: {} at {:.3g}", name, scale.name, place));
  hint("drag it here or in the picture; double click to type a number");
}

/// Draws the numbers of the plane's direction.
void CutPanel::drawNormal(ListedPlane& plane, const std::string& name, PanelActions& actions) {
  const glm::dvec3 unit = glm::normalize(plane.normal);
  label("normal");
  const auto typed = typed_.draw("##normal", {glm::value_ptr(unit), 3}, "%.3g");
  nameWidget("normal of " + name);
  hint("also dragged in the picture, by the grip at its tip");
  if (!typed) return;
  const glm::dvec3 normal((*typed)[0], (*typed)[1], (*typed)[2]);
  const double length = glm::length(normal);
  if (!std::isfinite(length) || length <= 0) {
    actions.error = fmt::format("normal of {}: it has no length; expected a direction", name);
    return;
  }
  plane.normal = normal / length;
  actions.changed = true;
}

void CutPanel::drawSliceOpacity(ViewState& state, PanelActions& actions) {
  auto opacity = static_cast<float>(state.slice_opacity.factor);
  label("opacity");
  if (slider("##opacity", opacity, 0.05f, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp)) {
    state.slice_opacity.factor = static_cast<double>(opacity);
    actions.changed = true;
  }
  actions.dragging |= isDragged();
  actions.changed |= opacityByFunction(state.slice_opacity.by_function, "slices by function");
}

void SurfacePanel::draw(ViewState& state, const std::vector<std::string>& faces,
                        const FurtherScalars* further, PanelActions& actions) {
  if (const Section open{"Surfaces", surfaces_seen_, state.surfaces.size() + state.faces.size()})
    drawSurfaces(state, faces, further, actions);
  if (const Section open{"Isosurfaces", isosurfaces_seen_, state.isosurfaces.size()})
    drawIsosurfaces(state, further, actions);
}

void SurfacePanel::drawSurfaces(ViewState& state, const std::vector<std::string>& faces,
                                const FurtherScalars* further, PanelActions& actions) {
  const bool is_full = state.surfaces.size() + state.faces.size() >= kMaxSurfaces;
  label("add wall or face");
  ImGui::BeginDisabled(faces.empty() || is_full);
  if (ImGui::BeginCombo("##add surface", faces.empty() ? "the cache has none" : "choose ...",
                        ImGuiComboFlags_HeightLarge)) {
    for (const std::string& name : faces) {
      if (ImGui::Selectable(name.c_str())) actions.add_faces = name;
      nameWidget("add surface " + name);
      if (ImGui::IsItemHovered()) actions.pointed_faces = name;
      if (const std::string what = meaningOf(name); !what.empty()) hint(what.c_str());
    }
    ImGui::EndCombo();
  } else {
    nameWidget("add surface");
  }
  ImGui::EndDisabled();
  ImGui::BeginDisabled(is_full);
  commandButton(Command::kAddSurfaceFile, actions, "Add from a file...");
  ImGui::EndDisabled();
  hint("STL, PLY or OBJ");
  if (!state.lit && !(state.surfaces.empty() && state.faces.empty())) {
    ImGui::TextDisabled("lit from the viewer; direction: View > lighting");
    nameWithoutTab("where the light is");
  }
  drawColouring(state, further, actions);

  size_t removed = state.faces.size();
  for (size_t n = 0; n < state.faces.size(); ++n) {
    NamedFaces& named = state.faces[n];
    ImGui::PushID(static_cast<int>(n));
    const ImVec2 from = ImGui::GetCursorScreenPos();
    // With a scalar its colour is not seen.
    const std::string name = fmt::format("surface {}", n + 1);
    if (drawHead(named.visible, named.name, state.faces_by ? nullptr : &named.colour, name, actions))
      removed = n;
    opacitySlider("opacity", "opacity of " + name, named.opacity.factor, actions);
    ImGui::BeginDisabled(!state.faces_by && !state.opacity_by);
    actions.changed |= opacityByFunction(named.opacity.by_function, name + " by function");
    ImGui::EndDisabled();
    const ImVec2 to(from.x + ImGui::GetContentRegionAvail().x, ImGui::GetCursorScreenPos().y);
    if (ImGui::IsWindowHovered() && !ImGui::IsAnyItemActive() && ImGui::IsMouseHoveringRect(from, to))
      actions.pointed_faces = named.name;
    ImGui::PopID();
  }
  removeAt(state.faces, removed, actions);
  removed = state.surfaces.size();
  for (size_t n = 0; n < state.surfaces.size(); ++n) {
    SurfaceFile& surface = state.surfaces[n];
    ImGui::PushID(surface.path.c_str());
    ImGui::PushID(static_cast<int>(n));
    const std::string name = fmt::format("surface file {}", n + 1);
    if (drawHead(surface.visible, surface.path.filename().string(), &surface.colour, name, actions))
      removed = n;
    opacitySlider("opacity", "opacity of " + name, surface.opacity, actions);
    ImGui::PopID();
    ImGui::PopID();
  }
  removeAt(state.surfaces, removed, actions);
}

/// Draws the choice of a colour for the faces of the grid; a file's have no scalar.
void SurfacePanel::drawColouring(const ViewState& state, const FurtherScalars* further,
                                 PanelActions& actions) const {
  constexpr const char* kOwn = "a colour of its own";
  label("faces coloured by");
  ImGui::BeginDisabled(state.faces.empty());
  if (combo("##surfaces by", state.faces_by ? state.faces_by->variable : kOwn, ImGuiComboFlags_HeightLarge)) {
    if (ImGui::Selectable(kOwn, !state.faces_by)) actions.colour_faces = "";
    nameWidget("surfaces by no scalar");
    for (const VariableInfo& one : cache_.manifest().variables) {
      const bool chosen = state.faces_by && state.faces_by->variable == one.name;
      if (ImGui::Selectable(scalarTitle(one.name, one.unit).c_str(), chosen)) actions.colour_faces = one.name;
      nameWidget("surfaces by " + one.name);
    }
    if (further) drawFurther(*further, {"", false, std::nullopt, true}, "surfaces by further ", actions);
    ImGui::EndCombo();
  } else {
    nameWidget("surfaces by");
    if (state.faces_by) nameWidget("surfaces show: " + state.faces_by->variable);
  }
  ImGui::EndDisabled();
}

void SurfacePanel::drawIsosurfaces(ViewState& state, const FurtherScalars* further, PanelActions& actions) {
  commandButton(Command::kAddIsosurface, actions);
  ImGui::BeginDisabled(state.isosurfaces.empty());
  opacitySlider("opacity", "opacity of isosurfaces", state.iso_opacity.factor, actions);
  actions.changed |= opacityByFunction(state.iso_opacity.by_function, "isosurfaces by function");
  ImGui::EndDisabled();
  size_t removed = state.isosurfaces.size();
  for (size_t n = 0; n < state.isosurfaces.size(); ++n) {
    Isosurface& one = state.isosurfaces[n];
    ImGui::PushID(static_cast<int>(n));
    ImGui::Separator();
    const std::string name = fmt::format("isosurface {}", n + 1);
    ImGui::BeginDisabled(!cache_.manifest().variable(one.scalar));
    actions.changed |= eye(one.visible, name);
    ImGui::EndDisabled();
    ImGui::SameLine();
    ImGui::SetNextItemWidth(removeFrom() - ImGui::GetStyle().ItemSpacing.x - ImGui::GetCursorPosX());
    chooseScalarOf(n, one, further, actions);
    if (removeButton(name)) removed = n;
    drawValueOf(one, name, actions);
    drawColourOf(one, name, state, actions);
    ImGui::PopID();
  }
  removeAt(state.isosurfaces, removed, actions);
}

/// Each has a scalar of its own, which need not be the one that the picture shows.
void SurfacePanel::chooseScalarOf(size_t number, const Isosurface& one, const FurtherScalars* further,
                                  PanelActions& actions) const {
  const std::string name = fmt::format("isosurface {}", number + 1);
  if (!combo("##scalar", one.scalar, ImGuiComboFlags_HeightLarge)) {
    nameWidget("scalar of " + name);
    nameWidget(fmt::format("{} shows: {}", name, one.scalar));
    return;
  }
  for (const VariableInfo& info : cache_.manifest().variables) {
    const bool chooses =
        ImGui::Selectable(scalarTitle(info.name, info.unit).c_str(), info.name == one.scalar);
    nameWidget(fmt::format("{} by {}", name, info.name));
    if (chooses && info.name != one.scalar) actions.isosurface_scalar = {one.id, info.name};
  }
  if (further) drawFurther(*further, {"", false, one.id}, name + " by further ", actions);
  ImGui::EndCombo();
}

void SurfacePanel::drawValueOf(Isosurface& one, const std::string& name, PanelActions& actions) {
  const VariableInfo* const info = cache_.manifest().variable(one.scalar);
  const double lowest = info ? info->min : one.value;
  const double highest = info ? info->max : one.value;
  label("value");
  ImGui::BeginDisabled(!info);
  if (slider("##value", one.value, lowest, highest, "%.5g", ImGuiSliderFlags_None)) actions.changed = true;
  ImGui::EndDisabled();
  actions.dragging |= isDragged();
  nameWidget(name);
  hint("double click to type a number");
  if (one.value >= lowest && one.value <= highest) return;
  const std::string text =
      fmt::format("nothing is drawn: values reach from {:.5g} to {:.5g}", lowest, highest);
  ImGui::TextWrapped("%s", text.c_str());
  nameWithoutTab(text);
}

/// Draws a colour of its own, or the function's, which choosing another one replaces.
void SurfacePanel::drawColourOf(Isosurface& one, const std::string& name, const ViewState& state,
                                PanelActions& actions) {
  // A function of another scalar gives it many colours.
  const glm::vec3 of_function = one.scalar == state.variable
                                    ? glm::vec3(state.function.function().at(one.value).colour)
                                    : Surface().colour;
  glm::vec3 colour = one.colour.value_or(of_function);
  label("colour");
  if (colourSwatch("##colour", glm::value_ptr(colour), "colour of " + name)) {
    one.colour = colour;
    actions.changed = true;
  }
  actions.dragging |= isDragged();
  ImGui::SameLine();
  bool is_of_function = !one.colour;
  if (ImGui::Checkbox(("by " + state.variable).c_str(), &is_of_function)) {
    one.colour = is_of_function ? std::nullopt : std::optional(colour);
    actions.changed = true;
  }
  nameWidget(name + " by colours");
  hint(fmt::format("the colours that {} has in the scalar bar", state.variable).c_str());
}

}  // namespace curvisplat
