// Measures each stage of a frame in isolation, on one thread and on all: read, verify, decode, project, sort,
// draw, and prepare (verify to sort of one brick, as a worker does it). Uses a sample of the bricks of one
// frame at the finest given error. All stages but read work on data in memory.
//
//   stages/read                     B/s of compressed bricks through the pager, without decoding
//   stages/decode/threads:2         splats/s; .../bytes: B/s of compressed bricks (also verify, prepare)
//   stages/draw/cpu/threads:2       splats/s, counting splats that reach the screen
//   stages/draw/osmesa              the same with OpenGL's own threads
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/throughput_scene.h"

namespace curvisplat {

struct StageEffort {
  double sample_s = 0.15;  // a sample repeats its stage until this time has passed
  unsigned samples = 3;
  uint64_t max_splats = 1'500'000;      // size of the sample; 200 bytes of memory each
  uint64_t max_read_bytes = 128 << 20;  // size of the sample of stages/read
};

/// What the report and the verdict need besides the measurements.
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
