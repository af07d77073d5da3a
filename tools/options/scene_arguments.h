// Options of what a picture shows beside the volume: surfaces, slices, isosurfaces and curves. Shared by the
// subcommands that draw.
//
// Arguments hold values as given and are checked without a cache; sceneOf(), facesAt() and sceneAt() read
// surfaces and the cache's faces, and can take long. The functions keep no state: any thread may call them.
#pragma once

#include <CLI/CLI.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/automatic/stored_steps.h"
#include "render/colour/function_parts.h"
#include "render/frame/frame_options.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/manifest.h"
#include "tools/options/curve_arguments.h"
#include "tools/options/frame_sequence.h"
#include "tools/options/map_arguments.h"

namespace curvisplat {

/// Options of surfaces, slices and isosurfaces, as given; checked and parsed later.
struct SurfaceArguments {
  std::vector<std::string> surfaces, colours, slices;
  std::vector<std::string> surface_opacities;
  std::string slice_opacity = "1", volume = "on";
  std::string surface_by;
  std::vector<std::string> isovalues, iso_colours;
  std::string iso_by;  // the scalar of values without a name; empty: the picture's
  std::string iso_opacity = "1";
  CurveArguments curves;
  MapArguments map;
  bool film_has_slices = false;      // --path
  std::optional<std::string> globe;  // on which the cache's grid lies (globe_arguments.h)

  bool given() const {
    return !surfaces.empty() || !slices.empty() || !isovalues.empty() || curves.given() || map.map ||
           volume != "on" || film_has_slices;
  }
};

/// Adds --surface, --surface-colour, --surface-by, --slice, --slice-opacity, --volume and those of curves and maps under the
/// heading `group`.
void addSurfaceOptions(CLI::App& command, SurfaceArguments& arguments, const std::string& group);

/// Throws UsageError if options are invalid or contradict each other; reads no file. `has_opacities`: the
/// picture has a scalar of its opacities, which surfaces may have as well.
void checkSurfaceArguments(const SurfaceArguments& arguments, bool has_opacities = false);

/// A warning if --surface-colour has no effect, since --surface-by colours all surfaces; else empty.
std::string surfaceColourWithoutEffect(const SurfaceArguments& arguments);

/// The scalars that --iso names; empty names stand for the picture's.
std::vector<std::string> isoScalars(const SurfaceArguments& arguments);

/// The isosurfaces of a scene, which may be null, of a picture whose opacities and colours are of these scalars.
std::vector<AskedIsovalues> askedIsovalues(const SurfaceScene* scene, size_t opacities, size_t colours);

/// Whether it is a .vtp file, by its extension.
bool isVtp(const std::filesystem::path& path);

/// Whether --surface names a file: one that exists, or one by its extension.
bool isSurfaceFile(const std::string& text);

/// Whether any of the surfaces is a face of the grid.
bool hasFaces(const SurfaceArguments& arguments);

/// The variables of a picture.
struct SceneScalars {
  std::optional<size_t> colours, opacities;  // none: of a window, which may show any
  bool opacity_by = false;         // whether the opacities are those of --opacity-by, also for faces
  DefaultMaps maps = kMapsOnDark;  // for faces that show another scalar

  bool areTwo() const { return colours && opacities && colours != opacities; }
};

/// Reads the surfaces, and finds those of the cache's grid. Null where none of the options is given. Throws
/// Error for a file that is not a surface, and for a face that the cache does not have.
std::shared_ptr<const SurfaceScene> sceneOf(const SurfaceArguments& arguments, const CacheReader& cache,
                                            const SceneScalars& scalars);

/// The grid's faces at another step of the cache: those of its geometry, with their values there, in the
/// colours of `first`. Throws Error as sceneOf().
std::vector<GridSurface> facesAt(const SurfaceArguments& arguments, const CacheReader& cache,
                                 const std::vector<GridSurface>& first);
/// The scene with the faces of facesAt(), and the curves of that time; null if `first` is null.
std::shared_ptr<const SurfaceScene> sceneAt(const SurfaceArguments& arguments, const CacheReader& cache,
                                            const std::shared_ptr<const SurfaceScene>& first);

/// One line for each slice that does not meet the data's box.
std::vector<std::string> slicesThatMiss(const SurfaceArguments& arguments, const glm::dvec3& lower,
                                        const glm::dvec3& upper);

/// One line for each file of lines or points, of those in `scene`, that is wholly outside of the data's box at all times: lines
/// of other units, or coasts of another part of the Earth. None with --map, since such lines lie on it.
std::vector<std::string> curvesThatMiss(const SurfaceArguments& arguments, const SurfaceScene& scene,
                                        const glm::dvec3& lower, const glm::dvec3& upper);

}  // namespace curvisplat
