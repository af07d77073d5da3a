#include "tools/window/keyboard_focus.h"

#include <GLFW/glfw3.h>
#include <imgui_internal.h>

#include <algorithm>
#include <tuple>

namespace curvisplat {
namespace {

/// The list, menu or dialog in front of all others; null without one, or before its first frame.
const ImGuiWindow* popup() {
  const ImGuiContext& g = *ImGui::GetCurrentContext();
  return g.OpenPopupStack.empty() ? nullptr : g.OpenPopupStack.back().Window;
}

bool isIn(const ImGuiWindow* window, const ImGuiWindow* outer) {
  for (; window; window = window->ParentWindow)
    if (window == outer) return true;
  return false;
}

/// Presses a widget in the next frame; a field, or a slider, takes letters from then on.
void activate(ImGuiID id, bool takes_text) {
  ImGuiContext& g = *ImGui::GetCurrentContext();
  ImGui::ActivateItem(id);
  if (takes_text)
    g.NavNextActivateFlags = ImGuiActivateFlags_PreferInput | ImGuiActivateFlags_TryToPreserveState;
}

}  // namespace

KeyboardFocus& keyboardFocus() {
  static KeyboardFocus focus;
  return focus;
}

void KeyboardFocus::beginFrame(std::span<const int> pressed) {
  stops_before_ = std::exchange(stops_, {});
  offered_.clear();
  had_ring_ = std::exchange(has_ring_, false);
  const ImGuiContext& g = *ImGui::GetCurrentContext();
  const ImGuiIO& io = g.IO;
  if (std::ranges::any_of(io.MouseClicked, [](bool clicked) { return clicked; })) is_shown_ = false;
  if (!g.OpenPopupStack.empty() && !below_) {
    below_ = {focused_, std::exchange(place_, 0)};
  } else if (g.OpenPopupStack.empty() && below_) {
    std::tie(focused_, place_) = *below_;
    below_.reset();
  }
  // Tab goes on from what the mouse has used.
  const auto used = std::ranges::find(stops_before_, g.ActiveId, &Stop::id);
  if (g.ActiveId != 0 && used != stops_before_.end()) {
    focused_ = g.ActiveId;
    const auto stops = stopsInFront();
    place_ = static_cast<size_t>(std::ranges::find(stops, focused_, &Stop::id) - stops.begin());
  }
  const bool has_list = popup() && (popup()->Flags & ImGuiWindowFlags_Modal) == 0;
  for (const int key : pressed) {
    if (key == GLFW_KEY_ESCAPE) is_shown_ = false;
    if (key == GLFW_KEY_TAB && !io.KeyCtrl && !io.KeyAlt) move(io.KeyShift ? -1 : 1);
    if (has_list && key == GLFW_KEY_DOWN) move(1);
    if (has_list && key == GLFW_KEY_UP) move(-1);
    const bool presses = key == GLFW_KEY_SPACE || key == GLFW_KEY_ENTER || key == GLFW_KEY_KP_ENTER;
    if (presses && is_shown_ && !io.WantTextInput) press();
  }
}

/// The last frame's stops in the order of Tab: the menus come last, which have keys of their own.
std::vector<KeyboardFocus::Stop> KeyboardFocus::stopsInFront() const {
  std::vector<Stop> stops;
  const bool is_covered = !ImGui::GetCurrentContext()->OpenPopupStack.empty();
  for (const Stop& stop : stops_before_)
    if (!is_covered || (popup() && isIn(stop.window, popup()))) stops.push_back(stop);
  if (!is_covered)
    // Clang 14 does not compile the ranges' form with GCC 12's library.
    std::stable_partition(stops.begin(), stops.end(), [](const Stop& stop) {
      return (stop.window->Flags & ImGuiWindowFlags_MenuBar) == 0;
    });
  return stops;
}

void KeyboardFocus::move(int step) {
  const std::vector<Stop> stops = stopsInFront();
  if (stops.empty()) return;  // Dear ImGui's Tab goes from field to field
  ImGui::NavMoveRequestCancel();
  const auto now = std::ranges::find(stops, focused_, &Stop::id);
  const size_t count = stops.size();
  if (now != stops.end())
    place_ = (static_cast<size_t>(now - stops.begin()) + count + static_cast<size_t>(step)) % count;
  else if (focused_ == 0 || place_ >= count || below_)  // the first
    place_ = step > 0 ? 0 : count - 1;
  const Stop& stop = stops[place_];
  focused_ = stop.id;
  is_shown_ = true;
  if (ImGui::GetCurrentContext()->ActiveId != stop.id) ImGui::ClearActiveID();
  ImGui::ScrollToRect(stop.window, {stop.lower, stop.upper}, ImGuiScrollFlags_KeepVisibleEdgeY);
  if (stop.takes_text) activate(stop.id, true);
}

void KeyboardFocus::press() const {
  const std::vector<Stop> stops = stopsInFront();
  const auto stop = std::ranges::find(stops, focused_, &Stop::id);
  if (stop != stops.end()) activate(stop->id, stop->takes_text);
}

bool KeyboardFocus::offer(ImGuiID part) {
  const ImGuiLastItemData& item = ImGui::GetCurrentContext()->LastItemData;
  const ImGuiID id = part != 0 ? part : item.ID;
  if (id == 0 || (item.InFlags & ImGuiItemFlags_Disabled) != 0) return false;
  if (!offered_.insert(id).second) return false;
  stops_.push_back({id, ImGui::GetCurrentWindow(), item.Rect.Min, item.Rect.Max,
                    (item.InFlags & ImGuiItemFlags_Inputable) != 0});
  if (!is_shown_ || id != focused_) return false;
  const float width = 0.14f * ImGui::GetFontSize(), half = 0.5f * width;
  ImGui::GetWindowDrawList()->AddRect(
      {item.Rect.Min.x + half, item.Rect.Min.y + half}, {item.Rect.Max.x - half, item.Rect.Max.y - half},
      ImGui::GetColorU32(ImGuiCol_NavHighlight), ImGui::GetStyle().FrameRounding, 0, width);
  has_ring_ = true;
  return true;
}

}  // namespace curvisplat
