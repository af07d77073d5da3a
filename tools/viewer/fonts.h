// The window's font: DejaVu Sans, at any size; Dear ImGui's own bitmap font where it is not installed.
#pragma once

namespace curvisplat {

/// Makes Dear ImGui's fonts anew, `pixels` high on the screen. `pixels_per_unit`: as Window::pixelScale(). Returns
/// whether DejaVu Sans was found. Before the first frame or between frames; the texture has to be made anew then.
bool loadFont(float pixels, float pixels_per_unit);

}  // namespace curvisplat
