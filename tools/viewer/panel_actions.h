// What the user did in the panels and menus during a frame.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/steps_file.h"
#include "tools/viewer/window_commands.h"

namespace curvisplat {

struct PanelActions {
  bool changed = false;           // the picture must be drawn again
  bool function_changed = false;  // implies `changed`
  bool dragging = false;          // a control is being dragged: a coarse picture suffices
  std::vector<Command> commands;
  std::optional<StepPosition> time;                   // to go to
  std::optional<bool> interpolates;                   // between steps
  std::optional<std::string> scalar, opacity_scalar;  // to show; the empty name: opacities of the same scalar
  std::optional<std::string> add_faces;               // of the grid, by name
  std::optional<std::string> colour_faces;            // by a scalar; the empty name: each has its own colour
  bool automatic_function = false;                    // colours and opacities chosen from the data
  bool load_function = false, save_function = false;
  std::optional<std::string> load_view, save_view, remove_view;  // by name
  bool looks_for_scalars = false;         // for what the sources have and the cache lacks
  std::optional<std::string> add_scalar;  // of those
  std::string error;                      // of what the user asked for

  void run(Command command) { commands.push_back(command); }
};

}  // namespace curvisplat
