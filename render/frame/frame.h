// Draws frames by the pipeline of DESIGN.md, "The pipeline".
//
//   plan -> read -> prepare -> sweep -> draw -> image
//    |               |          |        painter
//    the cut,        workers:   splats by their   puts them into the
//    its parts       decode,    first depth in    order of each tile
//    by depth        project    any tile
//
// Workers prepare bricks in any order; a tile's splats are drawn in the order of their depth there. The number of splats
// that are prepared but not yet drawn is bounded. The same cache, view and options give the same image bit
// for bit, for any number of threads and any memory, and whatever was drawn before.
//
// A progressive frame consists of two frames: a first picture of the coarse levels, which is small enough to
// be read and drawn in a fraction of a second whatever the size of the cache, and then the frame that
// render() draws. The time steps of a cache are frames of one renderer as long as the geometry stays
// (StepPlayer). One caller at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/backend/backend.h"
#include "render/backend/pixel_values.h"
#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/first_picture.h"
#include "render/frame/frame_options.h"
#include "render/frame/frame_statistics.h"
#include "render/image/image.h"
#include "render/project/screen_view.h"
#include "stream/base/compute_permits.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Draws frames of one variable, or two, of one cache. Owns the threads and the painter, and the memory that
/// they share: decoded bricks are kept for the next frame. The cache must outlive the renderer.
class FrameRenderer {
 public:
  /// Throws Error if the backend is not available; the message names the library that was tried and its
  /// error.
  FrameRenderer(const CacheReader& cache, size_t variable, const TransferFunction& transfer_function,
                Backend backend = Backend::kAutomatic)
      : FrameRenderer(cache, DrawnScalars(variable, transfer_function), backend) {}
  /// Draws pictures of one scalar or two. Throws Error as the other constructor.
  FrameRenderer(const CacheReader& cache, const DrawnScalars& scalars, Backend backend = Backend::kAutomatic);
  /// Draws by this backend, as long as it can.
  FrameRenderer(const CacheReader& cache, const DrawnScalars& scalars,
                std::unique_ptr<PaintingBackend> backend);
  ~FrameRenderer();

  /// Draws one frame. Throws UsageError for an invalid view, and for too little memory or too small a
  /// max_splats (the message says how much is needed); Error if reading or drawing fails; Interrupted once
  /// options.stop or `progress` asks for a stop, at the latest when each worker has finished its brick and
  /// the painter its segment. The renderer can be used again after each of these exceptions. `statistics` is
  /// overwritten. With options.ranks, all ranks have to call it: rank 0 returns the picture, bit for bit that
  /// of one process; the others return only their tiles. Statistics are each rank's own.
  Image render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
               Progress* progress = nullptr);

  /// Draws one frame as render() does, and finds for each pixel the depth where it has half of its opacity,
  /// and what lies there. Takes about three times as long: the splats are drawn again, by the processor. If
  /// several ranks draw, rank 0 gets the values.
  Image renderWithValues(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                         PixelValues& values, Progress* progress = nullptr);

  using ShowPicture = std::function<void(const Image& image, bool is_final)>;
  /// Calls `show` with a first, coarse picture and then with the picture that render() returns, bit for bit;
  /// only once if the first picture is already the final one. `statistics` describes the picture shown and
  /// is set before each call. Throws what render() and `show` throw.
  void renderProgressively(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                           const ShowPicture& show, Progress* progress = nullptr);

  /// Draws the best picture within `limits`, for a camera that moves. It is drawn with fewer pixels and
  /// enlarged if it has no detail for all of them. Sets `is_final` to whether render() would return the same
  /// picture. Throws as render() does. `on_card`: as FramePipeline::draw(); that picture is not enlarged (ReducedSize).
  Image renderQuickly(const Camera& camera, const FrameOptions& options, const QuickLimits& limits,
                      FrameStatistics& statistics, bool& is_final,
                      std::shared_ptr<CardPicture>* on_card = nullptr);

  /// Begins to read and decode, in the background, the bricks that render() with the same arguments will
  /// need, as far as they fit in the cache of bricks. The next frame or prefetch() ends it. Its errors are
  /// not reported; render() reports those that matter to it.
  void prefetch(const Camera& camera, const FrameOptions& options);
  /// Prefetches for renderQuickly() with these arguments.
  void prefetch(const Camera& camera, const FrameOptions& options, const QuickLimits& limits);

  /// Goes to another time step of the same geometry: calls `change`, which has to replace the cache's reader
  /// by one at that step, while nothing reads. Decoded geometry is kept. Ends a prefetch; a prefetch from
  /// now on is of the new step. Throws what `change` throws.
  void changeStep(const std::function<void()>& change);

  /// Replaces the function of the opacities. Takes effect with the next frame. Decoded bricks are kept. Ends
  /// a prefetch.
  void setTransferFunction(const TransferFunction& transfer_function);

  /// The projection that render() uses for these arguments. Throws UsageError as render() does.
  ScreenView screenView(const Camera& camera, const FrameOptions& options) const;

  /// Permits for threads that compute between frames, while bricks are fetched ahead: with them, no more
  /// threads compute than the last frame's options.threads. Null before the first frame. Valid until the next
  /// frame.
  ComputePermits* permits() const;

  /// Name of the backend: "CPU, AVX3"; "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5". Once OpenGL has failed
  /// while a frame was drawn, another one draws, whose name says why.
  const std::string& backendName() const;
  /// Whether the processor draws, either directly or through a software OpenGL.
  bool drawsInSoftware() const;
  /// The backend, for another renderer. This one can only be destroyed then.
  std::unique_ptr<PaintingBackend> takeBackend();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Draws the time steps of a cache, with one renderer as long as the geometry stays: decoded geometry is kept
/// while values change. One caller at a time.
class StepPlayer {
 public:
  /// `cache` must outlive the player; it is at the step that is drawn. `window`: as makeBackend(). Throws Error as FrameRenderer.
  StepPlayer(CacheReader& cache, const DrawnScalars& scalars, Backend backend, GlSharing* window = nullptr);
  /// Draws by this backend, as long as it can.
  StepPlayer(CacheReader& cache, const DrawnScalars& scalars, std::unique_ptr<PaintingBackend> backend);

  FrameRenderer& renderer() { return *renderer_; }
  /// Replaces the function of the opacities, for this step and those to come.
  void setTransferFunction(const TransferFunction& transfer_function);
  /// Replaces the functions of the same variables. Decoded bricks are kept in a picture of one scalar only.
  void setFunctions(const DrawnScalars& scalars);
  /// Makes this step, or time between two, the one that is drawn. Throws Error as CacheReader.
  void goTo(const StepPosition& position);
  /// The time that is drawn.
  double time() const { return cache_.time(); }

 private:
  std::unique_ptr<PaintingBackend> endRenderer();

  CacheReader& cache_;
  DrawnScalars scalars_;
  const Backend backend_ = Backend::kAutomatic;
  GlSharing* const window_ = nullptr;
  std::unique_ptr<FrameRenderer> renderer_;
};

}  // namespace curvisplat
