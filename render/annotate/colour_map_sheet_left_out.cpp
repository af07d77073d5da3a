// The sheet of colour maps in a build without Cairo.
#include "render/annotate/colour_map_sheet.h"
#include "stream/base/error.h"

namespace curvisplat {

Image colourMapSheet() {
  throw UsageError(
      "this program was built without drawing text (CMake's option CURVISPLAT_ANNOTATIONS); leave out "
      "--output to list the maps");
}

}  // namespace curvisplat
