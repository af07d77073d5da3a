#include "tools/viewer/window_commands.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <array>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

// A letter alone never writes a file and never ends the window: typing beside a text field must not.
constexpr bool kShift = true, kControl = true, kGroup = true;
constexpr std::array kCommands{
    CommandInfo{Command::kOpen, "File", "Open...", GLFW_KEY_O, !kShift, kControl, "Ctrl+O"},
    CommandInfo{Command::kSavePicture, "File", "Save picture", GLFW_KEY_S, !kShift, kControl, "Ctrl+S",
                kGroup},
    CommandInfo{Command::kSavePictureAs, "File", "Save picture as...", GLFW_KEY_S, kShift, kControl,
                "Ctrl+Shift+S"},
    CommandInfo{Command::kSaveTurnMovie, "File", "Save movie: once around...", GLFW_KEY_M, !kShift, kControl,
                "Ctrl+M", kGroup},
    CommandInfo{Command::kSaveStepsMovie, "File", "Save movie: all time steps...", GLFW_KEY_M, kShift,
                kControl, "Ctrl+Shift+M"},
    CommandInfo{Command::kCopyCommand, "File", "Copy command for this picture", GLFW_KEY_C, !kShift, kControl,
                "Ctrl+C", kGroup},
    CommandInfo{Command::kCopyMovieCommand, "File", "Copy command for a movie", GLFW_KEY_C, kShift, kControl,
                "Ctrl+Shift+C"},
    CommandInfo{Command::kQuit, "File", "Quit", GLFW_KEY_Q, !kShift, kControl, "Ctrl+Q", kGroup},
    CommandInfo{Command::kUndo, "Edit", "Undo", GLFW_KEY_Z, !kShift, kControl, "Ctrl+Z"},
    CommandInfo{Command::kRedo, "Edit", "Redo", GLFW_KEY_Z, kShift, kControl, "Ctrl+Shift+Z"},
    CommandInfo{Command::kResetFunction, "Edit", "Colours and opacities as at first", 0, false, false, "",
                kGroup},
    CommandInfo{Command::kRemoveMarkers, "Edit", "Remove all markers"},
    CommandInfo{Command::kFit, "View", "Fit data into the picture", GLFW_KEY_R, !kShift, !kControl, "R"},
    CommandInfo{Command::kLookPlusX, "View", "From +x", GLFW_KEY_X, !kShift, !kControl, "X", kGroup},
    CommandInfo{Command::kLookMinusX, "View", "From -x", GLFW_KEY_X, kShift, !kControl, "Shift+X"},
    CommandInfo{Command::kLookPlusY, "View", "From +y", GLFW_KEY_Y, !kShift, !kControl, "Y"},
    CommandInfo{Command::kLookMinusY, "View", "From -y", GLFW_KEY_Y, kShift, !kControl, "Shift+Y"},
    CommandInfo{Command::kLookPlusZ, "View", "From +z", GLFW_KEY_Z, !kShift, !kControl, "Z"},
    CommandInfo{Command::kLookMinusZ, "View", "From -z", GLFW_KEY_Z, kShift, !kControl, "Shift+Z"},
    CommandInfo{Command::kOtherProjection, "View", "Perspective", GLFW_KEY_O, !kShift, !kControl, "O",
                kGroup},
    CommandInfo{Command::kFly, "View", "Fly (W S A D Q E move)", GLFW_KEY_F, !kShift, !kControl, "F"},
    CommandInfo{Command::kSaveView, "View", "Save this view...", 0, false, false, "", kGroup},
    CommandInfo{Command::kLight, "Picture", "Lighting", GLFW_KEY_L, !kShift, !kControl, "L"},
    CommandInfo{Command::kDarkBackground, "Picture", "Dark background", GLFW_KEY_B, !kShift, !kControl, "B"},
    CommandInfo{Command::kScalarBar, "Picture", "Scalar bar", 0, false, false, "", kGroup},
    CommandInfo{Command::kAxes, "Picture", "Axes"},
    CommandInfo{Command::kAxesGrid, "Picture", "Axes with numbers"},
    CommandInfo{Command::kOutline, "Picture", "Outline"},
    CommandInfo{Command::kAddClipPlane, "Picture", "Add a clip plane", 0, false, false, "", kGroup},
    CommandInfo{Command::kAddSlice, "Picture", "Add a slice"},
    CommandInfo{Command::kAddIsosurface, "Picture", "Add an isosurface"},
    CommandInfo{Command::kAddSurfaceFile, "Picture", "Add a surface from a file..."},
    CommandInfo{Command::kPlay, "Time", "Play", GLFW_KEY_SPACE, !kShift, !kControl, "Space"},
    CommandInfo{Command::kNextStep, "Time", "Next step", GLFW_KEY_PERIOD, !kShift, !kControl, "."},
    CommandInfo{Command::kPreviousStep, "Time", "Previous step", GLFW_KEY_COMMA, !kShift, !kControl, ","},
    CommandInfo{Command::kPanels, "Window", "Panels", GLFW_KEY_H, !kShift, !kControl, "H"},
    CommandInfo{Command::kLightTheme, "Window", "Light theme"},
    CommandInfo{Command::kLargerText, "Window", "Larger text", GLFW_KEY_EQUAL, !kShift, kControl, "Ctrl++",
                kGroup},
    CommandInfo{Command::kSmallerText, "Window", "Smaller text", GLFW_KEY_MINUS, !kShift, kControl, "Ctrl+-"},
    CommandInfo{Command::kMessages, "Window", "Messages", 0, false, false, "", kGroup},
    CommandInfo{Command::kDismissMessages, "Window", "Dismiss messages", GLFW_KEY_ESCAPE, !kShift, !kControl,
                "Esc"},
    CommandInfo{Command::kKeys, "Help", "Keys and mouse", GLFW_KEY_F1, !kShift, !kControl, "F1 or ?"},
};

/// Keys that are the same to people.
Window::Key usual(Window::Key key) {
  if (key.control && (key.code == GLFW_KEY_KP_ADD || key.code == GLFW_KEY_EQUAL))
    return {GLFW_KEY_EQUAL, false, true};
  if (key.control && key.code == GLFW_KEY_KP_SUBTRACT) return {GLFW_KEY_MINUS, false, true};
  if (key.control && key.code == GLFW_KEY_Y) return {GLFW_KEY_Z, true, true};
  if (key.code == Window::kQuestionMark) return {GLFW_KEY_F1};
  return key;
}

}  // namespace

std::span<const CommandInfo> commands() {
  return kCommands;
}

const CommandInfo& infoOf(Command command) {
  const auto found = std::find_if(kCommands.begin(), kCommands.end(),
                                  [command](const CommandInfo& info) { return info.command == command; });
  CURVISPLAT_CHECK(found != kCommands.end());
  return *found;
}

std::optional<Command> commandOf(const Window::Key& pressed_key) {
  const Window::Key key = usual(pressed_key);
  for (const CommandInfo& info : kCommands)
    if (info.key != 0 && info.key == key.code && info.shift == key.shift && info.control == key.control)
      return info.command;
  return std::nullopt;
}

}  // namespace curvisplat
