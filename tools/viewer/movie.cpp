#include "tools/viewer/movie.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "render/annotate/annotations.h"
#include "render/camera/camera_path.h"
#include "render/frame/frame.h"
#include "render/image/image_file.h"
#include "render/image/too_little_memory.h"
#include "render/surface/curve_times.h"
#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/text.h"
#include "tools/view/background_jobs.h"
#include "tools/view/picture_layout.h"

namespace curvisplat {
namespace {

/// H.264 needs an even width and height.
ImageSize sizeFor(const std::filesystem::path& file, ImageSize size) {
  if (file.extension() == ".gif" || isImageName(file)) return size;
  return {std::max(2, size.width / 2 * 2), std::max(2, size.height / 2 * 2)};
}

class OnePicture final : public MovieOutput {
 public:
  explicit OnePicture(std::filesystem::path file) : file_(std::move(file)) {}
  void write(uint64_t, const Image& image) override { writeImage(image, file_); }
  void finish() override {}

 private:
  const std::filesystem::path file_;
};

/// Draws a frame, with more memory where it needs more, up to what programs can have now. `options` keep that memory for
/// the next frame.
Image drawWithEnough(FrameRenderer& renderer, const Camera& camera, FrameOptions& options,
                     FrameStatistics& statistics, Progress& progress) {
  for (;;) {
    try {
      statistics = {};
      return renderer.render(camera, options, statistics, &progress);
    } catch (const TooLittleMemory& error) {
      const uint64_t wanted = std::max(error.least_bytes, options.memory_bytes + options.memory_bytes / 2);
      const uint64_t available = os::availableMemory();
      if (available > 0 && wanted > available)
        throw Error("a picture of {} x {} pixels needs {} of memory, and {} are free: choose a smaller size",
                    options.size.width, options.size.height, byteText(wanted), byteText(available));
      options.memory_bytes = wanted;
    }
  }
}

/// Draws the frames of a movie, one after another.
class MovieFrames {
 public:
  /// `movie` and `progress` have to outlive it.
  MovieFrames(MovieRequest& movie, ImageSize size, Progress& progress)
      : movie_(movie),
        size_(size),
        progress_(progress),
        film_(movie.kind == MovieKind::kFilm ? movie.film.get() : nullptr),
        state_(movie.state),
        shown_at_(movie.cache.position()) {
    movie.cache = movie.cache.atStep(shown_at_.step);
    if (film_) show(*film_, movie.film_times.front(), state_);
    options_.memory_bytes = state_.memory_bytes;
    functions_.emplace(state_, movie.cache.manifest());
    player_.emplace(movie.cache, functions_->scalars(movie.cache, state_), movie.backend);
    player_->goTo(shown_at_);
  }

  Image draw(uint64_t frame) {
    const Camera camera = goTo(frame);
    Progress of_frame;
    of_frame.stopWith(progress_);
    ShownFrame drawn;
    drawn.view = player_->renderer().screenView(camera, options_);
    drawn.data = {movie_.cache.manifest().lower, movie_.cache.manifest().upper};
    drawn.image = drawWithEnough(player_->renderer(), camera, options_, drawn.statistics, of_frame);
    const AnnotatedScene shown =
        sceneOf(state_, *functions_, drawn, size_, globe_grid_.boxOf(state_, movie_.cache));
    return annotated(std::move(drawn.image), savedAnnotations(state_), shown);
  }

 private:
  /// Sets time, functions and options of a frame; returns its camera.
  Camera goTo(uint64_t frame) {
    Camera camera = state_.camera;
    StepPosition at = shown_at_;
    if (movie_.kind == MovieKind::kOneTurn) {
      camera = orbited(camera, 360.0 * static_cast<double>(frame) / static_cast<double>(framesOf(movie_)));
    } else if (movie_.kind == MovieKind::kAllSteps) {
      at = {frame};
    } else if (film_) {
      const double time = movie_.film_times[frame];
      show(*film_, time, state_);
      camera = magnified(state_.camera, movie_.magnification);
      at = positionOf(*film_, time, movie_.cache.series(), movie_.interpolates).value_or(shown_at_);
      if (film_->functionsChange()) {
        functions_.emplace(state_, movie_.cache.manifest());
        player_->setFunctions(functions_->scalars(movie_.cache, state_));
      }
    }
    player_->goTo(at);
    if (frame == 0 || film_ || movie_.kind == MovieKind::kAllSteps) setOptions(at.step);
    return camera;
  }

  void setOptions(uint64_t step) {
    const uint64_t memory_bytes = options_.memory_bytes;  // drawWithEnough() may have taken more
    options_ =
        state_.frameOptions(dataSizeOf(state_, movie_.cache.manifest(), size_), movie_.cache.manifest());
    options_.scene = sceneAtTime(options_.scene, player_->time());
    options_.memory_bytes = memory_bytes;
    options_.keep_going = movie_.keep_going;
    if (!movie_.faces_at || !options_.scene || options_.scene->grid_surfaces.empty()) return;
    if (faces_of_ != step) faces_ = movie_.faces_at(movie_.cache.atStep(step), state_.faceNames());
    faces_of_ = step;
    auto found = std::make_shared<SurfaceScene>(*options_.scene);
    found->grid_surfaces = facesWithLooks(faces_, found->grid_surfaces);
    options_.scene = std::move(found);
  }

  MovieRequest& movie_;
  const ImageSize size_;
  Progress& progress_;
  const Film* const film_;
  ViewState state_;
  const StepPosition shown_at_;
  FrameOptions options_;
  std::optional<uint64_t> faces_of_;  // step
  std::vector<GridSurface> faces_;
  std::optional<ShownFunctions> functions_;
  std::optional<StepPlayer> player_;
  GlobeGrid globe_grid_;
};

}  // namespace

uint64_t framesOf(const MovieRequest& movie) {
  switch (movie.kind) {
    case MovieKind::kOneTurn:
      return movie.turn_frames;
    case MovieKind::kAllSteps:
      return movie.cache.series().steps.size();
    case MovieKind::kFilm:
      return movie.film_times.size();
    case MovieKind::kOnePicture:
      return 1;
  }
  return 0;
}

std::filesystem::path movieNameOf(const std::filesystem::path& file) {
  if (!isImageName(file) || file.filename().string().find('%') != std::string::npos) return file;
  return file.parent_path() / (file.stem().string() + "_%04d" + file.extension().string());
}

std::filesystem::path drawMovie(MovieRequest& movie, const OpenMovieOutput& open, Progress& progress) {
  const bool is_picture = movie.kind == MovieKind::kOnePicture;
  const std::filesystem::path file = is_picture ? movie.file : movieNameOf(movie.file);
  const ImageSize size = sizeFor(file, movie.size);
  const uint64_t frames = framesOf(movie);
  MovieFrames pictures(movie, size, progress);
  const std::unique_ptr<MovieOutput> output =
      is_picture ? std::make_unique<OnePicture>(file) : open(file, size, movie.frames_per_s);
  is_picture ? progress.begin("drawing the picture", 1, kPicturesUnit)
             : progress.begin("drawing pictures", frames, kPicturesUnit);
  for (uint64_t frame = 0; frame < frames; ++frame) {
    output->write(frame, pictures.draw(frame));
    progress.advance(1);
  }
  output->finish();
  progress.end();
  return file;
}

}  // namespace curvisplat
