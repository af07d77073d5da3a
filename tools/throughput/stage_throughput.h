// How fast each stage of a frame is by itself, on one core and on all: read, verify, decode, project, sort,
// draw, and what a worker does with a brick in one go (prepare). On a sample of the bricks of one frame at
// the finest error asked for, from memory but for read.
//
//   stages/read                     B/s of the bricks' streams, by the pager, decoding off
//   stages/decode/threads:2         splats/s; with /bytes: B/s of the streams; so for verify, prepare
//   stages/draw/cpu/threads:2       splats/s that reach the screen
//   stages/draw/osmesa              in OpenGL's own threads
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stream/base/progress.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/throughput_scene.h"

namespace curvisplat {

struct StageEffort {
  double sample_s = 0.15;  // a sample is repeated until it takes as long
  unsigned samples = 3;
  uint64_t most_splats = 1'500'000;      // in memory: 200 bytes each
  uint64_t most_read_bytes = 128 << 20;  // that the pager reads
};

/// What was measured, for people and for the verdict.
struct StageReport {
  uint64_t frame_splats = 0, sampled_splats = 0;
  std::string read_by;  // "io_uring, direct"
  std::vector<BackendReport> backends;
  bool card_draws = false;  // a graphics card does, through EGL
};

/// "stages/decode/threads:2"
std::string stageName(const std::string& stage, unsigned threads);

/// Adds to `to`. `threads`: the most. Throws Interrupted, and Error where bricks cannot be read.
StageReport measureStages(const ThroughputScene& scene, unsigned threads, const StageEffort& effort,
                          Measurements& to, Progress& progress);

}  // namespace curvisplat
