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
#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/text.h"
#include "tools/view/picture_layout.h"

namespace curvisplat {
namespace {

constexpr uint64_t kFramesOfTurn = 90;

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

}  // namespace

uint64_t framesOf(const MovieRequest& movie) {
  switch (movie.kind) {
    case MovieKind::kOneTurn:
      return kFramesOfTurn;
    case MovieKind::kAllSteps:
      return movie.cache.series().steps.size();
    case MovieKind::kFilm:
      return movie.film_times.size();
    case MovieKind::kOnePicture:
      return 1;
  }
  return 0;
}

std::string textOf(const MovieRequest& movie) {
  const uint64_t frames = framesOf(movie);
  return fmt::format("{} pictures of {} x {}, {:.1f} s", frames, movie.size.width, movie.size.height,
                     static_cast<double>(frames) / movie.frames_per_s);
}

std::filesystem::path movieNameOf(const std::filesystem::path& file) {
  if (!isImageName(file) || file.filename().string().find('%') != std::string::npos) return file;
  return file.parent_path() / (file.stem().string() + "_%04d" + file.extension().string());
}

std::filesystem::path drawMovie(MovieRequest& movie, const OpenMovieOutput& open, Progress& progress) {
  const bool is_picture = movie.kind == MovieKind::kOnePicture;
  const std::filesystem::path file = is_picture ? movie.file : movieNameOf(movie.file);
  const ImageSize size = sizeFor(file, movie.size);
  ViewState state = movie.state;
  const StepPosition shown_at = movie.cache.position();
  movie.cache = movie.cache.atStep(shown_at.step);
  const uint64_t frames = framesOf(movie);
  const Film* const film = movie.kind == MovieKind::kFilm ? movie.film.get() : nullptr;
  if (film) show(*film, movie.film_times.front(), state);
  std::optional<ShownFunctions> functions(std::in_place, state, movie.cache.manifest());
  FrameOptions options;
  uint64_t memory_bytes = state.memory_bytes;  // drawWithEnough() may take more
  std::optional<uint64_t> faces_of;            // step
  std::vector<GridSurface> faces;
  const auto take_options = [&](uint64_t step) {
    options = state.frameOptions(dataSizeOf(state, movie.cache.manifest(), size));
    options.memory_bytes = memory_bytes;
    options.keep_going = movie.keep_going;
    if (!movie.faces_at || !options.scene || options.scene->grid_surfaces.empty()) return;
    if (faces_of != step) faces = movie.faces_at(movie.cache.atStep(step), state.faceNames());
    faces_of = step;
    auto found = std::make_shared<SurfaceScene>(*options.scene);
    found->grid_surfaces = facesWithLooks(faces, found->grid_surfaces);
    options.scene = std::move(found);
  };
  const std::unique_ptr<MovieOutput> output =
      is_picture ? std::make_unique<OnePicture>(file) : open(file, size, movie.frames_per_s);
  StepPlayer player(movie.cache, functions->scalars(movie.cache, state), movie.backend);
  player.goTo(shown_at);
  progress.begin("drawing frames", frames, "frames");
  for (uint64_t frame = 0; frame < frames; ++frame) {
    Camera camera = state.camera;
    StepPosition at = shown_at;
    if (movie.kind == MovieKind::kOneTurn) {
      camera = orbited(camera, 360.0 * static_cast<double>(frame) / static_cast<double>(frames));
    } else if (movie.kind == MovieKind::kAllSteps) {
      at = {frame};
    } else if (film) {
      const double time = movie.film_times[frame];
      show(*film, time, state);
      camera = magnified(state.camera, movie.magnification);
      at = positionOf(*film, time, movie.cache.series(), movie.interpolates).value_or(shown_at);
      if (film->functionsChange()) {
        functions.emplace(state, movie.cache.manifest());
        player.setFunctions(functions->scalars(movie.cache, state));
      }
    }
    player.goTo(at);
    if (frame == 0 || film || movie.kind == MovieKind::kAllSteps) take_options(at.step);
    Progress of_frame;
    of_frame.stopWith(progress);
    ShownFrame drawn;
    drawn.view = player.renderer().screenView(camera, options);
    drawn.data = {movie.cache.manifest().lower, movie.cache.manifest().upper};
    drawn.image = drawWithEnough(player.renderer(), camera, options, drawn.statistics, of_frame);
    memory_bytes = options.memory_bytes;
    const AnnotatedScene shown = sceneOf(state, *functions, drawn, size);
    output->write(frame, annotated(std::move(drawn.image), state.annotations, shown));
    progress.advance(1);
  }
  output->finish();
  progress.end();
  return file;
}

}  // namespace curvisplat
