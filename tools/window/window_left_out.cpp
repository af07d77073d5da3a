// The line about the window that `info --system` prints in a program that was built without it.
#include "tools/window/window.h"

namespace curvisplat {

WindowReport examineWindow() {
  return {.opens = false,
          .display = "not examined",
          .glfw = "none",
          .found = "this program was built without the window (CMake's option CURVISPLAT_WINDOW)"};
}

}  // namespace curvisplat
