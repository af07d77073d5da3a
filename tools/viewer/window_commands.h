// What the window does on a key or a menu item: one table, from which menus, keys and the page of keys are made, so
// that they agree.
#pragma once

#include <optional>
#include <span>

#include "tools/viewer/window.h"

namespace curvisplat {

enum class Command {
  kOpen,
  kSavePicture,
  kSavePictureAs,
  kSaveTurnMovie,
  kSaveStepsMovie,
  kCopyCommand,
  kCopyMovieCommand,
  kQuit,
  kUndo,
  kRedo,
  kResetFunction,
  kFit,
  kLookPlusX,
  kLookMinusX,
  kLookPlusY,
  kLookMinusY,
  kLookPlusZ,
  kLookMinusZ,
  kOtherProjection,
  kFly,
  kSaveView,
  kScalarBar,
  kAxes,
  kAxesGrid,
  kOutline,
  kLight,
  kDarkBackground,
  kAddClipPlane,
  kAddSlice,
  kAddIsosurface,
  kAddSurfaceFile,
  kRemoveMarkers,
  kPlay,
  kNextStep,
  kPreviousStep,
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

/// In the order of the menus.
std::span<const CommandInfo> commands();
const CommandInfo& infoOf(Command command);
/// The command of a key; nullopt if it has none.
std::optional<Command> commandOf(const Window::Key& key);

}  // namespace curvisplat
