// The menu bar, with everything that the window does, and what is drawn over the picture: messages, the page of keys.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/viewer/further_scalar_list.h"
#include "tools/viewer/state_files.h"
#include "tools/viewer/toasts.h"
#include "tools/viewer/window_commands.h"

namespace curvisplat {

/// What the menus show.
struct MenuFacts {
  std::function<bool(Command)> is_enabled, is_checked;
  std::vector<std::vector<std::string>> recent;
  std::vector<std::string> scalars, opacity_scalars, views, faces;
  std::string scalar, opacity_scalar;  // those that are shown
  FurtherScalars further;
};

/// What was chosen in them.
struct MenuChoice {
  std::vector<Command> commands;
  std::optional<std::vector<std::string>> open;  // files
  std::optional<std::string> scalar, opacity_scalar, view, faces, add_scalar;
  bool looks_for_scalars = false;  // for what the cache's sources have and the cache lacks
};

/// Draws the bar over the window's whole width. Its height is that of a frame of Dear ImGui's.
MenuChoice drawMenus(const MenuFacts& facts, Window& window);

/// Closes the menus and the lists that are open, as Escape does. False if there were none.
bool closeLists();

/// Draws the messages in the corner of the picture; a click removes one.
void drawToasts(Toasts& toasts, const Rectangle& picture, double now_s, Window& window);
/// Draws windows that close by a button or Escape: `open` is set to false then.
void drawKeys(bool& open, Window& window);
void drawMessages(const Toasts& toasts, bool& open, Window& window);

}  // namespace curvisplat
