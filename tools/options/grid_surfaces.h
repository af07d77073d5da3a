// Finds the faces of a cache's grid by the names that users give: imin, kmax, k=10, "block 3:k=min", a part
// of a face (kmin:i=0-20), walls, or the name of a boundary.
//
// parseFaceName() is pure. The other functions read the cache's faces at its step and throw Error if that
// fails or if the cache has no such face; the message lists the names that it has. They keep no state: any
// thread may call them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render/colour/function_parts.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// An index plane of the grid, or a part of one, in one block or in all.
struct FaceName {
  std::optional<uint32_t> block;  // from 0; none: all
  int axis = 0;
  enum class At { kMin, kMax, kIndex } at = At::kMin;
  uint64_t index = 0;  // from 0
  /// Nodes FIRST-LAST along the other axes.
  struct Range {
    uint64_t first = 0, last = 0;
  };
  std::array<std::optional<Range>, 3> ranges{};  // along i, j, k
};

/// nullopt if the text has another form: the name of a boundary.
std::optional<FaceName> parseFaceName(std::string_view text);

/// The faces that `text` names, one name or several separated by commas. Throws Error that lists the names
/// there are. Colours are not set.
GridSurface gridSurfaceNamed(const std::string& text, const CacheReader& cache,
                             const std::shared_ptr<const FacesReader>& faces);

/// The faces of the cache's step, with the values of the scalar `name` if it is not empty. Null if the cache
/// has no faces. Throws Error if it has faces, but not with these values.
std::shared_ptr<const FacesReader> facesWith(const std::string& name, const CacheReader& cache);

/// A name of faces, and whether their opacities are those of a scalar.
struct WantedFaces {
  std::string name;
  bool has_opacities = false;
};
/// The faces of these names at the cache's step, with the scalar `by` for their colours and `opacity_by` for
/// their opacities, where these are named. Colours are not set. Throws Error as gridSurfaceNamed().
std::vector<GridSurface> gridSurfacesNamed(const std::vector<WantedFaces>& wanted, const std::string& by,
                                           const std::string& opacity_by, const CacheReader& cache);

/// Names that a list of the cache's faces offers: first those that all blocks share, then walls and
/// boundaries, then the faces of single blocks. Empty if the cache has no faces.
std::vector<std::string> faceNamesOf(const CacheReader& cache);

/// Colours the surface by the scalar `name`, which its faces have: with the picture's colours if it is the
/// scalar `drawn`, else with colours that are chosen from its own data, in one of `maps`.
void colourByScalar(GridSurface& surface, const std::string& name, const CacheReader& cache,
                    std::optional<size_t> drawn, const DefaultMaps& maps);

/// Takes the surface's opacities from the scalar `name`, at the cache's step.
void takeOpacities(GridSurface& surface, const std::string& name, const CacheReader& cache);

/// The scalar's position among those of the faces.
std::optional<size_t> scalarOfFaces(const FacesReader& faces, const std::string& name,
                                    const CacheReader& cache);

}  // namespace curvisplat
