// A movie of what the window shows: once around the focal point, all time steps, or a film of key frames; or one picture of
// another size than the window's. Drawn in the background.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "render/backend/backend.h"
#include "render/image/image.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/view/film_edit.h"
#include "tools/view/frame_loop.h"
#include "tools/view/view_state.h"

namespace curvisplat {

enum class MovieKind { kOneTurn, kAllSteps, kOnePicture, kFilm };

/// Takes the pictures 0, 1, 2, ...; unless finish() is called, nothing is left of a movie. Throws Error.
class MovieOutput {
 public:
  virtual ~MovieOutput() = default;
  virtual void write(uint64_t frame, const Image& image) = 0;
  virtual void finish() = 0;
};

/// Writing movies is no part of the window: the subcommand supplies this function. By the name's ending: .mp4 and .gif by
/// ffmpeg, else numbered pictures. Throws Error, and UsageError for a name that does not suit.
using OpenMovieOutput = std::function<std::unique_ptr<MovieOutput>(const std::filesystem::path& file,
                                                                   ImageSize size, double frames_per_s)>;

struct MovieRequest {
  MovieKind kind = MovieKind::kOneTurn;
  std::filesystem::path file;
  CacheReader cache;  // at the time that is shown
  ViewState state;
  ImageSize size;  // of the picture in the window; an .mp4 has the next smaller even one
  double frames_per_s = kFramesPerSecond;
  uint64_t turn_frames = kTurnFrames;  // of kOneTurn
  Backend backend = Backend::kAutomatic;
  FacesAtStep faces_at = {};               // needed where the state has faces
  bool keep_going = false;                 // past damaged bricks
  std::shared_ptr<const void> keeps = {};  // the folder of a preview
  std::shared_ptr<const Film> film = {};   // of kFilm
  std::vector<double> film_times = {};     // of its frames
  bool interpolates = false;               // a film between time steps, too
  double magnification = 1;                // of a film's pictures: of another shape than the window's
};

/// Frames of a movie: those of a turn; one a time step; of a film those of its times; or one.
uint64_t framesOf(const MovieRequest& movie);

/// The name under which a movie named so is written: as it is, or with the frame's number if it is of
/// pictures: "a.png" -> "a_%04d.png".
std::filesystem::path movieNameOf(const std::filesystem::path& file);

/// Draws and writes all of it; returns the name of what was written. A frame that needs more memory than the state gives
/// takes it, where it is free. Its reader goes to other steps. Any thread. Throws Error as
/// drawing and writing do, and Interrupted once `progress` is stopped.
std::filesystem::path drawMovie(MovieRequest& movie, const OpenMovieOutput& open, Progress& progress);

}  // namespace curvisplat
