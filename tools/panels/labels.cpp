#include "tools/panels/labels.h"

#include <fmt/format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "tools/window/widgets.h"

namespace curvisplat {

namespace {

/// The label that was drawn last, with the space up to the widget behind it, which fills the line up to `end`.
struct Labelled {
  ImVec2 lower, upper, widget;
  float end = 0;
};
Labelled last_label;

}  // namespace

void label(const char* text) {
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(text);
  last_label.lower = ImGui::GetItemRectMin();
  const float bottom = ImGui::GetItemRectMax().y;
  ImGui::SameLine(8.5f * ImGui::GetFontSize());
  last_label.widget = ImGui::GetCursorScreenPos();
  last_label.upper = {last_label.widget.x, bottom};
  last_label.end = last_label.widget.x + ImGui::GetContentRegionAvail().x;
  ImGui::SetNextItemWidth(-1);
}

namespace {

/// Whether the mouse is over the last widget, or over the label of one that fills its line.
bool isOverWidget() {
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) return true;
  const ImVec2 from = ImGui::GetItemRectMin(), to = ImGui::GetItemRectMax(), at = last_label.widget;
  const bool is_labelled =
      std::abs(from.x - at.x) < 1 && std::abs(from.y - at.y) < 1 && to.x > last_label.end - 2;
  return is_labelled && ImGui::IsWindowHovered() &&
         ImGui::IsMouseHoveringRect(last_label.lower, last_label.upper);
}

}  // namespace

void commandButton(Command command, PanelActions& actions, const char* text) {
  const CommandInfo& info = infoOf(command);
  if (ImGui::Button(text ? text : info.label)) actions.run(command);
  nameWidget(info.label);
  if (!*info.key_name) return;
  hint(text ? fmt::format("{} ({})", info.label, info.key_name).c_str() : info.key_name);
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

bool eye(bool& visible, const std::string& name) {
  const float side = ImGui::GetFrameHeight();
  const ImVec2 from = ImGui::GetCursorScreenPos();
  const bool clicked = ImGui::InvisibleButton("##eye", {side, side});
  nameWidget("eye of " + name);
  if (clicked) visible = !visible;
  const bool is_hovered = ImGui::IsItemHovered();
  ImDrawList* const list = ImGui::GetWindowDrawList();
  if (is_hovered)
    list->AddRectFilled(from, {from.x + side, from.y + side}, ImGui::GetColorU32(ImGuiCol_FrameBgHovered),
                        ImGui::GetStyle().FrameRounding);
  const ImU32 colour = ImGui::GetColorU32(visible ? ImGuiCol_Text : ImGuiCol_TextDisabled);
  const float line = 0.09f * side, middle = from.y + 0.5f * side;
  const ImVec2 left(from.x + 0.15f * side, middle), right(from.x + 0.85f * side, middle);
  const float x = from.x + 0.5f * side, lid = 0.55f * side;
  list->AddBezierQuadratic(left, {x, middle + lid}, right, colour, line);
  if (visible) {
    list->AddBezierQuadratic(left, {x, middle - lid}, right, colour, line);
    list->AddCircleFilled({x, middle}, 0.14f * side, colour);
  }
  hint(visible ? "hide" : "show");
  return clicked;
}

void heading(const char* text) {
  ImGui::Spacing();
  ImGui::TextUnformatted(text);
  ImGui::Separator();
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

bool unfoldsFor(const std::string& text, const std::optional<size_t>& seen, size_t number) {
  const bool has_more = number > seen.value_or(0);
  if (has_more) ImGui::SetNextItemOpen(true);
  // Only a list that was folded is scrolled to: one that is in use must not move under the mouse. Nor do the panels begin
  // at a list.
  return has_more && seen && ImGui::GetStateStorage()->GetInt(ImGui::GetID(text.c_str())) == 0;
}

}  // namespace

Section::Section(const char* text, std::optional<size_t>& seen, size_t number) {
  constexpr float kSeenLines = 8;  // of the list below its header
  // The number does not change which widget it is.
  const std::string shown = number == 0 ? text : fmt::format("{} ({})", text, number);
  const std::string label = fmt::format("{}###{}", shown, text);
  const bool unfolds = unfoldsFor(label, seen, number);
  seen = number;
  open_ = ImGui::CollapsingHeader(label.c_str());
  nameWidget(text);
  if (number > 0) nameWidget(shown);
  const float end = ImGui::GetWindowPos().y + ImGui::GetWindowHeight();
  if (unfolds && ImGui::GetItemRectMax().y + kSeenLines * ImGui::GetFrameHeight() > end)
    ImGui::SetScrollHereY(0);
  if (open_) ImGui::PushID(text);
}

void hint(const char* text) {
  constexpr double kAfterSeconds = 0.4;
  static ImVec2 hovered{-1, -1};  // the corner of the widget that the mouse rests on
  static double since_s = 0;
  const ImVec2 from = ImGui::GetItemRectMin(), to = ImGui::GetItemRectMax();
  const bool is_same = hovered.x == from.x && hovered.y == from.y;
  if (!isOverWidget() || ImGui::IsItemActive()) {
    if (is_same) hovered = {-1, -1};
    return;
  }
  if (!is_same) since_s = ImGui::GetTime();
  hovered = from;
  if (ImGui::GetTime() - since_s < kAfterSeconds) return;
  // Beside the widget and not on it, nor on its neighbours in the line.
  const ImGuiStyle& style = ImGui::GetStyle();
  const ImVec2 text_size = ImGui::CalcTextSize(text), screen = ImGui::GetIO().DisplaySize;
  const ImVec2 padding(std::max(style.WindowPadding.x, 0.5f * ImGui::GetFontSize()),
                       std::max(style.WindowPadding.y, 0.3f * ImGui::GetFontSize()));  // a bar has less of it
  const float width = text_size.x + 2 * padding.x, height = text_size.y + 2 * padding.y;
  const float below = to.y + style.ItemSpacing.y;
  ImGui::SetNextWindowPos({std::max(0.0f, std::min(from.x, screen.x - width)),
                           below + height > screen.y ? from.y - style.ItemSpacing.y - height : below});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, padding);
  ImGui::PushStyleVar(ImGuiStyleVar_Alpha, 1);  // of a disabled widget, too
  ImGui::SetTooltip("%s", text);
  ImGui::PopStyleVar(2);
  nameWidget(std::string("hint ") + text);
}

