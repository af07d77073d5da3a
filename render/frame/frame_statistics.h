// Times, memory and counts of a frame: how long it took, and what became of its bricks and splats.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stream/paging/brick_source.h"

namespace curvisplat {

/// A brick that was drawn from its nearest readable ancestor, or left out if there is none.
struct BrickFailure {
  uint32_t brick = 0;
  std::string reason;  // one line
};

/// Seconds of the workers' stages are sums over the threads.
struct FrameStatistics : FetchStatistics {
  double plan_s = 0, project_s = 0, sort_s = 0, upload_s = 0, draw_s = 0, total_s = 0;
  double gl_draw_s = 0;         // by OpenGL's own clock
  double workers_waited_s = 0;  // for space in the ring, if the painter is slower; for reads: read_waited_s
  double painter_waited_s = 0;  // for the workers
  uint64_t bricks_drawn = 0;    // in whole or in part
  uint64_t bricks_culled = 0;   // the sum of the next two; each brick stands for all below it
  uint64_t bricks_out_of_image = 0, bricks_transparent = 0;
  uint64_t splats_read = 0;
  uint64_t splats_clipped = 0, splats_off_screen = 0,
           splats_transparent = 0;  // read but not drawn: the reason
  uint64_t splats_behind = 0;       // read but not drawn: behind opaque surfaces or slices
  double surfaces_s = 0;            // surfaces and slices, without reading and sampling bricks for slices
  uint64_t splats_drawn = 0;
  /// Parts that were left out because splats in front hide them, and splats that the painter left out for the
  /// same reason. The counts depend on how far the stages are ahead of one another; the picture does not.
  uint64_t bricks_hidden = 0, splats_hidden = 0;
  int largest_level = 0;
  double largest_error_px = 0;  // of the bricks drawn, on the screen; infinite around a perspective eye
  unsigned workers = 0;
  uint64_t ring_peak_bytes = 0;
  uint64_t sweep_peak_bytes = 0;   // of splats that wait for others that come before them in depth
  uint64_t slabs = 0;              // slabs of depth, drawn one by one: more than one if memory is short
  uint64_t bricks_again = 0;       // decoded or kept bricks that were prepared again, in a further slab
  uint64_t memory_used_bytes = 0;  // of memory_bytes: by the stages and by decoded bricks that are kept
  std::vector<BrickFailure> bricks_unreadable;  // with keep_going; sorted by number
};

}  // namespace curvisplat
