// Concludes from measurements alone which stage bounds a frame and what would make it faster. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace curvisplat {

/// The frame to judge: one of an orbit, after the first.
struct JudgedFrame {
  double seconds = 0;
  double lod_pixels = 1;
  unsigned threads = 1;
  uint64_t memory_bytes = 0;
  uint64_t splats_prepared = 0, splats_drawn = 0;
  uint64_t bytes = 0;        // compressed size of all its bricks
  double read_fraction = 0;  // of its bricks, 0..1, were read from the disk
  bool draws_apart = false;  // by a graphics card, so that drawing takes no time of the cores
};

/// Rate of each stage in isolation, on all of the frame's threads. All above zero.
struct StageSpeeds {
  std::optional<double> read_bytes_s;  // nullopt if not measured
  double verify_splats_s = 0, decode_splats_s = 0, project_splats_s = 0, sort_splats_s = 0, draw_splats_s = 0;
  /// The spread of the samples of the least steady stage: half the distance from the smallest to the largest,
  /// as a fraction of their median.
  double spread = 0;
};

/// The same view drawn with other settings.
struct OtherFrame {
  double seconds = 0;
  double lod_pixels = 1;
  unsigned threads = 1;
  uint64_t memory_bytes = 0;
  uint64_t splats_prepared = 0;
  double spread_s = 0;  // half the distance between the quartiles of the repeated frames
};

struct Verdict {
  std::string stage;  // "reading", "decoding", "projecting", "sorting" or "drawing"
  double share =
      0;  // the stage's share, 0..1, of the time of the bounding resource (disk, cores or graphics card)
  /// Text for the user: what bounds the frame, then what would help, then what the disk could sustain; last, what to
  /// buy.
  std::vector<std::string> lines;
};

/// `others` may contain the judged frame.
Verdict judge(const JudgedFrame& frame, const StageSpeeds& speeds, std::span<const OtherFrame> others);

}  // namespace curvisplat