void drawFurther(const FurtherScalars& further, const WantedScalar& wanted, const std::string& prefix,
                 PanelActions& actions) {
  if (further.from.empty()) {
    if (!further.note.empty()) ImGui::TextDisabled("%s", further.note.c_str());
    if (!further.note.empty()) nameWidget("note " + further.note);
    return;
  }
  actions.looks_for_scalars = true;
  ImGui::Separator();
  const bool has_stored = std::ranges::any_of(further.scalars, [](const auto& one) { return !one.derived; });
  if (further.is_looking || further.is_busy || has_stored)
    ImGui::TextDisabled("%s", further.is_looking ? "looking for more ..."
                              : further.is_busy  ? "one is being added"
                                                 : "more, added when chosen:");
  if (!further.error.empty()) ImGui::TextDisabled("%s", further.error.c_str());
  ImGui::BeginDisabled(further.is_busy);
  for (const bool derived : {false, true}) {
    const auto is_one = [derived](const SourceScalar& one) { return one.derived == derived; };
    if (derived && std::ranges::any_of(further.scalars, is_one)) ImGui::TextDisabled("computed when chosen:");
    for (const SourceScalar& one : further.scalars) {
      if (!is_one(one)) continue;
      if (ImGui::Selectable(scalarTitle(one.name, one.unit).c_str())) {
        actions.add_scalar = wanted;
        actions.add_scalar->name = one.name;
      }
      nameWidget(prefix + one.name);
    }
  }
  ImGui::EndDisabled();
}

bool combo(const char* label, const std::string& text, int flags, const std::string& what) {
  const float width = ImGui::CalcItemWidth() - ImGui::GetFrameHeight() - 2 * ImGui::GetStyle().FramePadding.x;
  std::string shown = text;
  for (size_t length = text.size(); length > 0 && ImGui::CalcTextSize(shown.c_str()).x > width;) {
    --length;
    const bool in_letter = (static_cast<unsigned char>(text[length]) & 0xc0u) == 0x80;  // of UTF-8
    if (!in_letter) shown = text.substr(0, length) + "\u2026";
  }
  const bool open = ImGui::BeginCombo(label, shown.c_str(), flags);
  const std::string cut = shown == text ? "" : text;
  const std::string hinted = cut + (cut.empty() || what.empty() ? "" : ": ") + what;
  if (!open && !hinted.empty()) hint(hinted.c_str());
  return open;
}

}  // namespace curvisplat
