#include "preprocess/overset/block_owners.h"

#include <algorithm>
#include <compare>
#include <limits>
#include <utility>

#include "preprocess/grid/parallel.h"
#include "preprocess/shape/covered_part.h"

namespace curvisplat {
namespace {

constexpr uint64_t kTreeBytesPerNode = 24;               // of a CellTree, beside the nodes
constexpr uint64_t kTilesInMemory = 4;                   // at least
constexpr uint64_t kMaxLeastBytes = uint64_t{64} << 10;  // of a tile; longer rows are cut

/// The order in which blocks come: the least owns the point.
struct Rank {
  bool fringe = false;
  CellSize size = kNoCell;
  uint32_t block = 0;
  auto operator<=>(const Rank&) const = default;
};

// How a sample's middle lies to another block.
constexpr uint8_t kOwned = 1;   // in it, and it owns what the sample has of any of its own block's cells
constexpr uint8_t kPartly = 2;  // in it, and that depends
constexpr uint8_t kLost = 4;    // in it, and it owns none of that

}  // namespace

BlockOwners::BlockOwners(NodeReader reader, const std::vector<BlockOverlap>& overlaps, uint64_t memory_bytes)
    : reader_(std::move(reader)), memory_bytes_(memory_bytes) {
  const std::vector<GridBlock>& blocks = reader_.source().description().blocks;
  partners_.resize(blocks.size());
  tiles_of_.resize(blocks.size());
  for (const BlockOverlap& overlap : overlaps) {
    partners_[overlap.first].push_back(overlap.second);
    partners_[overlap.second].push_back(overlap.first);
  }
  for (auto& partners : partners_) std::sort(partners.begin(), partners.end());
  const uint64_t bytes_per_node = slabBytesPerNode(reader_.scalars()) + kTreeBytesPerNode;
  const uint64_t window_nodes =
      std::max(memory_bytes / kTilesInMemory, leastBytes(reader_.source().description(), reader_.scalars())) /
      bytes_per_node;
  for (const Slab& slab : cutIntoSlabs(blocks, window_nodes, kCornerHalo)) {
    if (partners_[slab.block].empty()) continue;
    const LoadedSlab loaded = read(slab);
    BoundingBox box;
    for (size_t n = 0; n < loaded.nodes.x.size(); ++n)
      if (!loaded.nodes.blank[n]) box.add({loaded.nodes.x[n], loaded.nodes.y[n], loaded.nodes.z[n]});
    tiles_of_[slab.block].push_back(tiles_.size());
    tiles_.push_back({slab, box, {}});
  }
}

NodeReader ownersReader(const NodeReader& reader, bool everywhere) {
  if (!everywhere || reader.centring() == Centring::kCell) return reader;
  return {reader.source(), {}, std::nullopt};  // coordinates alone
}

uint64_t BlockOwners::leastBytes(const GridDescription& grid, size_t scalars) {
  const uint64_t bytes = leastSlabBytes(grid.blocks, scalars, kCornerHalo);
  return std::min(bytes + bytes / slabBytesPerNode(scalars) * kTreeBytesPerNode, kMaxLeastBytes);
}

LoadedSlab BlockOwners::read(const Slab& slab) const {
  LoadedSlab loaded;
  loaded.slab = slab;
  loaded.blanked = reader_.read(slab.block, slab.window, loaded.nodes);
  return loaded;
}

std::vector<uint8_t> BlockOwners::fringeOf(const Slab& slab) const {
  std::vector<uint8_t> fringe;
  const GridSource& source = reader_.source();
  const bool has_fringe = slab.window.hasWholeRows(source.description().blocks[slab.block].ni)
                              ? source.readFringe(slab.block, slab.window, fringe)
                              : source.readFringePart(slab.block, slab.window, fringe);
  if (!has_fringe) fringe.clear();
  return fringe;
}

std::shared_ptr<const CellTree> BlockOwners::treeOf(size_t tile) {
  const auto found =
      std::find_if(kept_.begin(), kept_.end(), [&](const TreeOfTile& kept) { return kept.tile == tile; });
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return kept_.front().tree;
  }
  const Slab& slab = tiles_[tile].slab;
  LoadedSlab loaded = read(slab);
  std::vector<uint8_t> fringe = fringeOf(slab);
  auto tree = std::make_shared<const CellTree>(reader_.source().description().blocks[slab.block],
                                               std::move(loaded), std::move(fringe), reader_.centring());
  tiles_[tile].first.emplace(tree->isAllFringe(), tree->smallest());
  kept_bytes_ += tree->bytes();
  kept_.push_front({tile, std::move(tree)});
  while (kept_.size() > 1 && kept_bytes_ > memory_bytes_) {
    kept_bytes_ -= kept_.back().tree->bytes();
    kept_.pop_back();
  }
  return kept_.front().tree;
}

