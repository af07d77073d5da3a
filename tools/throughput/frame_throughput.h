// Measures whole frames of a scene, as `render` draws them, on an orbit around the data. The first frame
// reads from the disk; later ones also use bricks that earlier frames left in memory. Varies error, threads
// and memory one at a time.
//
//   frames/lod:1/threads:2/memory:512MiB        s per frame, after the first
//   frames/lod:1/threads:2/memory:512MiB/cold   s of the first frame, files not in the page cache
//
// measureFrames() is for the main thread; drawing starts threads of its own.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/backend/backend.h"
#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "tools/throughput/measurements.h"

namespace curvisplat {

/// The scene that `curvisplat bench` draws: a cache, a scalar, a transfer function, and cameras around the
/// data. It refers to objects of the subcommand.
struct ThroughputScene {
  const CacheReader& cache;
  size_t variable;
  const TransferFunction& transfer_function;
  FrameOptions options;  // of every frame, before one of them is varied
  Backend backend;
  /// `frames` cameras spread evenly over one orbit around the data.
  std::function<std::vector<Camera>(unsigned frames)> orbit;
};

struct FrameEffort {
  double configuration_s = 4;  // approximate time for the frames of one configuration (at least two)
  double total_s = 90;         // configurations that would exceed this total are skipped
  unsigned max_frames = 24;
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
  uint64_t bytes = 0;  // compressed size of the bricks of the first camera's frame
  std::optional<FrameStatistics> cold;
  std::vector<FrameStatistics> warm;  // at least one
};

/// The configurations to draw: every error, coarsest first, with all threads and the given memory; then, at
/// the median error, fewer threads, and a quarter and four times the memory. Without duplicates.
std::vector<FrameConfiguration> frameConfigurations(std::span<const double> lod_pixels, unsigned threads,
                                                    uint64_t memory_bytes, uint64_t available_bytes);

/// Adds the measurements to `to` and returns the statistics of the drawn frames. Throws Interrupted, and
/// what FrameRenderer throws.
std::vector<FramesOfConfiguration> measureFrames(const ThroughputScene& scene,
                                                 std::span<const FrameConfiguration> configurations,
                                                 const FrameEffort& effort, Measurements& to,
                                                 Progress& progress);

/// [{"lod_pixels", "threads", "memory_bytes", "stream_bytes", "frames", "median": {...}, "cold": {...}}]
nlohmann::ordered_json toJson(std::span<const FramesOfConfiguration> frames);

/// The median frame by time.
const FrameStatistics& medianFrame(const std::vector<FrameStatistics>& frames);

}  // namespace curvisplat
