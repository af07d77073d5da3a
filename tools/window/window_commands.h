// The commands of the window, by key or menu item: one table of commands, from which menus, keys and the page
// of keys are made, so that they agree; and the menus, messages and pages that are drawn with it.
//
// The table is constant: any thread may read it. What draws is for the window's thread, within a frame.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/view/background_jobs.h"
#include "tools/view/saved_views.h"
#include "tools/window/reports.h"
#include "tools/window/window.h"

namespace curvisplat {

enum class Command {
  kOpen,
  kSavePicture,
  kSavePictureAs,
  kSaveTurnMovie,
  kSaveStepsMovie,
  kSaveFilmMovie,
  kCopyCommand,
  kCopyMovieCommand,
  kCopyFilmCommand,
  kQuit,
  kUndo,
  kRedo,
  kResetFunction,
  kFirstView,
  kFit,  // this and the sides to look from fit the data into the picture
  kLookPlusX,
  kLookMinusX,
  kLookPlusY,
  kLookMinusY,
  kLookPlusZ,
  kLookMinusZ,
  kLookIsometric,
  kTurnRight,
  kTurnLeft,
  kTurnUp,
  kTurnDown,
  kRollLeft,
  kRollRight,
  kZoomIn,
  kZoomOut,
  kOtherProjection,
  kFly,
  kSaveView,
  kScalarBar,
  kAxes,
  kAxesGrid,
  kOutline,
  kLight,
  kDarkBackground,
  kPlaneFrames,
  kAddClipPlane,
  kAddSlice,
  kAddIsosurface,
  kAddSurfaceFile,
  kRemoveMarkers,
  kPlay,
  kNextStep,
  kPreviousStep,
  kFirstStep,
  kLastStep,
  kPanels,
  kLightTheme,
  kLargerText,
  kSmallerText,
  kKeys,
  kMessages,
  kDismissMessages,
};

struct CommandInfo {
  Command command;
  const char* menu;   // in which it stands
  const char* label;  // there
  int key = 0;        // GLFW's code; 0: none
  bool shift = false, control = false;
  const char* key_name = "";  // as people read it: "Ctrl+S"
  bool begins_group = false;  // a line is drawn above it
};

/// The commands in the order of the menus.
std::span<const CommandInfo> commands();
const CommandInfo& infoOf(Command command);
/// The command of a key; nullopt if it has none.
std::optional<Command> commandOf(const Window::Key& key);

/// A command as the class that carries it out knows it.
template <typename Owner>
struct CommandAction {
  Command command;
  void (*run)(Owner&);
  bool (*is_enabled)(const Owner&) = nullptr;  // null: always
  bool (*is_checked)(const Owner&) = nullptr;  // null: never
};

/// The action of a command in a class's table; nullptr if it has none.
template <typename Owner>
const CommandAction<Owner>* actionOf(std::span<const CommandAction<Owner>> table, Command command) {
  const auto found = std::ranges::find(table, command, &CommandAction<Owner>::command);
  return found == table.end() ? nullptr : &*found;
}

/// The contents of the menus.
struct MenuFacts {
  std::function<bool(Command)> is_enabled, is_checked;
  std::vector<std::vector<std::string>> recent;
  std::vector<std::string> scalars, opacity_scalars, views, faces;
  std::string scalar, opacity_scalar;  // those that are shown
  FurtherScalars further;
};

/// The choices made in the menus.
struct MenuChoice {
  std::vector<Command> commands;
  std::optional<std::vector<std::string>> open;  // files
  std::optional<std::string> scalar, opacity_scalar, view, faces, add_scalar, add_opacity_scalar;
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
