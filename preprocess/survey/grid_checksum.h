// Tells whether two time steps have the same geometry: a checksum of all that it depends on, the coordinates of
// the nodes and what is blanked, byte for byte. The sum of the rows' checksums, so that it does not depend on how
// the grid is divided.
#pragma once

#include <cstdint>
#include <vector>

#include "preprocess/grid/slabs.h"
#include "stream/base/checksum.h"

namespace curvisplat {

/// For one thread. While rows are cut it keeps 2.3 KiB for each row of a slab.
class GridChecksum {
 public:
  /// Adds the rows of the slab's box, without its halo; works in parallel. The parts of a row must come one after the
  /// other, as cutIntoSlabs() lists them.
  void add(const LoadedSlab& loaded, const GridBlock& block);

  /// Of the rows that were added. The sum of the values of all shares of a grid is the grid's checksum.
  uint64_t value() const { return sum_; }

 private:
  /// A row of which the first parts were added.
  struct Row {
    Checksum x, y, z, blank;
  };
  uint64_t ofParts(Row& row, const LoadedSlab& loaded, const GridBlock& block, uint64_t j, uint64_t k) const;

  uint64_t sum_ = 0;
  std::vector<Row> rows_;  // of the last slab's box, if that has parts of rows
};

}  // namespace curvisplat
