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

Section::Section(const char* text, bool open_at_first)
    : open_(ImGui::CollapsingHeader(text, open_at_first ? ImGuiTreeNodeFlags_DefaultOpen : 0)) {
  nameWidget(text);
  if (open_) ImGui::PushID(text);
}

Section::~Section() {
  if (open_) ImGui::PopID();
}

namespace {

bool unfoldsFor(const char* text, const std::optional<size_t>& seen, size_t number) {
  const bool has_more = number > seen.value_or(0);
  if (has_more) ImGui::SetNextItemOpen(true);
  // Only a list that was folded is scrolled to: one that is in use must not move under the mouse. Nor do the panels begin
  // at a list.
  return has_more && seen && ImGui::GetStateStorage()->GetInt(ImGui::GetID(text)) == 0;
}

}  // namespace

Section::Section(const char* text, std::optional<size_t>& seen, size_t number)
    : open_(unfoldsFor(text, seen, number)) {
  constexpr float kSeenLines = 8;  // of the list below its header
  const bool unfolds = open_;
  seen = number;
  open_ = ImGui::CollapsingHeader(text);
  nameWidget(text);
  const float end = ImGui::GetWindowPos().y + ImGui::GetWindowHeight();
  if (unfolds && ImGui::GetItemRectMax().y + kSeenLines * ImGui::GetFrameHeight() > end)
    ImGui::SetScrollHereY(0);
  if (open_) ImGui::PushID(text);
}

void hint(const char* text) {
  if (ImGui::IsItemHovered() && !ImGui::IsItemActive()) ImGui::SetTooltip("%s", text);
}

}  // namespace curvisplat
