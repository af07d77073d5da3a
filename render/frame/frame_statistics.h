// Times, memory and counts of a frame, stage by stage: how long it took, and what became of its bricks and splats.
//
// The numbers' names, and how those of several threads or processes combine, are in one table (statisticsFields): files,
// messages between ranks and summaries are written from it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "stream/paging/brick_source.h"

namespace curvisplat {

/// A brick that was drawn from its nearest readable ancestor, or left out if there is none.
struct BrickFailure {
  uint32_t brick = 0;
  std::string reason;  // one line
};

/// The stage "plan".
struct PlanStatistics {
  double plan_s = 0;
  uint64_t bricks_culled = 0;  // the sum of the next two; each brick stands for all below it
  uint64_t bricks_out_of_image = 0, bricks_transparent = 0;
  uint64_t largest_level = 0;
  double largest_error_px = 0;  // of the bricks drawn, on the screen; infinite around a perspective eye
};

/// The stage "prepare", without reading and decoding, which FetchStatistics has. Seconds are sums over the threads.
struct PrepareStatistics {
  double project_s = 0, sort_s = 0;
  double workers_waited_s = 0;  // for space in the ring, if the painter is slower; for reads: read_waited_s
  double exchange_s = 0;        // of splats with other ranks: copying, and waiting for them
  uint64_t workers = 0;
  uint64_t bricks_drawn = 0;  // in whole or in part
  /// Parts that were left out because splats in front hide them. How many depends on how far the stages are ahead of
  /// one another; the picture does not.
  uint64_t bricks_hidden = 0;
  uint64_t bricks_again = 0;  // decoded or kept bricks that were prepared again, in a further slab or region
  uint64_t splats_read = 0, splats_drawn = 0;
  uint64_t splats_clipped = 0, splats_off_screen = 0,
           splats_transparent = 0;  // read but not drawn: the reason
  uint64_t splats_behind = 0;       // read but not drawn: behind opaque surfaces or slices
  uint64_t exchanged_bytes = 0;     // of projected splats, sent to other ranks
  // Drawn one by one: more than one if memory is short.
  uint64_t regions = 0;  // of the picture
  uint64_t slabs = 0;    // of depth, of all regions
  uint64_t ring_peak_bytes = 0;
  uint64_t sweep_peak_bytes = 0;  // of splats that wait for others that come before them in depth
  std::vector<BrickFailure> bricks_unreadable;  // with keep_going; sorted by number, each once
};

/// The stage "draw".
struct DrawStatistics {
  double upload_s = 0, draw_s = 0;
  double gl_draw_s = 0;  // by OpenGL's own clock, and so for its parts in compute shaders
  double gl_project_s = 0, gl_list_s = 0, gl_sort_s = 0, gl_paint_s = 0;
  uint64_t card_entries = 0, card_peak_bytes = 0;  // CardWork
  uint64_t card_splats = 0;                        // of bricks that stay on the card: read there
  uint64_t card_sent_bytes = 0, card_slabs = 0;    // CardWork
  uint64_t card_read_bytes = 0, card_pixels_listed = 0, card_pixels_blended = 0;  // CardWork
  double painter_waited_s = 0;                                                    // for the workers
  uint64_t splats_hidden = 0;  // left out behind others that are opaque; how many varies, as bricks_hidden
  double surfaces_s = 0;       // surfaces and slices, without reading and sampling bricks for slices
  uint64_t iso_splats = 0, iso_bricks = 0;  // that isosurfaces may lie in; in whole or in part
};

/// The times and counts of a frame.
struct FrameStatistics : PlanStatistics, FetchStatistics, PrepareStatistics, DrawStatistics {
  double total_s = 0;
  uint64_t memory_used_bytes = 0;  // of memory_bytes: by the stages and by decoded bricks that are kept
};

/// How the whole's number is made where several threads or ranks have one each.
enum class Combined { kSum, kLargest };

/// One number of FrameStatistics, or of a stage.
template <typename Statistics>
struct StatisticsField {
  const char* name;  // without _s
  std::variant<double Statistics::*, uint64_t Statistics::*> value;
  Combined combined = Combined::kSum;
  bool seconds = false;

  /// use(number), a double& or uint64_t&, or const.
  template <typename Of, typename Use>
  void visit(Of& statistics, const Use& use) const {
    std::visit([&](auto member) { use(statistics.*member); }, value);
  }
};

/// All numbers of a frame.
std::span<const StatisticsField<FrameStatistics>> statisticsFields();

/// Adds what one thread did.
void combine(PrepareStatistics& sum, const PrepareStatistics& part);
/// Adds what another rank did for the same picture. A brick that both read counts twice.
void combine(FrameStatistics& whole, const FrameStatistics& part);

}  // namespace curvisplat
