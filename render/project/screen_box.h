// A rectangle of the picture.
#pragma once

namespace curvisplat {

/// In pixels, with the coordinates of ScreenSplat::x and y.
struct ScreenBox {
  float x0, y0, x1, y1;
};

}  // namespace curvisplat
