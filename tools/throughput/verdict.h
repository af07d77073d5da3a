// Which stage bounds a frame, and what would help: conclusions from measured numbers, and from nothing else.
// Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace curvisplat {

/// A frame of an orbit, after the first.
struct JudgedFrame {
  double seconds = 0;
  double lod_pixels = 1;
  unsigned threads = 1;
  uint64_t memory_bytes = 0;
  uint64_t splats_prepared = 0, splats_drawn = 0;
  uint64_t bytes = 0;        // of the streams of all its bricks
  double read_part = 0;      // of its bricks, 0..1, that came from the disk and not from memory
  bool draws_apart = false;  // drawing takes no time of the cores: a graphics card does it
};

/// Each by itself, on all the frame's threads. All above zero.
struct StageSpeeds {
  std::optional<double> read_bytes_s;  // none where it was not measured
  double verify_splats_s = 0, decode_splats_s = 0, project_splats_s = 0, sort_splats_s = 0, draw_splats_s = 0;
};

/// The same view, drawn otherwise.
struct OtherFrame {
  double seconds = 0;
  double lod_pixels = 1;
  unsigned threads = 1;
  uint64_t memory_bytes = 0;
  uint64_t splats_prepared = 0;
};

struct Verdict {
  std::string stage;  // "reading", "decoding", "projecting", "sorting" or "drawing"
  double share = 0;   // of the time of what bounds the frame (the disk, the cores, the card), 0..1
  /// For people: what bounds the frame first, then what would help, then what the disk could feed.
  std::vector<std::string> lines;
};

/// `others` may hold the frame itself.
Verdict judge(const JudgedFrame& frame, const StageSpeeds& speeds, std::span<const OtherFrame> others);

}  // namespace curvisplat
