// One frame: the pipeline of design section 6, as a call.
//
//   plan (the cut, in the painter's order) -> read -> prepare (workers: decode, project, sort) -> draw (a
//   painter)
//   -> image
//
// Bricks are prepared by workers in any order and drawn in the cut's order; what is prepared and not yet
// drawn is bounded. The same cache, view and options give the same image bit for bit, for any number of
// threads, any memory, and whatever was drawn before.
//
// A progressive frame is two: a first picture of the coarse levels, little enough to be read and drawn in a
// fraction of a second whatever the size of the cache, and then the frame that render() draws.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/backend.h"
#include "render/frame/cancelled.h"
#include "render/frame/first_picture.h"
#include "render/frame/frame_options.h"
#include "render/frame/frame_statistics.h"
#include "render/image/image.h"
#include "render/project/screen_view.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Draws frames of one variable of one cache. Owns what reads, prepares and draws, and the memory that
/// they share: decoded bricks stay for the next frame. One caller at a time (but see cancel()); the cache
/// outlives it.
class FrameRenderer {
 public:
  /// Throws Error if there is no such backend to be had: which library was tried, and what it said.
  FrameRenderer(const CacheReader& cache, size_t variable, const TransferFunction& transfer_function,
                Backend backend = Backend::kAutomatic);
  ~FrameRenderer();

  /// Throws UsageError for a view that makes no picture and for too little memory or max_splats (how much it
  /// takes), Error where reading or drawing fails, Cancelled; the renderer can be used again after each.
  /// `statistics` is overwritten.
  Image render(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
               Progress* progress = nullptr);

  using ShowPicture = std::function<void(const Image& image, bool is_final)>;
  /// Calls `show` with a first, coarse picture and then with the one that render() returns, bit for bit; once
  /// if the first is as fine. `statistics` is of the picture shown, and set before each call. Throws what
  /// render() and `show` throw.
  void renderProgressively(const Camera& camera, const FrameOptions& options, FrameStatistics& statistics,
                           const ShowPicture& show, Progress* progress = nullptr);

  /// The best picture within `limits`, drawn with fewer pixels and enlarged where it has no detail for all of
  /// them: for a camera that moves. `is_final` is set to whether it is the one that render() returns. Throws
  /// as render() does.
  Image renderQuickly(const Camera& camera, const FrameOptions& options, const QuickLimits& limits,
                      FrameStatistics& statistics, bool& is_final);

  /// Makes what is under way, of the three above, throw Cancelled soon: within what a worker
  /// takes for a brick and the painter for a segment. One that has not begun is not affected. Any thread.
  void cancel();

  /// Begins to read and decode, in the background, what a render() of the same arguments will need, as far as
  /// the cache of bricks has room for it. The next frame or prefetch() ends it; nothing that goes wrong in it
  /// is told before render().
  void prefetch(const Camera& camera, const FrameOptions& options);

  /// For the frames to come; decoded bricks stay. Ends a prefetch.
  void setTransferFunction(const TransferFunction& transfer_function);

  /// How such a frame comes to the screen. Throws UsageError as render() does.
  ScreenView screenView(const Camera& camera, const FrameOptions& options) const;

  /// "CPU, AVX3"; "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
  const std::string& backendName() const;
  /// Whether the processor draws, by itself or below OpenGL.
  bool drawsInSoftware() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
