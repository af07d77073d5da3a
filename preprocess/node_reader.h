// Reads nodes from a source and decides, in one place, which of them are there: the block's own blanking,
// `--blank VALUE` and non-finite numbers together.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "preprocess/grid_source.h"

namespace curvisplat {

struct BlankCounts {
  uint64_t by_grid = 0;     // iblank 0
  uint64_t by_value = 0;    // --blank
  uint64_t not_finite = 0;  // a coordinate or a scalar that is NaN or infinite; only nodes not counted above
  uint64_t total() const { return by_grid + by_value + not_finite; }
  BlankCounts& operator+=(const BlankCounts& other);
};

/// As a GridSource: any number of threads may read at once.
class NodeReader {
 public:
  /// `scalars`: positions in source.description().scalars. `source` must outlive the reader.
  NodeReader(const GridSource& source, std::vector<uint32_t> scalars, std::optional<double> blank_value);

  const GridSource& source() const { return *source_; }
  size_t scalars() const { return scalars_.size(); }

  /// Reads `box` of `block`, and blanks. Values and coordinates of blanked nodes are as they were read.
  BlankCounts read(uint32_t block, const NodeBox& box, NodeArrays& out) const;

 private:
  const GridSource* source_;
  std::vector<uint32_t> scalars_;
  std::optional<double> blank_value_;
};

}  // namespace curvisplat
