#include "tools/viewer/marker_panel.h"

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>

#include "tools/viewer/labels.h"
#include "tools/viewer/widget_places.h"

namespace curvisplat {

void drawMarkers(ViewState& state, PanelActions& actions) {
  if (state.markers.empty()) ImGui::TextDisabled("Click into the picture to keep a value.");
  size_t removed = state.markers.size();
  for (size_t n = 0; n < state.markers.size(); ++n) {
    Marker& marker = state.markers[n];
    ImGui::PushID(static_cast<int>(n));
    if (ImGui::Button("x")) removed = n;
    nameWidget(fmt::format("remove marker {}", n + 1));
    hint("remove this marker");
    ImGui::SameLine();
    ImGui::SetNextItemWidth(6 * ImGui::GetFontSize());
    actions.changed |= ImGui::InputText("##name", &marker.name);
    nameWidget(fmt::format("marker {}", n + 1));
    if (ImGui::IsItemActive()) nameWidget(fmt::format("editing marker {}", n + 1));
    ImGui::SameLine();
    ImGui::TextWrapped("%s", fmt::format("{} {:.5g}{}{}\n{:.5g}, {:.5g}, {:.5g}", marker.scalar, marker.value,
                                         marker.unit.empty() ? "" : " ", marker.unit, marker.point.x,
                                         marker.point.y, marker.point.z)
                                 .c_str());
    hint(fmt::format("block {}, i {}, j {}, k {}", marker.block + 1, marker.i, marker.j, marker.k).c_str());
    ImGui::PopID();
  }
  if (removed == state.markers.size()) return;
  state.markers.erase(state.markers.begin() + static_cast<ptrdiff_t>(removed));
  actions.changed = true;
}

void drawMarkerSigns(const ViewState& state,
                     const std::function<std::optional<glm::dvec2>(const glm::dvec3&)>& place) {
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  const ImU32 line = IM_COL32(255, 255, 255, 255), edge = IM_COL32(0, 0, 0, 255);
  const float radius = 0.3f * ImGui::GetFontSize();
  for (size_t n = 0; n < state.markers.size(); ++n) {
    const Marker& marker = state.markers[n];
    const auto at = place(marker.point);
    if (!at) continue;
    const ImVec2 centre(static_cast<float>(at->x), static_cast<float>(at->y));
    list->AddCircleFilled(centre, radius, edge);
    list->AddCircleFilled(centre, 0.7f * radius, line);
    // Beside another scalar than the one that is shown stands its name.
    const std::string text =
        fmt::format("{}: {}{}{:.4g} {}", marker.name, marker.scalar == state.variable ? "" : marker.scalar,
                    marker.scalar == state.variable ? "" : " ", marker.value, marker.unit);
    const ImVec2 size = ImGui::CalcTextSize(text.c_str());
    const ImVec2 lower(centre.x + 1.5f * radius, centre.y - 0.5f * size.y);
    list->AddRectFilled({lower.x - 3, lower.y - 1}, {lower.x + size.x + 3, lower.y + size.y + 1},
                        IM_COL32(0, 0, 0, 170), 3);
    list->AddText(lower, line, text.c_str());
    nameArea(fmt::format("sign of marker {}", n + 1), at->x - 4, at->y - 4, 8, 8);
  }
}

Marker markerOf(const ViewState& state, const VariableInfo& variable, const glm::dvec3& point,
                const ProbeResult& found) {
  const auto taken = [&](const std::string& name) {
    return std::any_of(state.markers.begin(), state.markers.end(),
                       [&](const Marker& marker) { return marker.name == name; });
  };
  int number = 1;
  while (taken(std::to_string(number))) ++number;
  return {std::to_string(number),
          point,
          variable.name,
          variable.unit,
          static_cast<double>(found.variables.at(0).value),
          found.block,
          found.i,
          found.j,
          found.k};
}

std::string textOf(const Marker& marker, size_t blocks, bool cells) {
  const std::string unit = marker.unit.empty() ? "" : " " + marker.unit;
  const std::string block = blocks > 1 ? fmt::format("block {}, ", marker.block + 1) : "";
  return fmt::format("{} {:.5g}{} at {:.5g}, {:.5g}, {:.5g}; {} {}i {}, j {}, k {}", marker.scalar,
                     marker.value, unit, marker.point.x, marker.point.y, marker.point.z,
                     cells ? "cell" : "node", block, marker.i, marker.j, marker.k);
}

}  // namespace curvisplat
