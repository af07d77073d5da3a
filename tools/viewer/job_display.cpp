#include "tools/viewer/job_display.h"

#include <imgui.h>

#include "tools/viewer/widget_places.h"

namespace curvisplat {

bool JobDisplay::draw(const BackgroundJob& job, const std::string& name, const std::string& note) {
  const float unit = ImGui::GetFontSize();
  ImGui::SetNextWindowPos(
      {static_cast<float>(picture_.x) + unit, static_cast<float>(picture_.y) + unit + below_});
  ImGui::SetNextWindowSize({26 * unit, 0});
  ImGui::Begin(name.c_str(), nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_AlwaysAutoResize);
  window_.coverCurrent();
  ImGui::TextUnformatted(job.title().c_str());
  if (!note.empty()) ImGui::TextDisabled("%s", note.c_str());
  // Dear ImGui's yellow leaves white letters unread.
  ImGui::PushStyleColor(ImGuiCol_PlotHistogram, ImGui::GetStyleColorVec4(ImGuiCol_ButtonActive));
  ImGui::ProgressBar(job.part(), {-1, 0}, job.phase().c_str());
  ImGui::PopStyleColor();
  nameWidget(name);
  const bool stops = ImGui::Button("stop");
  nameWidget("stop " + name);
  below_ += ImGui::GetWindowSize().y + 0.5f * unit;
  ImGui::End();
  return stops;
}

}  // namespace curvisplat
