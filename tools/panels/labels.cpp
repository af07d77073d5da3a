#include "tools/panels/labels.h"

#include <imgui.h>

#include "tools/window/widgets.h"

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

bool sectionOf(const char* text, std::optional<size_t>& seen, size_t number) {
  constexpr float kSeenLines = 8;  // of the list below its header
  const bool at_first = !seen, has_more = number > seen.value_or(0);
  seen = number;
  const bool was_open = ImGui::GetStateStorage()->GetInt(ImGui::GetID(text)) != 0;
  if (has_more) ImGui::SetNextItemOpen(true);
  const bool open = section(text, false);
  // Only a list that was folded: one that is in use must not move under the mouse. Nor do the panels begin
  // at a list.
  const float end = ImGui::GetWindowPos().y + ImGui::GetWindowHeight();
  if (has_more && !at_first && !was_open &&
      ImGui::GetItemRectMax().y + kSeenLines * ImGui::GetFrameHeight() > end)
    ImGui::SetScrollHereY(0);
  return open;
}

void hint(const char* text) {
  if (ImGui::IsItemHovered() && !ImGui::IsItemActive()) ImGui::SetTooltip("%s", text);
}

}  // namespace curvisplat
