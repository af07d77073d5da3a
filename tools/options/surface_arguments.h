// Options that put surfaces and slices into a picture, shared by the subcommands that draw.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct SurfaceArguments {
  std::vector<std::string> surfaces, colours, slices;
  std::vector<std::string> surface_opacities;
  std::string slice_opacity = "1", volume = "on";
  std::string surface_by;
  std::vector<std::string> isovalues;
  std::string iso_opacity = "1";

  bool given() const { return !surfaces.empty() || !slices.empty() || !isovalues.empty() || volume != "on"; }
};

/// Adds --surface, --surface-colour, --surface-by, --slice, --slice-opacity and --volume under the heading `group`.
void addSurfaceOptions(CLI::App& command, SurfaceArguments& arguments, const std::string& group);

/// Throws UsageError for what cannot be: without a look at any file. `has_opacities`: the picture has a scalar of its
/// opacities, which surfaces may have as well.
void checkSurfaceArguments(const SurfaceArguments& arguments, bool has_opacities = false);

/// Whether it is a .vtp file, by its extension.
bool isVtp(const std::filesystem::path& path);

/// Whether --surface names a file: one that is there, or by its extension.
bool isSurfaceFile(const std::string& text);

/// Whether any is a face of the grid.
bool hasFaces(const SurfaceArguments& arguments);

/// The variables of a picture.
struct SceneScalars {
  std::optional<size_t> colours, opacities;  // none: of a window, which may show any
  bool iso_of_colours = false;               // of two: isosurfaces are those of the colours
  bool opacity_by = false;  // whether the opacities are those of --opacity-by, also for faces

  bool areTwo() const { return colours && opacities && colours != opacities; }
};

/// Reads the surfaces, and finds those of the cache's grid. Null where none of the options is given. Throws Error for a
/// file that is no surface, and for a face that the cache does not have.
std::shared_ptr<const SurfaceScene> sceneOf(const SurfaceArguments& arguments, const CacheReader& cache,
                                            const SceneScalars& scalars);

/// The grid's faces at another step of the cache: those of its geometry, with their values there, in the colours of
/// `first`. Throws Error as sceneOf().
std::vector<GridSurface> facesAt(const SurfaceArguments& arguments, const CacheReader& cache,
                                 const std::vector<GridSurface>& first);
/// The same of a scene, which is null where there is none.
std::shared_ptr<const SurfaceScene> sceneAt(const SurfaceArguments& arguments, const CacheReader& cache,
                                            const std::shared_ptr<const SurfaceScene>& first);

/// One line for each slice that does not meet the data's box.
std::vector<std::string> slicesThatMiss(const SurfaceArguments& arguments, const glm::dvec3& lower,
                                        const glm::dvec3& upper);

}  // namespace curvisplat
