// What `curvisplat view` is asked for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/frame/backend.h"
#include "render/surface/surface_scene.h"
#include "tools/viewer/conversion_services.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/movie.h"

namespace curvisplat {

struct CarriedView;

/// Faces of grids are found by the subcommand, which reads their names.
struct FaceServices {
  /// The names that a list of surfaces offers; empty if the cache has no faces. Any thread. Throws Error as reading does.
  std::function<std::vector<std::string>(const CacheReader&)> names;
  FacesAtStep at;
};

struct ViewerOptions {
  ImageSize size{1200, 800};
  Backend backend = Backend::kAutomatic;
  std::optional<std::filesystem::path> state;  // default: the saved state of this cache
  std::optional<std::string> scalar;
  std::shared_ptr<const SurfaceScene> scene;         // null: that of the state
  std::vector<std::filesystem::path> surface_files;  // of the scene's surfaces
  std::vector<std::string> face_names;               // of its grid surfaces
  std::string faces_by;                              // --surface-by
  FaceServices faces;
  std::optional<uint64_t> memory_bytes;
  ConversionServices conversion;
  OpenMovieOutput open_movie;
  std::vector<std::filesystem::path> files;  // to open first, in place of a cache
  double target_s = 0.033;                   // per picture while moving

  /// Of the cache that is shown: the grid's files that were opened, if it is a kept cache of them; what it is a preview
  /// of; and the view that it continues, of the same grid.
  std::vector<std::filesystem::path> grid_files;
  std::optional<Preview> preview;
  std::shared_ptr<const CarriedView> carried;
};

}  // namespace curvisplat
