// The colours of the window's two themes. Every text has a contrast of at least 4.5 : 1 on what lies behind it, that of a
// disabled widget, too. Pure.
#pragma once

#include <array>
#include <string>
#include <vector>

struct ImGuiStyle;

namespace curvisplat {

/// Sets all colours of the style.
void setTheme(ImGuiStyle& style, bool light);

/// A text and what lies behind it, red, green and blue as they are drawn, each 0 to 1.
struct TextOnPaper {
  std::string name;
  std::array<double, 3> text, paper;
  double least = 4.5;  // the contrast that it needs; a ring needs 3
};
/// All that a theme has.
std::vector<TextOnPaper> textsOf(bool light);

}  // namespace curvisplat
