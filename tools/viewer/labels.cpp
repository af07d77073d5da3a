#include "tools/viewer/labels.h"

#include <imgui.h>

#include "tools/viewer/widget_places.h"

namespace curvisplat {

void label(const char* text) {
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(text);
  ImGui::SameLine(8.5f * ImGui::GetFontSize());
  ImGui::SetNextItemWidth(-1);
}

void commandButton(Command command, PanelActions& actions, const char* text) {
  const CommandInfo& info = infoOf(command);
  if (ImGui::Button(text ? text : info.label)) actions.run(command);
  nameWidget(info.label);
  if (*info.key_name) hint(info.key_name);
}

void commandOption(Command command, PanelActions& actions, const char* text, bool on) {
  const CommandInfo& info = infoOf(command);
  if (ImGui::Checkbox(text, &on)) actions.run(command);
  nameWidget(info.label);
  if (*info.key_name) hint(info.key_name);
}

bool option(const char* text, bool& value) {
  const bool changed = ImGui::Checkbox(text, &value);
  nameWidget(text);
  return changed;
}

bool section(const char* text, bool open_at_first) {
  const bool open = ImGui::CollapsingHeader(text, open_at_first ? ImGuiTreeNodeFlags_DefaultOpen : 0);
  nameWidget(text);
  return open;
}

bool sectionOf(const char* text, size_t& seen, size_t number) {
  const bool has_more = number > seen;
  seen = number;
  if (has_more) ImGui::SetNextItemOpen(true);
  return section(text, false);
}

void hint(const char* text) {
  if (ImGui::IsItemHovered() && !ImGui::IsItemActive()) ImGui::SetTooltip("%s", text);
}

}  // namespace curvisplat
