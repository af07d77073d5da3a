// A grid with the nodes that a cache has drawn, whatever scalars are read from it now: blank is what the
// cache has no splat of, so that every cell comes out as it did when the cache was made.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "preprocess/drawn_nodes.h"
#include "preprocess/grid_source.h"

namespace curvisplat {

class CacheGrid : public GridSource {
 public:
  /// What the grid itself blanks: iblank, and coordinates that are not finite. Enough for a cache whose
  /// scalars had values everywhere else. `source` must outlive it.
  explicit CacheGrid(const GridSource& source);

  /// Blanks nodes that the cache does not draw, too. Nodes of block faces may have been merged into others,
  /// and are there all the same if `faces_merge`.
  void restrictTo(std::unique_ptr<const DrawnNodes> drawn, bool faces_merge);

  const GridDescription& description() const override { return source_->description(); }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  void restrict(uint32_t block, const NodeBox& box, std::vector<uint8_t>& blank) const;

  const GridSource* source_;
  std::vector<uint64_t> first_nodes_;  // [block]
  std::unique_ptr<const DrawnNodes> drawn_;
  bool faces_merge_ = false;
};

}  // namespace curvisplat
