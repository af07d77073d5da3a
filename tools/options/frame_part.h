// Which frames of an orbit, a path or a series one process draws, where several share the work: --part, or ranks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace curvisplat {

/// One of `count` parts of equal size. Frames are dealt out in turn, since neighbours take about the same time.
struct FramePart {
  uint64_t index = 0;  // from 0
  uint64_t count = 1;

  /// The frames index, index + count, index + 2 count, ... of 0 .. frames - 1.
  std::vector<uint64_t> of(uint64_t frames) const;
};

/// Parses "i/n" with i from 1 to n. Throws UsageError.
FramePart parsePart(const std::string& text);

}  // namespace curvisplat
