// Finds the faces of a cache's grid by the names that users give: kmin, "block 3:k=min", walls, a boundary's name.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The faces that `text` names: words, separated by commas. Throws Error that says which there are instead. Colours are
/// not set.
GridSurface gridSurfaceNamed(const std::string& text, const CacheReader& cache,
                             const std::shared_ptr<const FacesReader>& faces);

/// The faces of the cache's step; those with the values of the scalar `name` there, if one is named. Null if the cache
/// has no faces. Throws Error if it has, but not with these values.
std::shared_ptr<const FacesReader> facesWith(const std::string& name, const CacheReader& cache);

/// A name of faces, and whether their opacities are those of a scalar.
struct WantedFaces {
  std::string name;
  bool has_opacities = false;
};
/// The faces of these names at the cache's step, with the scalar `by` for their colours and `opacity_by` for their
/// opacities, where these are named. Colours are not set. Throws Error as gridSurfaceNamed().
std::vector<GridSurface> gridSurfacesNamed(const std::vector<WantedFaces>& wanted, const std::string& by,
                                           const std::string& opacity_by, const CacheReader& cache);

/// Names that a list of the cache's faces offers: those that all blocks share first, then walls and boundaries, then the
/// faces of single blocks. Empty if the cache has no faces.
std::vector<std::string> faceNamesOf(const CacheReader& cache);

/// Colours the surface, whose faces have it, by the scalar `name`: the picture's colours if it is the scalar `drawn`,
/// else those that are chosen from its own data.
void colourByScalar(GridSurface& surface, const std::string& name, const CacheReader& cache,
                    std::optional<size_t> drawn);

/// Takes the surface's opacities from the scalar `name`, at the cache's step.
void takeOpacities(GridSurface& surface, const std::string& name, const CacheReader& cache);

/// The scalar's position among those of the faces.
std::optional<size_t> scalarOfFaces(const FacesReader& faces, const std::string& name,
                                    const CacheReader& cache);

}  // namespace curvisplat
