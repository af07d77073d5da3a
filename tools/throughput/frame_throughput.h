// Whole frames, as `render` draws them, on an orbit around the data: the first from the disk, the others with
// what the memory keeps of the frames before. By error, threads and memory, one varied at a time.
//
//   frames/lod:1/threads:2/memory:512MiB          s a frame, after the first
//   frames/lod:1/threads:2/memory:512MiB/cold     s of the first one, its files out of the page cache
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/frame/frame.h"
#include "stream/base/progress.h"
#include "tools/throughput/measurements.h"
#include "tools/throughput/throughput_scene.h"

namespace curvisplat {

struct FrameEffort {
  double configuration_s = 4;  // about so long are frames of one configuration drawn; two at least
  double total_s = 90;         // what would go on longer is left out
  unsigned most_frames = 24;
};

struct FrameConfiguration {
  double lod_pixels = 1;
  unsigned threads = 1;
  uint64_t memory_bytes = 512 << 20;
  bool operator==(const FrameConfiguration&) const = default;

  /// "frames/lod:1/threads:2/memory:512MiB"
  std::string name() const;
};

struct FramesOfConfiguration {
  FrameConfiguration configuration;
  uint64_t bytes = 0;  // of the streams of a frame's bricks, from the first camera
  std::optional<FrameStatistics> cold;
  std::vector<FrameStatistics> warm;  // one at least
};

/// What is to be drawn, coarsest first: the errors with all threads and the memory given; then, at the error
/// in the middle, fewer threads, and a quarter and four times the memory. Each once.
std::vector<FrameConfiguration> frameConfigurations(std::span<const double> lod_pixels, unsigned threads,
                                                    uint64_t memory_bytes, uint64_t available_bytes);

/// Adds to `to`, and returns what was drawn. Throws Interrupted, and as FrameRenderer does.
std::vector<FramesOfConfiguration> measureFrames(const ThroughputScene& scene,
                                                 std::span<const FrameConfiguration> configurations,
                                                 const FrameEffort& effort, Measurements& to,
                                                 Progress& progress);

/// [{"lod_pixels", "threads", "memory_bytes", "stream_bytes", "frames", "median": {...}, "cold": {...}}]
nlohmann::ordered_json toJson(std::span<const FramesOfConfiguration> frames);

/// The frame in the middle by its time.
const FrameStatistics& medianFrame(const std::vector<FrameStatistics>& frames);

}  // namespace curvisplat
