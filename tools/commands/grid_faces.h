// The faces of a cache's grid as the window and the server ask for them (FacesAtStep). It keeps no state: any thread
// may call it.
#pragma once

#include <vector>

#include "tools/view/frame_loop.h"

namespace curvisplat {

/// Finds the faces by the names that --surface takes. Throws Error as gridSurfacesNamed().
std::vector<GridSurface> facesAtStep(const CacheReader& cache, const FaceNames& names);

}  // namespace curvisplat
