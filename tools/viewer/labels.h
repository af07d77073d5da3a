// Widgets of the panels with their labels before them, where they are read.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "tools/viewer/panel_actions.h"

namespace curvisplat {

/// Writes a label, and makes the next widget fill the rest of the line. The widget's own label begins with ##.
void label(const char* text);
/// A button of a command, with its key. It is named as the command's label.
void commandButton(Command command, PanelActions& actions, const char* text = nullptr);
/// A checkbox of a command that switches something; `on` is how it is now. Named as the command's label.
void commandOption(Command command, PanelActions& actions, const char* text, bool on);
/// A checkbox; named by its label. Returns whether it changed.
bool option(const char* text, bool& value);
/// A heading that folds what is below. Named by its text. Returns whether it is unfolded.
bool section(const char* text, bool open_at_first);
/// The same of a list, which is folded at first: unfolded if it has more than before, by the menu or by a saved view, and then
/// scrolled to if it would lie below the window's end. `seen`: how many there were in the frame before; none before the first.
bool sectionOf(const char* text, std::optional<size_t>& seen, size_t number);
/// A line under the widget that the mouse is over, after a moment.
void hint(const char* text);

}  // namespace curvisplat
