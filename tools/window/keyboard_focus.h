// The keyboard's focus in the window: Tab and Shift + Tab go from widget to widget in the order in which they are drawn, Space
// and Return press the one that has the focus, which has a ring. In an open list or menu the arrows up and down do the same.
//
// Dear ImGui's own navigation is not used: it takes the arrows, Escape, Home, End and Alt, which are commands here, and its Tab
// stops at fields of text and numbers alone. For the window's thread.
#pragma once

#include <imgui.h>

#include <optional>
#include <span>
#include <unordered_set>
#include <utility>
#include <vector>

struct ImGuiWindow;

namespace curvisplat {

class KeyboardFocus {
 public:
  /// The keys that were pressed since the last frame, by GLFW's codes. Call it after ImGui::NewFrame().
  void beginFrame(std::span<const int> pressed);
  /// Lets Tab stop at the item that Dear ImGui drew last, unless it is disabled or has no identifier. Returns whether it has the
  /// focus, and draws its ring then. `part`: the identifier of what is pressed of a group.
  bool offer(ImGuiID part = 0);
  /// Whether a widget had the ring in the last frame, so that Space and Return are for it.
  bool isShown() const { return is_shown_ && had_ring_; }

 private:
  struct Stop {
    ImGuiID id;
    ImGuiWindow* window;
    ImVec2 lower, upper;
    bool takes_text;
  };
  std::vector<Stop> stopsInFront() const;
  void move(int step);
  void press() const;

  std::vector<Stop> stops_, stops_before_;  // of this frame, and of the last one
  std::unordered_set<ImGuiID> offered_;     // the identifiers in stops_
  ImGuiID focused_ = 0;
  size_t place_ = 0;  // of the focused one among the stops, when Tab came there
  std::optional<std::pair<ImGuiID, size_t>>
      below_;  // what had the focus before a list or a dialog was opened
  bool is_shown_ = false;
  bool has_ring_ = false,
       had_ring_ = false;  // whether a widget was drawn with it in this frame, and in the last one
};

/// The one of the window.
KeyboardFocus& keyboardFocus();

}  // namespace curvisplat