/// Finds what covers the samples of one slab.
class BlockOwners::SlabCover {
 public:
  SlabCover(BlockOwners& owners, const LoadedSlab& loaded, std::vector<uint64_t>& covered)
      : owners_(owners),
        block_(owners.reader_.source().description().blocks[loaded.slab.block]),
        number_(loaded.slab.block),
        box_(loaded.slab.box),
        around_(withNeighbours(loaded.slab)),
        samples_(block_, loaded, owners.fringeOf(loaded.slab), owners.reader_.centring()),
        covered_(covered) {
    covered_.assign(loaded.nodes.x.size(), 0);
    states_.resize(covered_.size());
    boxes_.resize(rowsOf(around_));
    forRows(around_, [&](uint64_t j, uint64_t k) {
      BoundingBox& box = boxes_[rowAt(j, k)];
      forSamples(around_, j, k, [&](size_t sample) { samples_.addTo(box, sample); });
    });
    for (const BoundingBox& box : boxes_) all_.add(box);
    if (!all_.isEmpty()) all_ = twiceAsLarge(all_);
    last_ = {false, std::numeric_limits<CellSize>::min(), number_};
    for (uint64_t k = box_.k0; k < box_.k1; ++k)
      for (uint64_t j = box_.j0; j < box_.j1; ++j)
        forSamples(box_, j, k, [&](size_t sample) {
          last_ = std::max(last_, Rank{samples_.isFringe(sample), samples_.largestAround(sample), number_});
        });
  }

  /// Whether other blocks own all of the samples. Ends at the first one of which they do not.
  bool isWhole() const {
    for (uint64_t k = box_.k0; k < box_.k1; ++k)
      for (uint64_t j = box_.j0; j < box_.j1; ++j) {
        const size_t first = samples_.elementOf(box_.i0, j, k);
        for (size_t sample = first; sample < first + box_.rowNodes(block_.ni); ++sample)
          if (samples_.isThere(sample) && covered_[sample] != kAllCovered) return false;
      }
    return true;
  }

  void addPartner(uint32_t partner) {
    const std::vector<size_t> tiles = tilesThatMeet(partner);
    if (std::all_of(tiles.begin(), tiles.end(), [&](size_t tile) { return ownsNothing(tile, partner); }))
      return;
    std::fill(states_.begin(), states_.end(), uint8_t{0});
    for (const size_t tile : tiles) locateMiddles(*owners_.treeOf(tile), partner);
    for (const size_t tile : tiles) {
      const std::shared_ptr<const CellTree> tree = owners_.treeOf(tile);
      forRows(box_, [&](uint64_t j, uint64_t k) {
        if (!tree->box().touches(boxAround(j, k))) return;
        CellTree::Hint hint;
        forSamples(box_, j, k, [&](size_t sample) { coverSample(*tree, partner, sample, j, k, hint); });
      });
    }
  }

 private:
  static NodeBox withNeighbours(const Slab& slab) {
    const NodeBox &box = slab.box, &window = slab.window;
    return {std::max(window.j0 + 1, box.j0) - 1, std::min(box.j1 + 1, window.j1),
            std::max(window.k0 + 1, box.k0) - 1, std::min(box.k1 + 1, window.k1),
            std::max(window.i0 + 1, box.i0) - 1, std::min(box.i1 + 1, window.i1)};
  }
  static BoundingBox twiceAsLarge(const BoundingBox& box) {
    const glm::dvec3 margin = 0.5 * (box.upper - box.lower);
    return {box.lower - margin, box.upper + margin};
  }
  size_t rowAt(uint64_t j, uint64_t k) const {
    return (k - around_.k0) * (around_.j1 - around_.j0) + (j - around_.j0);
  }
  template <typename Each>
  void forRows(const NodeBox& box, const Each& each) const {
    const uint64_t width = box.j1 - box.j0;
    parallelFor(uint64_t{0}, rowsOf(box), [&](uint64_t n) { each(box.j0 + n % width, box.k0 + n / width); });
  }
  /// Calls each() for the samples of a row of `box`.
  template <typename Each>
  void forSamples(const NodeBox& box, uint64_t j, uint64_t k, const Each& each) const {
    const size_t first = samples_.elementOf(box.i0, j, k);
    for (size_t sample = first; sample < first + box.rowNodes(block_.ni); ++sample)
      if (samples_.isThere(sample)) each(sample);
  }

  /// A box around the cells of a row's samples, which reach half way to its neighbours.
  BoundingBox boxAround(uint64_t j, uint64_t k) const {
    BoundingBox box = boxes_[rowAt(j, k)];
    if (box.isEmpty()) return box;
    for (uint64_t other_k = std::max(k, around_.k0 + 1) - 1; other_k < std::min(k + 2, around_.k1); ++other_k)
      for (uint64_t other_j = std::max(j, around_.j0 + 1) - 1; other_j < std::min(j + 2, around_.j1);
           ++other_j)
        box.add(boxes_[rowAt(other_j, other_k)]);
    return twiceAsLarge(box);
  }

