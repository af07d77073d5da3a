#include "tools/viewer/surface_panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include <glm/gtc/type_ptr.hpp>

#include "render/annotate/annotations.h"
#include "tools/viewer/labels.h"
#include "tools/viewer/widget_places.h"

namespace curvisplat {
namespace {

/// `name`: of the widget.
void opacitySlider(const char* text, const std::string& name, double& opacity, PanelActions& actions) {
  auto value = static_cast<float>(opacity);
  label(text);
  if (ImGui::SliderFloat(fmt::format("##{}", name).c_str(), &value, 0.05f, 1, "%.2f",
                         ImGuiSliderFlags_AlwaysClamp)) {
    opacity = static_cast<double>(value);
    actions.changed = true;
  }
  actions.dragging |= ImGui::IsItemActive();
  nameWidget(name);
}

/// Title, colour and a button that removes it, in a line; whether it was pressed.
bool drawHead(const std::string& title, glm::vec3* colour, const std::string& name, PanelActions& actions) {
  ImGui::Separator();
  if (colour) {
    actions.changed |= ImGui::ColorEdit3("##colour", glm::value_ptr(*colour), ImGuiColorEditFlags_NoInputs);
    actions.dragging |= ImGui::IsItemActive();
    nameWidget("colour of " + name);
    ImGui::SameLine();
  }
  ImGui::AlignTextToFramePadding();
  const float button = ImGui::CalcTextSize("remove").x + 2 * ImGui::GetStyle().FramePadding.x;
  const float right = ImGui::GetContentRegionMax().x - button;
  const ImVec2 from = ImGui::GetCursorScreenPos();
  // A long name ends before the button.
  ImGui::PushClipRect(from,
                      {ImGui::GetWindowPos().x + right - ImGui::GetStyle().ItemSpacing.x,
                       from.y + 2 * ImGui::GetFrameHeight()},
                      true);
  ImGui::TextUnformatted(title.c_str());
  ImGui::PopClipRect();
  hint(title.c_str());
  ImGui::SameLine(right);
  const bool removes = ImGui::Button("remove");
  nameWidget("remove " + name);
  return removes;
}

template <typename List>
void removeAt(List& list, size_t at, PanelActions& actions) {
  if (at >= list.size()) return;
  list.erase(list.begin() + static_cast<ptrdiff_t>(at));
  actions.changed = true;
}

}  // namespace

void SurfacePanel::draw(ViewState& state, const std::vector<std::string>& faces, PanelActions& actions) {
  if (sectionOf("Surfaces", surfaces_seen_, state.surfaces.size() + state.faces.size()))
    drawSurfaces(state, faces, actions);
  if (sectionOf("Isosurfaces", isovalues_seen_, state.isovalues.size())) drawIsosurfaces(state, actions);
}

void SurfacePanel::drawSurfaces(ViewState& state, const std::vector<std::string>& faces,
                                PanelActions& actions) {
  const bool is_full = state.surfaces.size() + state.faces.size() >= kMaxSurfaces;
  label("add grid face");
  ImGui::BeginDisabled(faces.empty() || is_full);
  if (ImGui::BeginCombo("##add surface", faces.empty() ? "the cache has none" : "choose ...",
                        ImGuiComboFlags_HeightLarge)) {
    for (const std::string& name : faces) {
      if (ImGui::Selectable(name.c_str())) actions.add_faces = name;
      nameWidget("add surface " + name);
    }
    ImGui::EndCombo();
  } else {
    nameWidget("add surface");
  }
  ImGui::EndDisabled();
  ImGui::BeginDisabled(is_full);
  commandButton(Command::kAddSurfaceFile, actions, "add from a file...");
  ImGui::EndDisabled();
  hint("STL, PLY or OBJ");
  drawColouring(state, actions);

  size_t removed = state.faces.size();
  for (size_t n = 0; n < state.faces.size(); ++n) {
    NamedFaces& named = state.faces[n];
    ImGui::PushID(static_cast<int>(n));
    // With a scalar its colour is not seen.
    const std::string name = fmt::format("surface {}", n + 1);
    if (drawHead(named.name, state.faces_by ? nullptr : &named.colour, name, actions)) removed = n;
    opacitySlider("opacity", "opacity of " + name, named.opacity.factor, actions);
    ImGui::BeginDisabled(!state.faces_by && !state.opacity_by);
    actions.changed |= ImGui::Checkbox("times the function's", &named.opacity.by_function);
    nameWidget(name + " by function");
    ImGui::EndDisabled();
    ImGui::PopID();
  }
  removeAt(state.faces, removed, actions);
  removed = state.surfaces.size();
  for (size_t n = 0; n < state.surfaces.size(); ++n) {
    SurfaceFile& surface = state.surfaces[n];
    ImGui::PushID(surface.path.c_str());
    ImGui::PushID(static_cast<int>(n));
    const std::string name = fmt::format("surface file {}", n + 1);
    if (drawHead(surface.path.filename().string(), &surface.colour, name, actions)) removed = n;
    opacitySlider("opacity", "opacity of " + name, surface.opacity, actions);
    ImGui::PopID();
    ImGui::PopID();
  }
  removeAt(state.surfaces, removed, actions);
}

/// Of the faces of the grid; a file's have no scalar.
void SurfacePanel::drawColouring(const ViewState& state, PanelActions& actions) {
  constexpr const char* kOwn = "a colour of its own";
  label("faces coloured by");
  ImGui::BeginDisabled(state.faces.empty());
  if (ImGui::BeginCombo("##surfaces by", state.faces_by ? state.faces_by->variable.c_str() : kOwn,
                        ImGuiComboFlags_HeightLarge)) {
    if (ImGui::Selectable(kOwn, !state.faces_by)) actions.colour_faces = "";
    nameWidget("surfaces by no scalar");
    for (const VariableInfo& one : cache_.manifest().variables) {
      const bool chosen = state.faces_by && state.faces_by->variable == one.name;
      if (ImGui::Selectable(scalarTitle(one.name, one.unit).c_str(), chosen)) actions.colour_faces = one.name;
      nameWidget("surfaces by " + one.name);
    }
    ImGui::EndCombo();
  } else {
    nameWidget("surfaces by");
  }
  ImGui::EndDisabled();
}

void SurfacePanel::drawIsosurfaces(ViewState& state, PanelActions& actions) {
  const VariableInfo& info = cache_.manifest().variables[cache_.variableNamed(state.isoScalar())];
  commandButton(Command::kAddIsosurface, actions);
  ImGui::BeginDisabled(state.isovalues.empty());
  opacitySlider("opacity", "opacity of isosurfaces", state.iso_opacity.factor, actions);
  actions.changed |= ImGui::Checkbox("times the function's", &state.iso_opacity.by_function);
  nameWidget("isosurfaces by function");
  ImGui::EndDisabled();
  size_t removed = state.isovalues.size();
  for (size_t n = 0; n < state.isovalues.size(); ++n) {
    ImGui::PushID(static_cast<int>(n));
    const std::string name = fmt::format("isosurface {}", n + 1);
    const std::string title = fmt::format("{} at", scalarTitle(info.name, info.unit));
    if (drawHead(title, nullptr, name, actions)) removed = n;
    ImGui::SetNextItemWidth(-1);
    if (ImGui::SliderScalar("##value", ImGuiDataType_Double, &state.isovalues[n], &info.min, &info.max,
                            "%.5g", ImGuiSliderFlags_AlwaysClamp))
      actions.changed = true;
    actions.dragging |= ImGui::IsItemActive();
    nameWidget(name);
    hint("Ctrl + click to type a number");
    ImGui::PopID();
  }
  removeAt(state.isovalues, removed, actions);
}

}  // namespace curvisplat
