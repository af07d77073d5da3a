// The cost of a picture for 1, 2, ... 1024 processes: simulated from a cache's index and a view, shared out by
// the function that shares out real pictures (render/ranks/picture_shares.h). Nothing is read but the index.
// Pure.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "render/annotate/plot.h"
#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame_options.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

inline constexpr uint32_t kMaxSimulatedRanks = 65536;

/// Work is in units of preparing one splat.
struct SimulatedRanks {
  uint32_t ranks = 1;
  double largest_work = 0, mean_work = 0;     // largest: until the last rank is done
  double speed_up = 1;                        // one rank's work over the largest
  uint64_t largest_bytes = 0, all_bytes = 0;  // read from the cache
  double sent_splats = 0;                     // to other ranks
  uint64_t splat_bytes = 0;                   // of those, projected, with their keys
  double painted_splats = 0;                  // a splat that several ranks paint counts for each
  uint64_t pixel_bytes = 0;                   // on their way to rank 0

  /// How even the shares are: the mean over the largest.
  double balance() const { return largest_work > 0 ? mean_work / largest_work : 1; }
  /// Speed-up by the number of ranks: less than the balance, since some splats are painted by several ranks.
  double efficiency() const { return speed_up / ranks; }
  /// The number of splats sent, as a multiple of `splats`.
  double exchange(uint64_t splats) const {
    return splats == 0 ? 0 : sent_splats / static_cast<double>(splats);
  }
};

struct RankSimulation {
  uint64_t splats = 0, parts = 0;  // of the picture
  std::vector<SimulatedRanks> counts;
};

struct SimulatedPicture {
  const CacheReader& cache;
  size_t variable;
  const TransferFunction& function;
  const FrameOptions& options;
};

/// Throws UsageError as FrameRenderer::render() does.
RankSimulation simulateRanks(const SimulatedPicture& picture, const Camera& camera,
                             const std::vector<uint32_t>& counts);

std::string rankTable(const RankSimulation& simulation);
nlohmann::ordered_json toJson(const RankSimulation& simulation);
/// ranks.png: efficiency, and bytes, over the number of ranks.
Plots rankPlots(const RankSimulation& simulation);

}  // namespace curvisplat
