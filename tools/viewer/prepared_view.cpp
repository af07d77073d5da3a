#include "tools/viewer/prepared_view.h"

#include <algorithm>
#include <utility>

#include "render/annotate/globe_box.h"
#include "render/surface/iso_groups.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tools/view/first_view.h"
#include "tools/view/picture_layout.h"
#include "tools/view/saved_views.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// Surfaces and slices of the command line take the place of those of the state.
void takeScene(const ViewerOptions& options, const CacheReader& cache, ViewState& state) {
  const SurfaceScene& scene = *options.scene;
  state.surfaces.clear();
  state.given = options.given;
  for (size_t n = 0; n < options.surface_files.size(); ++n)
    state.surfaces.push_back({fs::absolute(options.surface_files.at(n)), scene.surfaces[n].colour,
                              scene.surfaces[n].mesh, scene.surfaces[n].opacity.factor});
  state.faces.clear();
  for (size_t n = 0; n < scene.grid_surfaces.size(); ++n)
    state.faces.push_back(
        {options.face_names.at(n), scene.grid_surfaces[n].colour, scene.grid_surfaces[n].opacity});
  state.faces_by.reset();
  if (!options.faces_by.empty())
    state.faces_by = FacesScalar{options.faces_by, automaticFunction(cache, options.faces_by, true)};
  state.isosurfaces.clear();
  for (const IsoGroup& group : isoGroups(scene, {cache.variableNamed(state.opacityScalar())}))
    for (size_t n = 0; n < group.values.size(); ++n)
      state.isosurfaces.push_back(
          {cache.manifest().variables[group.variable].name, group.values[n], true, group.ownColour(n)});
  state.iso_opacity = scene.iso_opacity;
  state.slices.clear();
  for (const ClipPlane& plane : scene.slices) state.slices.push_back({plane});
  state.slice_opacity = {scene.slice_opacity, scene.slices_by_function};
  state.volume = scene.volume;
}

/// A state may be of a cache that was converted anew, without these faces.
void removeMissingFaces(const FaceServices& services, const CacheReader& cache, ViewState& state) {
  if (state.faces.empty() || !services.at) return;
  try {
    services.at(cache, state.faceNames());
  } catch (const Error& error) {
    printMessage("warning: {}; the view is shown without surfaces of the grid", error.what());
    state.faces.clear();
  }
}

/// The scalars that the whole cache has and this one lacks.
std::vector<std::string> scalarsElsewhere(const CacheReader& cache) {
  std::vector<std::string> names = cache.wholePath() == cache.cachePath()
                                       ? cache.allScalars()
                                       : CacheReader(cache.wholePath()).allScalars();
  std::erase_if(names, [&](const std::string& name) { return cache.manifest().variable(name); });
  return names;
}

/// The film that was made when the cache was shown last; nullopt without one.
std::optional<Film> rememberedFilm(const fs::path& whole) {
  const auto file = rememberedFilmOf(whole);
  if (!file || !fs::exists(*file)) return std::nullopt;
  try {
    return Film::fromFile(*file);
  } catch (const Error& error) {
    printMessage("warning: {}; the film is left out", error.what());
    return std::nullopt;
  }
}

}  // namespace

std::string wantedScalar(const ViewerOptions& options) {
  if (options.scalar) return *options.scalar;
  if (!options.state) return "";
  try {
    return scalarOfViewState(readTextFile(*options.state), *options.state);
  } catch (const Error&) {
    return "";
  }
}

PreparedView prepareView(CacheReader cache, const ViewerOptions& options, ImageSize picture) {
  ViewState state = firstViewOf(cache, options.scalar.value_or(""), picture);
  if (options.given && options.given->above)
    state.camera =
        cameraAbove(*options.given->above, state.scale, dataSizeOf(state, cache.manifest(), picture));
  Camera first_camera = state.camera;
  ImageSize first_size = dataSizeOf(state, cache.manifest(), picture);
  const std::string scalar = state.variable;
  const EditedFunction automatic = state.function;
  const fs::path& whole = options.preview ? options.preview->whole : cache.cachePath();
  if (options.state) {
    state = viewStateFromJson(readTextFile(*options.state), *options.state, cache.manifest());
  } else if (const auto remembered = rememberedStateOf(whole); remembered && fs::exists(*remembered)) {
    try {
      ViewState found = viewStateFromJson(readTextFile(*remembered), *remembered, cache.manifest());
      loadSurfaces(found);
      state = std::move(found);
    } catch (const Error& error) {
      printMessage("warning: {}; using the initial view", error.what());
    }
  } else {
    state.dark = options.dark;
  }
  if (options.scalar && *options.scalar != state.variable) chooseVariable(state, cache, *options.scalar);
  if (options.memory_bytes) state.memory_bytes = *options.memory_bytes;
  if (options.scene) takeScene(options, cache, state);
  if (options.scene && state.coloursSheets() && state.function.isAutomatic())
    state.function = automaticFunction(cache, state.variable, true);
  state.suitBackground();
  loadSurfaces(state);
  removeMissingFaces(options.faces, cache, state);
  if (options.camera) {
    first_size = dataSizeOf(state, cache.manifest(), picture);
    first_camera = state.camera = options.camera(cache, state, first_size);
  }
  std::vector<std::string> faces;
  if (options.faces.names) faces = options.faces.names(cache);
  std::vector<std::string> elsewhere = scalarsElsewhere(cache);
  std::optional<Film> film = rememberedFilm(whole);
  return {std::move(cache), std::move(state), first_camera,         first_size,     scalar,
          automatic,        std::move(faces), std::move(elsewhere), std::move(film)};
}

}  // namespace curvisplat
