// The common parts of all panels: PanelActions, into which they write what the user did during a frame, and
// widgets with their labels before them, where they are read. For the window's thread, within a frame of Dear
// ImGui.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stream/cache/series.h"
#include "tools/view/background_jobs.h"
#include "tools/window/window_commands.h"

namespace curvisplat {

/// The user's actions with the film: key frames by number, times in seconds.
struct FilmActions {
  bool add = false, replace = false, remove = false, play = false, open = false, save = false;
  std::optional<size_t> select;
  std::optional<double> go_to;
  std::optional<std::pair<size_t, double>> move;
};

/// The user's actions in the panels and menus during a frame.
struct PanelActions {
  bool changed = false;           // the picture must be drawn again
  bool function_changed = false;  // implies `changed`
  bool dragging = false;          // a control is being dragged: a coarse picture suffices
  std::vector<Command> commands;
  std::optional<StepPosition> time;                   // to go to
  std::optional<bool> interpolates;                   // between steps
  std::optional<std::string> scalar, opacity_scalar;  // to show; the empty name: opacities of the same scalar
  std::optional<std::string> add_faces;               // of the grid, by name
  std::string pointed_faces;                          // that the mouse points at in a list; empty: none
  std::optional<std::pair<uint64_t, std::string>> isosurface_scalar;  // of the one with this id
  std::optional<std::string> colour_faces;  // by a scalar; the empty name: each has its own colour
  bool automatic_function = false;          // colours and opacities chosen from the data
  bool automatic_opacities = false;  // range and opacities alone, of the scalar that gives the opacities
  bool load_function = false, save_function = false;
  std::optional<std::string> load_view, save_view, remove_view;  // by name
  bool looks_for_scalars = false;          // for what the sources have and the cache lacks
  std::optional<WantedScalar> add_scalar;  // of those
  FilmActions film;
  std::string error;  // of what the user asked for

  void run(Command command) { commands.push_back(command); }
};

/// Writes a label, and makes the next widget fill the rest of the line; that widget's own label begins with ##.
void label(const char* text);
/// A button of a command, with its key. It is named as the command's label.
void commandButton(Command command, PanelActions& actions, const char* text = nullptr);
/// A checkbox of a command that switches something; `on` is how it is now. Named as the command's label.
void commandOption(Command command, PanelActions& actions, const char* text, bool on);
/// A checkbox; named by its label. Returns whether it changed.
bool option(const char* text, bool& value);
/// An eye that shows or hides an object; named "eye of NAME". Returns whether it was clicked.
bool eye(bool& visible, const std::string& name);
/// A line of text above a group of widgets.
void heading(const char* text);
/// A heading that folds what is below. Named by its text. While one that is unfolded is in scope, widgets are told apart
/// from those of the same label below other headings.
class Section {
 public:
  Section(const char* text, bool open_at_first);
  /// A section with a list, which is folded at first, and whose heading counts the entries. It unfolds if the list has grown, by the menu
  /// or by a saved view, and is then scrolled to if it would lie below the window's end. `seen`: how many entries
  /// there were in the frame before; nullopt before the first frame.
  Section(const char* text, std::optional<size_t>& seen, size_t number);
  ~Section();
  Section(const Section&) = delete;
  Section& operator=(const Section&) = delete;

  explicit operator bool() const { return open_; }

 private:
  bool open_;
};
/// Draws the scalars that the sources have besides, at the end of a list of scalars. `wanted`: what one that is chosen is for; `prefix`:
/// of the names of widgets.
void drawFurther(const FurtherScalars& further, const WantedScalar& wanted, const std::string& prefix,
                 PanelActions& actions);
/// Dear ImGui's BeginCombo(). A text that is too long for it ends with an ellipsis, and is in its hint. `what`: the rest of the hint.
bool combo(const char* label, const std::string& text, int flags, const std::string& what = "");
/// Shows a line under the widget that the mouse is over, after a moment; of one that fills the line behind its label, over the label, too.
void hint(const char* text);

}  // namespace curvisplat
