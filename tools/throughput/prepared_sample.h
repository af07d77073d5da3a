// Holds the bricks of a sample in memory in the form each stage of a frame expects (compressed, decoded,
// projected, sorted), so that each stage can be run alone and repeatedly.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render/frame/frame_plan.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/splats.h"
#include "tools/throughput/brick_sample.h"

namespace curvisplat {

class PreparedSample {
 public:
  /// Reads, decodes, projects and sorts the sample. Keeps references to all arguments. Throws Error.
  PreparedSample(const CacheReader& cache, size_t variable, const FramePlanner& planner,
                 const FramePlan& plan, const BrickSample& sample);

  /// Buffers of one thread, reused for every brick.
  struct Scratch {
    SplatGeometry geometry;
    SplatVariable values;
    BrickProjector projector;
    std::vector<uint32_t> keys;
    DepthSorter sorter;
    std::vector<ScreenSplat> sorted;
    ReadTimes times;
  };

  size_t size() const { return bricks_.size(); }
  uint64_t splats() const { return splats_; }    // in the sampled parts; these are projected
  uint64_t decoded() const { return decoded_; }  // in the whole bricks; these are decoded
  uint64_t screenSplats() const { return on_screen_; }
  uint64_t bytes() const { return bytes_; }  // compressed

  /// Runs one stage on brick n. Any thread, each with its own scratch.
  void verify(size_t n) const;
  void decode(size_t n, Scratch& scratch) const;
  void project(size_t n, Scratch& scratch) const;
  void sort(size_t n, Scratch& scratch) const;
  void prepare(size_t n, Scratch& scratch) const;  // all stages in sequence

  /// The painter's input: splats sorted nearest first, and the number of splats of each brick.
  const std::vector<ScreenSplat>& toDraw() const { return to_draw_; }
  const std::vector<uint32_t>& segments() const { return segments_; }

 private:
  struct SampledBrick {
    BrickPart part;
    std::vector<std::byte> geometry_bytes, values_bytes;
    SplatGeometry geometry;
    SplatVariable values;
    std::vector<uint32_t> keys;  // of the splats on the screen, unsorted
    std::vector<ScreenSplat> projected;
  };

  void verifyAndDecode(size_t n, Scratch& scratch) const;
  void project(const SampledBrick& brick, const SplatGeometry& geometry, const SplatVariable& values,
               BrickProjector& projector) const;
  const std::vector<uint32_t>& keysOf(const SampledBrick& brick, Scratch& scratch) const;

  const CacheReader& cache_;
  const size_t variable_;
  const FramePlanner& planner_;
  const FramePlan& plan_;
  std::vector<SampledBrick> bricks_;
  uint64_t splats_ = 0, decoded_ = 0, on_screen_ = 0, bytes_ = 0;
  std::vector<ScreenSplat> to_draw_;
  std::vector<uint32_t> segments_;
};

}  // namespace curvisplat