  std::vector<size_t> tilesThatMeet(uint32_t partner) const {
    std::vector<size_t> tiles;
    if (all_.isEmpty()) return tiles;
    for (const size_t tile : owners_.tiles_of_[partner])
      if (owners_.tiles_[tile].box.meets(all_)) tiles.push_back(tile);
    return tiles;
  }

  /// Whether no cell of the tile comes before one of the samples'.
  bool ownsNothing(size_t tile, uint32_t partner) const {
    if (!owners_.tiles_[tile].first) owners_.treeOf(tile);
    const auto [fringe, size] = *owners_.tiles_[tile].first;
    return Rank{fringe, size, partner} >= last_;
  }

  /// Sets the states of the samples of which a cell of the tree holds the middle.
  void locateMiddles(const CellTree& tree, uint32_t partner) {
    forRows(around_, [&](uint64_t j, uint64_t k) {
      if (!boxes_[rowAt(j, k)].touches(tree.box())) return;
      CellTree::Hint hint;
      forSamples(around_, j, k, [&](size_t sample) {
        const auto [smallest, largest] = samples_.sizes(sample);
        const bool fringe = samples_.isFringe(sample);
        const Rank first{fringe, smallest, number_}, last{fringe, largest, number_};
        tree.anyHolder(samples_.middle(sample), hint, [&](const CellTree::Holder& holder) {
          const Rank other{tree.isFringe(holder), tree.sizeOf(holder.cell), partner};
          states_[sample] |= other < first ? kOwned : other < last ? kPartly : kLost;
          return other < first;
        });
      });
    });
  }

  /// The states that a sample and all its neighbours have in common, and those that any of them has.
  std::pair<uint8_t, uint8_t> statesAround(size_t sample, uint64_t j, uint64_t k) const {
    const uint64_t i = around_.i0 + (sample - samples_.elementOf(around_.i0, j, k));
    uint8_t all = 0xff, any = 0;
    bool outside = false;
    for (uint64_t kk = std::max(k, around_.k0 + 1) - 1; kk < std::min(k + 2, around_.k1); ++kk)
      for (uint64_t jj = std::max(j, around_.j0 + 1) - 1; jj < std::min(j + 2, around_.j1); ++jj)
        for (uint64_t ii = std::max(i, around_.i0 + 1) - 1; ii < std::min(i + 2, around_.endOfRow(block_.ni));
             ++ii) {
          const size_t other = samples_.elementOf(ii, jj, kk);
          if (!samples_.isThere(other)) continue;
          all &= states_[other];
          any |= states_[other];
          outside |= states_[other] == 0;
        }
    return {outside ? uint8_t{0} : all, any};
  }

  void coverSample(const CellTree& tree, uint32_t partner, size_t sample, uint64_t j, uint64_t k,
                   CellTree::Hint& hint) {
    uint64_t& covered = covered_[sample];
    if (covered == kAllCovered) return;
    const auto [all, any] = statesAround(sample, j, k);
    if (all == kOwned) {
      covered = kAllCovered;
      return;
    }
    if (any == kLost) return;
    const SampleCells::Piece piece = samples_.pieceOf(sample);
    if (!tree.meets(samples_.boxOf(piece))) return;
    const bool fringe = samples_.isFringe(sample);
    const auto& points = cellPoints();
    for (size_t n = 0; n < kCellPoints; ++n) {
      if (covered >> n & 1) continue;
      const auto [point, size] = samples_.pointOf(piece, points[n]);
      const Rank own{fringe, size, number_};
      if (tree.anyHolder(point, hint, [&](const CellTree::Holder& holder) {
            return Rank{tree.isFringe(holder), tree.sizeOf(holder.cell), partner} < own;
          }))
        covered |= uint64_t{1} << n;
    }
  }

  BlockOwners& owners_;
  const GridBlock& block_;
  const uint32_t number_;
  const NodeBox box_, around_;  // the samples that are wanted; with their neighbours
  const SampleCells samples_;
  std::vector<uint64_t>& covered_;
  std::vector<uint8_t> states_;     // [sample], to one partner
  std::vector<BoundingBox> boxes_;  // [row of around_], of the samples' middles
  BoundingBox all_;                 // around all of them, and as far again
  Rank last_;                       // of the samples' cells
};

void BlockOwners::cover(const LoadedSlab& loaded, std::vector<uint64_t>& covered) {
  covered.clear();
  const std::vector<uint32_t>& partners = partners_[loaded.slab.block];
  if (partners.empty()) return;
  SlabCover cover(*this, loaded, covered);
  for (const uint32_t partner : partners) {
    if (cover.isWhole()) return;
    cover.addPartner(partner);
  }
}

}  // namespace curvisplat
