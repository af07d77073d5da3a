// Reads nodes from a source and decides, in one place, which of them are there: the block's own blanking,
// `--blank VALUE` and non-finite numbers together.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

struct BlankCounts {
  uint64_t by_grid = 0;     // iblank 0
  uint64_t by_value = 0;    // --blank
  uint64_t not_finite = 0;  // a coordinate or a scalar that is NaN or infinite; only nodes not counted above
  uint64_t total() const { return by_grid + by_value + not_finite; }
  BlankCounts& operator+=(const BlankCounts& other);
};

/// NodeArrays::blank as a NodeReader of cell-centred scalars fills it: what is wrong with the node, and with
/// the value of the cell whose lowest node it is.
enum CellMark : uint8_t {
  kNoNode = 1,          // blanked by the grid, or its coordinates are not finite
  kNoValue = 2,         // NaN: there is no such cell, or the grid blanks it
  kBlankValue = 4,      // --blank
  kValueNotFinite = 8,  // infinite
};

/// As a GridSource: any number of threads may read at once.
class NodeReader {
 public:
  /// `scalars`: positions in source.description().scalars. `source` must outlive the reader. Throws Error if
  /// some are of nodes and others of cells.
  NodeReader(const GridSource& source, std::vector<uint32_t> scalars, std::optional<double> blank_value);

  const GridSource& source() const { return *source_; }
  size_t scalars() const { return scalars_.size(); }
  /// Of all of its scalars; of nodes if there are none.
  Centring centring() const { return centring_; }

  /// Reads `box` of `block`, and blanks. Values and coordinates of blanked nodes are as they were read. Of
  /// cell-centred scalars `blank` holds CellMarks, and nothing is counted: whether a cell is there depends on
  /// nodes that may lie outside of the box.
  BlankCounts read(uint32_t block, const NodeBox& box, NodeArrays& out) const;

 private:
  const GridSource* source_;
  std::vector<uint32_t> scalars_;
  std::optional<double> blank_value_;
  Centring centring_;
};

}  // namespace curvisplat
