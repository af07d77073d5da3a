// Finds the faces of a cache's grid by the names that users give: kmin, "block 3:k=min", walls, a boundary's name.
#pragma once

#include <string>

#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The faces that `text` names: words, separated by commas. Throws Error that says which there are instead. Colours are
/// not set.
GridSurface gridSurfaceNamed(const std::string& text, const CacheReader& cache,
                             const std::shared_ptr<const FacesReader>& faces);

/// Colours the surface by the scalar `name`: the picture's colours if it is the scalar `drawn`, else those that are
/// chosen from its own data. Throws Error if the cache or its faces do not have it.
void colourByScalar(GridSurface& surface, const std::string& name, const CacheReader& cache, size_t drawn);

}  // namespace curvisplat
