#include "tools/viewer/welcome_page.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <filesystem>

#include "tools/window/widgets.h"

namespace curvisplat {
namespace {

constexpr float kWidth = 36, kTop = 0.18f;  // in letters; a share of the height

void drawTitle() {
  ImGui::TextUnformatted("curvisplat");
  ImGui::TextDisabled("Drop a grid with its solutions here, or a cache.");
  ImGui::Dummy({0, ImGui::GetFontSize()});
}

bool bigButton(const char* text, const char* name) {
  const float unit = ImGui::GetFontSize();
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {1.2f * unit, 0.5f * unit});
  const bool pressed = ImGui::Button(text);
  ImGui::PopStyleVar();
  nameWidget(name);
  return pressed;
}

/// The names of files, and the folder of the first in grey beside them.
bool drawRecent(const std::vector<std::string>& files, size_t number) {
  std::string names;
  for (const std::string& file : files)
    names += (names.empty() ? "" : "  ") + std::filesystem::path(file).filename().string();
  const bool chosen = ImGui::Selectable(fmt::format("{}##{}", names, number).c_str());
  nameWidget(fmt::format("recent {}", number + 1));
  const std::string folder = std::filesystem::path(files.front()).lexically_normal().parent_path().string();
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", files.front().c_str());
  const float wide = ImGui::CalcTextSize(folder.c_str()).x, right = ImGui::GetContentRegionMax().x;
  const float own = ImGui::CalcTextSize(names.c_str()).x + 2 * ImGui::GetFontSize();
  if (wide + own > right) return chosen;
  ImGui::SameLine(right - wide);
  ImGui::TextDisabled("%s", folder.c_str());
  return chosen;
}

}  // namespace

WelcomeChoice drawWelcomePage(const std::vector<std::vector<std::string>>& recent, bool has_example) {
  WelcomeChoice choice;
  const ImVec2 whole = ImGui::GetContentRegionAvail();
  const float wide = std::min(kWidth * ImGui::GetFontSize(), whole.x);
  ImGui::SetCursorPos({std::max(0.5f * (whole.x - wide), ImGui::GetCursorPosX()), kTop * whole.y});
  ImGui::BeginChild("page", {wide, 0});
  drawTitle();
  choice.opens = bigButton("Open...", "open");
  if (has_example) {
    ImGui::SameLine();
    choice.example = bigButton("Show an example", "example");
  }
  ImGui::Spacing();
  ImGui::PushTextWrapPos(0);
  ImGui::TextDisabled(
      "%s",
      "PLOT3D, CGNS, VTK, NetCDF, Zarr, OpenFOAM, Tecplot, EnSight, XDMF, Fluent, Gmsh and others; "
      "caches: NAME.splats");
  ImGui::PopTextWrapPos();
  if (!recent.empty()) {
    ImGui::Dummy({0, ImGui::GetFontSize()});
    ImGui::TextUnformatted("Opened before");
    ImGui::Separator();
  }
  for (size_t n = 0; n < recent.size(); ++n)
    if (drawRecent(recent[n], n)) choice.recent = n;
  ImGui::EndChild();
  return choice;
}

}  // namespace curvisplat
