#include "preprocess/cache_grid.h"

#include <cmath>
#include <utility>

namespace curvisplat {

CacheGrid::CacheGrid(const GridSource& source) : source_(&source) {
  uint64_t node = 0;
  for (const GridBlock& block : source.description().blocks) {
    first_nodes_.push_back(node);
    node += block.nodes();
  }
}

void CacheGrid::restrictTo(std::unique_ptr<const DrawnNodes> drawn, bool faces_merge) {
  drawn_ = std::move(drawn);
  faces_merge_ = faces_merge;
}

void CacheGrid::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                     NodeArrays& out) const {
  source_->read(block, box, scalars, out);
  for (size_t n = 0; n < out.x.size(); ++n)
    out.blank[n] |= !(std::isfinite(out.x[n]) && std::isfinite(out.y[n]) && std::isfinite(out.z[n]));
  if (drawn_) restrict(block, box, out.blank);
}

void CacheGrid::restrict(uint32_t number, const NodeBox& box, std::vector<uint8_t>& blank) const {
  const GridBlock& block = description().blocks[number];
  size_t at = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k) {
    for (uint64_t j = box.j0; j < box.j1; ++j, at += block.ni) {
      const std::span<uint8_t> row(&blank[at], block.ni);
      const uint64_t first = first_nodes_[number] + (k * block.nj + j) * block.ni;
      if (!faces_merge_) {
        drawn_->blankOthers(first, row);
        continue;
      }
      const bool on_face = j == 0 || j + 1 == block.nj || k == 0 || k + 1 == block.nk;
      if (!on_face && block.ni > 2) drawn_->blankOthers(first + 1, row.subspan(1, block.ni - 2));
    }
  }
}

}  // namespace curvisplat
