#include "tools/viewer/movie.h"

#include <algorithm>
#include <string>
#include <utility>

#include "render/annotate/annotations.h"
#include "render/camera/camera_path.h"
#include "render/frame/step_player.h"
#include "tools/viewer/picture_layout.h"

namespace curvisplat {
namespace {

constexpr uint64_t kFramesOfTurn = 90;

/// H.264 asks for it.
ImageSize evenSize(ImageSize size) {
  return {std::max(2, size.width / 2 * 2), std::max(2, size.height / 2 * 2)};
}

}  // namespace

uint64_t framesOf(const MovieRequest& movie) {
  return movie.kind == MovieKind::kOneTurn ? kFramesOfTurn : movie.cache.series().steps.size();
}

std::filesystem::path movieNameOf(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  const bool is_pictures = ending == ".png" || ending == ".exr" || ending == ".pfm";
  if (!is_pictures || file.filename().string().find('%') != std::string::npos) return file;
  return file.parent_path() / (file.stem().string() + "_%04d" + ending);
}

std::filesystem::path drawMovie(MovieRequest& movie, const OpenMovieOutput& open, Progress& progress) {
  const std::filesystem::path file = movieNameOf(movie.file);
  const ImageSize size = evenSize(movie.size);
  const ViewState& state = movie.state;
  const Manifest manifest = movie.cache.manifest();
  const uint64_t shown_step = movie.cache.step(), frames = framesOf(movie);
  const ShownFunctions functions(state, manifest);
  FrameOptions options = state.frameOptions(dataSizeOf(state, manifest, size));
  options.keep_going = movie.keep_going;
  const std::shared_ptr<const SurfaceScene> scene = options.scene;
  const auto faces_at = [&](uint64_t step) {
    if (!movie.faces_at || !scene || scene->grid_surfaces.empty()) return;
    auto moved = std::make_shared<SurfaceScene>(*scene);
    moved->grid_surfaces = movie.faces_at(movie.cache.atStep(step), scene->grid_surfaces);
    options.scene = std::move(moved);
  };
  const std::unique_ptr<MovieOutput> output = open(file, size, movie.frames_per_s);
  StepPlayer player(movie.cache, functions.scalars(movie.cache, state), movie.backend);
  if (movie.kind == MovieKind::kOneTurn) faces_at(shown_step);
  progress.begin("drawing frames", frames, "frames");
  for (uint64_t frame = 0; frame < frames; ++frame) {
    Camera camera = state.camera;
    if (movie.kind == MovieKind::kOneTurn) {
      camera = orbited(camera, 360.0 * static_cast<double>(frame) / static_cast<double>(frames));
    } else {
      player.goTo({frame});
      faces_at(frame);
    }
    Progress of_frame;
    of_frame.stopWith(progress);
    FrameStatistics statistics;
    const Image image = player.renderer().render(camera, options, statistics, &of_frame);
    output->write(frame, annotated(image, state.annotations,
                                   sceneOf(state, manifest, functions, camera, options, size)));
    progress.advance(1);
  }
  output->finish();
  progress.end();
  return file;
}

}  // namespace curvisplat
