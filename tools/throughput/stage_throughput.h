// Measures each stage of a frame in isolation, on one thread and on all: read, verify, decode, project,
// sort, draw, and prepare (verify to sort of one brick, as a worker does it). It takes a sample of the
// bricks of one frame at the finest given error. All stages but read work on data in memory, some 300 MB.
//
//   stages/read                     B/s of compressed bricks through the pager, without decoding
//   stages/decode/threads:2         splats/s; .../bytes: B/s of compressed bricks (also verify, prepare)
//   stages/draw/cpu/threads:2       splats/s, counting splats that reach the screen
//   stages/draw/osmesa              the same with OpenGL's own threads
//
// measureStages() is for the main thread; it starts threads of its own.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/frame/frame_plan.h"
#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"
#include "tools/throughput/frame_throughput.h"
#include "tools/throughput/measurements.h"

namespace curvisplat {

/// A representative part of a frame's bricks that is small enough to measure in seconds: runs of bricks that
/// are consecutive in drawing order, spread evenly over the frame.
struct BrickSample {
  std::vector<BrickPart> parts;  // in drawing order
  uint64_t splats = 0;           // sum over the parts
};

/// Chooses all of `parts` if they hold at most `max_splats` splats; otherwise at most `runs` runs of parts
/// that together hold about `max_splats`, at least one part.
BrickSample sampleOf(std::span<const BrickPart> parts, std::span<const Brick> bricks, uint64_t max_splats,
                     uint32_t runs = 16);

/// Holds the bricks of a sample in memory in the form that each stage of a frame expects (compressed,
/// decoded, projected, sorted), so that each stage can be run alone and repeatedly.
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

struct StageEffort {
  double sample_s = 0.15;  // a sample repeats its stage until this time has passed
  unsigned samples = 3;
  uint64_t max_splats = 1'500'000;      // size of the sample; 200 bytes of memory each
  uint64_t max_read_bytes = 128 << 20;  // size of the sample of stages/read
};

/// Facts that the report and the verdict need besides the measurements.
struct StageReport {
  uint64_t frame_splats = 0, sampled_splats = 0;
  std::string read_by;  // "io_uring, direct"
  std::vector<BackendReport> backends;
  bool card_draws = false;  // whether EGL draws with a graphics card
};

/// "stages/decode/threads:2"
std::string stageName(const std::string& stage, unsigned threads);

/// Adds the measurements to `to`. `threads`: the largest number of threads. Throws Interrupted, and Error if
/// bricks cannot be read.
StageReport measureStages(const ThroughputScene& scene, unsigned threads, const StageEffort& effort,
                          Measurements& to, Progress& progress);

}  // namespace curvisplat
