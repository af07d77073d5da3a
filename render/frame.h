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
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "render/backend.h"
#include "render/camera.h"
#include "render/first_picture.h"
#include "render/image.h"
#include "render/projection.h"
#include "render/transfer_function.h"
#include "stream/brick_source.h"
#include "stream/cache_reader.h"
#include "stream/progress.h"

namespace curvisplat {

enum class Classification { pixel, flat };  // flat: one colour and extinction a splat, as in the paper

struct FrameOptions {
  ImageSize size;
  Classification classification = Classification::pixel;
  double lod_pixels = 1;               // screen-space error allowed; 0 is the finest level
  std::optional<uint64_t> max_splats;  // read at most these, from the levels that make the best of them
  glm::dvec3 scale{1.0};               // stretches the data: D S Dᵀ, V det D, about the world's origin
  std::optional<WorldBox> clip_box;    // splats whose centre is outside are not drawn
  glm::vec4 background{1, 1, 1, 1};    // premultiplied
  double low_pass_px2 = kLowPass;      // added to S2's diagonal
  unsigned threads = 0;                // workers; 0: one a core
  uint64_t memory_bytes = 512 << 20;
  uint64_t output_bytes = 0;  // of memory_bytes: left for what is done with the image
  bool keep_going = false;    // draw damaged bricks from an ancestor, and report them
  PagerOptions::Way read_by = PagerOptions::Way::automatic;
  bool direct_reads = true;  // past the page cache, where the file system can
};

/// A brick that was drawn from its nearest readable ancestor, or left out if there is none.
struct BrickFailure {
  uint32_t brick = 0;
  std::string reason;  // one line
};

/// What render() throws when cancel() was called.
class Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("the frame was cancelled") {}
};

/// Seconds are summed over threads for the workers' stages.
struct FrameStatistics : FetchStatistics {
  double plan_s = 0, project_s = 0, sort_s = 0, upload_s = 0, draw_s = 0, total_s = 0;
  double gl_draw_s = 0;         // by OpenGL's own clock
  double workers_waited_s = 0;  // for room in the ring: the painter is slower; for reads: read_waited_s
  double painter_waited_s = 0;  // for the workers
  uint64_t bricks_drawn = 0;    // in whole or in part; one that is drawn in several parts counts for each
  uint64_t bricks_culled = 0;   // each stands for all below it; those are
  uint64_t bricks_out_of_image = 0, bricks_transparent = 0;
  uint64_t splats_read = 0;
  uint64_t splats_clipped = 0, splats_off_screen = 0, splats_transparent = 0;  // read, and not drawn, since
  uint64_t splats_drawn = 0;
  /// Parts that were left out because what is before them hides them, and splats handed to the painter for
  /// which it found that. How many depends on how far the stages are ahead of one another; the picture does
  /// not.
  uint64_t bricks_hidden = 0, splats_hidden = 0;
  int largest_level = 0;
  double largest_error_px = 0;  // on the screen, of what is drawn; infinite around a perspective eye
  unsigned workers = 0;
  uint64_t ring_peak_bytes = 0;
  uint64_t memory_used_bytes = 0;  // of memory_bytes: what the stages have, and decoded bricks that are kept
  std::vector<BrickFailure> bricks_unreadable;  // with keep_going; by number
};

/// Draws frames of one variable of one cache. Owns what reads, prepares and draws, and the memory that
/// they share: decoded bricks stay for the next frame. One caller at a time (but see cancel()); the cache
/// outlives it.
class FrameRenderer {
 public:
  /// Throws Error if there is no such backend to be had: which library was tried, and what it said.
  FrameRenderer(const CacheReader& cache, size_t variable, const TransferFunction& transfer_function,
                Backend backend = Backend::automatic);
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
