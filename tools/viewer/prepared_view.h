// Prepares a view of a cache, from the options of `curvisplat view` and from the data.
//
// Finding it reads the cache, for 0.1 to 0.3 s and more on a busy machine. So it is found on the thread that
// opens the cache, and the window's own thread answers meanwhile.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/backend/backend.h"
#include "render/camera/camera.h"
#include "render/film/film.h"
#include "render/surface/surface_scene.h"
#include "stream/cache/cache_reader.h"
#include "tools/view/background_jobs.h"
#include "tools/view/edited_function.h"
#include "tools/view/frame_loop.h"
#include "tools/view/view_state.h"
#include "tools/viewer/movie.h"

namespace curvisplat {

struct CarriedView;

/// Faces of grids are found by the subcommand, which reads their names.
struct FaceServices {
  /// The names that a list of surfaces offers; empty if the cache has no faces. Any thread. Throws Error as
  /// reading does.
  std::function<std::vector<std::string>(const CacheReader&)> names;
  FacesAtStep at;
};

/// The options of `curvisplat view`, and what the subcommand supplies.
struct ViewerOptions {
  ImageSize size{1200, 800};
  Backend backend = Backend::kAutomatic;
  std::optional<std::filesystem::path> state;  // default: the saved state of this cache
  std::optional<std::string> scalar;
  std::shared_ptr<const SurfaceScene> scene;         // null: that of the state
  std::vector<std::filesystem::path> surface_files;  // of the scene's surfaces
  std::vector<std::string> face_names;               // of its grid surfaces
  std::string faces_by;                              // --surface-by
  std::shared_ptr<const GivenSheets> given;          // of the scene, what lists do not have
  FaceServices faces;
  /// The camera to begin with, for a picture of the data in a size; empty: that of the state. Throws UsageError if the data do not
  /// suit the options.
  std::function<Camera(const CacheReader&, const ViewState&, ImageSize)> camera;
  std::optional<uint64_t> memory_bytes;
  ConversionServices conversion;
  OpenMovieOutput open_movie;
  bool dark = true;                          // the background, where nothing says otherwise
  bool encodes_movies = true;                // ffmpeg is there, which .mp4 and .gif need
  std::vector<std::filesystem::path> files;  // to open first, in place of a cache
  double target_s = 0.033;                   // per picture while moving

  /// Facts about the cache that is shown: the grid's files that were opened, if it is a kept cache of them;
  /// the preview, if it is one; and the view of the same grid that it continues.
  std::vector<std::filesystem::path> grid_files;
  std::optional<Preview> preview;
  std::shared_ptr<const CarriedView> carried;
};

struct PreparedView {
  CacheReader cache;
  ViewState state;
  Camera first_camera;  // for a picture whose data have this size, without --scale
  ImageSize first_size;
  std::string scalar;                   // for which
  EditedFunction automatic;             // was chosen from the data
  std::vector<std::string> face_names;  // that the list of surfaces offers
  std::vector<std::string> elsewhere;   // scalars of the whole cache that have values at other samples
  std::optional<Film> film;             // that was made of it before
};

/// The scalar to show first: the one that the options name, or that of their state; empty for any. A state that cannot be read
/// is reported by prepareView().
std::string wantedScalar(const ViewerOptions& options);

/// The first view, or the one that was left last time, with what `options` except `carried` ask for.
/// `picture`: its size in pixels. Any thread. Throws Error as reading the cache or the state does.
PreparedView prepareView(CacheReader cache, const ViewerOptions& options, ImageSize picture);

}  // namespace curvisplat
