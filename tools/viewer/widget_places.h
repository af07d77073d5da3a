// Where the window's widgets are, for tests and scripts that drive it by their names: if the environment has
// CURVISPLAT_WIDGETS=FILE, the file has a line "X Y WIDTH HEIGHT NAME" for each named widget of the frame that was drawn
// last, in the window's coordinates. Of the thread that draws the window.
#pragma once

#include <string>

namespace curvisplat {

/// Names the item that Dear ImGui drew last.
void nameWidget(const std::string& name);

/// Names a rectangle that is not an item.
void nameArea(const std::string& name, double x, double y, double width, double height);

/// At the end of a frame. The file is replaced when something has changed; a failure to write it is not reported.
void writeWidgetPlaces();

}  // namespace curvisplat
