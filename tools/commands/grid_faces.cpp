#include "tools/commands/grid_faces.h"

#include "tools/options/grid_surfaces.h"

namespace curvisplat {

std::vector<GridSurface> facesAtStep(const CacheReader& cache, const FaceNames& names) {
  std::vector<WantedFaces> wanted;
  for (const FaceNames::Faces& one : names.faces) wanted.push_back({one.name, one.has_opacities});
  return gridSurfacesNamed(wanted, names.by, names.opacity_by, cache);
}

}  // namespace curvisplat
