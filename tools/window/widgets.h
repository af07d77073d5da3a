// Additions to Dear ImGui: a number for what a frame looks like, the window's font, fields for numbers,
// and the places of widgets for tests. For the window's thread. Only loadFont() reads a file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

struct ImDrawData;

namespace curvisplat {

/// A number that is equal for frames that look the same and almost certainly differs for others. It knows
/// which textures a frame uses, but not when their contents change.
uint64_t appearanceOf(const ImDrawData& frame);

/// Replaces Dear ImGui's fonts by DejaVu Sans, or its own bitmap font where that is not installed, `pixels`
/// high on the screen. `pixels_per_unit`: as Window::pixelScale(). Returns whether DejaVu Sans was found.
/// Call it before the first frame or between frames; the texture has to be made anew then.
bool loadFont(float pixels, float pixels_per_unit);

/// Fields for numbers that take effect when they are left: by Return, by Tab or by a click elsewhere. One
/// object serves any number of fields, of which one at a time is typed into.
class TypedNumbers {
 public:
  static constexpr size_t kMax = 3;
  /// Draws a field for each of `values`, beside each other. Returns what was typed, once, when all of them
  /// have been left; Escape takes back what was typed. `label` is Dear ImGui's, `format` is printf's.
  std::optional<std::array<double, kMax>> draw(const char* label, std::span<const double> values,
                                               const char* format);

 private:
  unsigned field_ = 0;  // that is typed into, by Dear ImGui's identifier
  std::array<double, kMax> typed_{};
  int frames_ = 0;  // for which Tab may still be on its way to another of its fields
};

/// Draws a swatch of a colour, red, green and blue from 0 to 1, which opens a picker; named. Returns whether the colour has
/// changed. `label` is Dear ImGui's.
bool colourSwatch(const char* label, float* rgb, const std::string& name);

/// A row of a table of keys: a key, and what it does.
struct KeyRow {
  const char *key, *what;
};
/// Draws a table of keys, with its heading.
void drawKeyTable(std::span<const KeyRow> rows);

/// Whether the widget that was drawn last is held, and not a field into which a number is typed.
bool isDragged();

/// The two ends of a range that are dragged: how far per pixel, the ends of both, and printf's formats.
struct DraggedEnds {
  float speed, lowest, highest;
  const char *low_format, *high_format;
};
/// Draws a slider from `lowest` to `highest`. Ctrl and a click, or a double click, open it for typing; a
/// double click undoes the change that its first click made. Returns whether the value has changed. `label`
/// is Dear ImGui's, `format` printf's, `flags` ImGuiSliderFlags.
bool slider(const char* label, float& value, float lowest, float highest, const char* format, int flags);
bool slider(const char* label, double& value, double lowest, double highest, const char* format, int flags);
bool slider(const char* label, int& value, int lowest, int highest, const char* format, int flags);

/// Draws two numbers beside each other that are dragged or typed, the first at most the second. Returns whether one has
/// changed. `label` is Dear ImGui's, and begins with ##.
bool dragEnds(const char* label, float& low, float& high, const DraggedEnds& ends);

// Tests and scripts drive the window by the names of its widgets: if the environment has
// CURVISPLAT_WIDGETS=FILE, the file has a line "X Y WIDTH HEIGHT NAME" for each named widget of the frame
// that was drawn last, in the window's coordinates. Two with one identifier, of which Dear ImGui hears only the first, have a
// line that begins with "twins:" besides.

/// Names the item that Dear ImGui drew last, at which Tab stops (keyboard_focus.h).
void nameWidget(const std::string& name);
/// Names a widget that the mouse alone can use.
void nameWithoutTab(const std::string& name);

/// Names a rectangle that is not an item.
void nameArea(const std::string& name, double x, double y, double width, double height);

/// Call it at the end of a frame. Replaces the file when something has changed; a failure to write it is not
/// reported.
void writeWidgetPlaces();

}  // namespace curvisplat
