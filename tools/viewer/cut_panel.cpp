#include "tools/viewer/cut_panel.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "tools/viewer/labels.h"
#include "tools/viewer/widget_places.h"

namespace curvisplat {
namespace {

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
  return {along, "place of plane"};
}

/// How a coordinate of data between two ends is written: to a few thousandths of their distance, and 0 for a rounding error.
std::string coordinateFormat(double coordinate, double lowest, double highest) {
  const double extent = highest - lowest;
  if (std::abs(coordinate) < 1e-6 * extent) return "0";
  const double largest = std::max(std::abs(lowest), std::abs(highest));
  const double further = extent > 0 ? std::ceil(std::log10(largest / extent)) : 0;
  return fmt::format("%.{}g", 4 + std::clamp(static_cast<int>(further), 0, 4));
}

}  // namespace

void CutPanel::draw(ViewState& state, PanelActions& actions) {
  if (section("Clip box", false)) drawClipBox(state, actions);
  if (sectionOf("Clip planes", planes_seen_, state.clip_planes.size()))
    drawPlanes(state.clip_planes, kMaxClipPlanes, state, actions);
  if (sectionOf("Slices", slices_seen_, state.slices.size())) drawSlices(state, actions);
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
    if (ImGui::DragFloatRange2(fmt::format("##{}", name).c_str(), &lower, &upper, (highest - lowest) / 500,
                               lowest, highest, format(lower).c_str(), format(upper).c_str(),
                               ImGuiSliderFlags_AlwaysClamp)) {
      state.clip_box->lower[axis] = static_cast<double>(lower);
      state.clip_box->upper[axis] = static_cast<double>(std::max(lower, upper));
      actions.changed = true;
    }
    actions.dragging |= ImGui::IsItemActive();
    nameWidget(fmt::format("clip {}", name));
    hint("drag to change; Ctrl + click to type a number");
  }
  ImGui::EndDisabled();
}

/// Each plane has a direction and a place along it, which can also be dragged in the picture.
void CutPanel::drawPlanes(std::vector<ClipPlane>& planes, size_t most, const ViewState& state,
                          PanelActions& actions) {
  const Manifest& manifest = cache_.manifest();
  const glm::dvec3 middle = 0.5 * (manifest.lower + manifest.upper);
  const glm::dvec3 half = 0.5 * (manifest.upper - manifest.lower);
  const bool clips = &planes == &state.clip_planes;
  ImGui::PushID(&planes);
  ImGui::BeginDisabled(planes.size() >= most);
  commandButton(clips ? Command::kAddClipPlane : Command::kAddSlice, actions);
  ImGui::EndDisabled();
  size_t removed = planes.size();
  for (size_t n = 0; n < planes.size(); ++n) {
    ClipPlane& plane = planes[n];
    ImGui::PushID(static_cast<int>(n));
    ImGui::Separator();
    const std::string name = fmt::format("{} {}", clips ? "clip plane" : "slice", n + 1);
    const auto turn = [&](const char* label, const glm::dvec3& normal) {
      const bool turns = ImGui::Button(label);
      nameWidget(fmt::format("{} {}", label, name));
      if (!turns) return;
      plane.normal = normal;
      actions.changed = true;
    };
    turn("x", {1, 0, 0});
    ImGui::SameLine();
    turn("y", {0, 1, 0});
    ImGui::SameLine();
    turn("z", {0, 0, 1});
    ImGui::SameLine();
    turn("view", planeBeforeViewer(manifest, state).normal);
    hint("facing you");
    ImGui::SameLine();
    if (clips) {
      turn("flip", -plane.normal);
      hint("keep the other side");
      ImGui::SameLine();
    }
    if (ImGui::Button("remove")) removed = n;
    nameWidget("remove " + name);
    // From the data's one end along the normal to the other; a plane across an axis has its coordinate there.
    const PlaneScale scale = planeScaleOf(plane.normal);
    const double centre = glm::dot(scale.along, middle), reach = glm::dot(half, glm::abs(scale.along));
    const double lowest = centre - reach, highest = centre + reach;
    double place = glm::dot(scale.along, plane.point);
    label(fmt::format("{} {}", scale.name, n + 1).c_str());
    if (ImGui::SliderScalar("##place", ImGuiDataType_Double, &place, &lowest, &highest,
                            coordinateFormat(place, lowest, highest).c_str())) {
      plane.point = middle + (place - centre) * scale.along;
      actions.changed = true;
    }
    actions.dragging |= ImGui::IsItemActive();
    nameWidget(name);
    nameWidget(fmt::format("{}: {} at {:.3g}", name, scale.name, place));
    hint("Ctrl + click to type a number");
    ImGui::PopID();
  }
  ImGui::PopID();
  if (removed == planes.size()) return;
  planes.erase(planes.begin() + static_cast<ptrdiff_t>(removed));
  actions.changed = true;
}

void CutPanel::drawSlices(ViewState& state, PanelActions& actions) {
  auto opacity = static_cast<float>(state.slice_opacity.factor);
  label("opacity");
  if (ImGui::SliderFloat("##opacity", &opacity, 0.05f, 1, "%.2f", ImGuiSliderFlags_AlwaysClamp)) {
    state.slice_opacity.factor = static_cast<double>(opacity);
    actions.changed = true;
  }
  actions.dragging |= ImGui::IsItemActive();
  actions.changed |= ImGui::Checkbox("times the function's", &state.slice_opacity.by_function);
  nameWidget("slices by function");
  drawPlanes(state.slices, kMaxSlices, state, actions);
}

}  // namespace curvisplat
