#include <hwy/aligned_allocator.h>
#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <new>
#include <vector>

#include "render/cpu/tile.h"

// Once for every instruction set that a processor may have, from here to HWY_AFTER_NAMESPACE.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/paint_tile.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

#include "render/cpu/paint_blocks-inl.h"
#include "render/cpu/paint_coloured-inl.h"
#include "render/cpu/paint_cut-inl.h"
#include "render/cpu/paint_shade-inl.h"
#include "render/cpu/paint_visits-inl.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// These paint `blocks`, and return those of them that are saturated then.

template <bool kFitted, bool kThin>
HWY_INLINE BlockMask paintBlocks(const TileWork& work, BlockMask blocks, const Ellipse& e, const Shade& shade,
                                 const float* footprint) {
  BlockMask saturated = 0;
  while (blocks != 0) {
    const int block = takeFirst(blocks);
    if (paintBlock<kFitted, kThin>(e, shade, footprint, work.tile + block * kBlockFloats, cornerOf(block)))
      saturated |= BlockMask{1} << block;
  }
  return saturated;
}

HWY_NOINLINE BlockMask paintPixelByPixel(const TileWork& work, BlockMask blocks, const Ellipse& e,
                                         const Scalar& scalar, const Lit& lit, const float* footprint) {
  return paintLookedUpBlocks(work, blocks, lit, [&](Corner corner, LookedUp& out) HWY_ATTR {
    return lookUpBlock(e, scalar, {work.table, footprint}, corner, out);
  });
}

/// From `begin` to `end` over piece n.
HWY_INLINE Along along(const Pieces& pieces, size_t n, const Scalar& scalar, float begin, float end) {
  const float from = pieces.from.at[n];
  const float per_t = (end - begin) / (pieces.to.at[n] - from);
  return {begin - from * per_t, per_t * scalar.tp, per_t * scalar.tq};
}

HWY_NOINLINE BlockMask paintPolyline(const TileWork& work, BlockMask blocks, const Ellipse& e,
                                     const Polyline& line, const Along& s, const float* footprint) {
  BlockMask saturated = 0;
  while (blocks != 0) {
    const int block = takeFirst(blocks);
    if (paintBlock(e, line, s, footprint, work.tile + block * kBlockFloats, cornerOf(block)))
      saturated |= BlockMask{1} << block;
  }
  return saturated;
}

/// Polylines of splats that are painted in several calls.
class Lines {
 public:
  explicit Lines(size_t splats) : places_(splats, kUnknown) {}

  /// Of splat `index`; null where none is good enough. Valid until the next call.
  HWY_INLINE const Polyline* of(size_t index, const TileWork& work, const Visit& visit) {
    if (places_[index] == kUnknown) {
      Polyline line;
      places_[index] = fit(work, visit, line) ? static_cast<int32_t>(lines_.size()) : kNone;
      if (places_[index] != kNone) lines_.push_back(line);
    }
    return places_[index] == kNone ? nullptr : &lines_[static_cast<size_t>(places_[index])];
  }

  HWY_INLINE static bool fit(const TileWork& work, const Visit& visit, Polyline& line) {
    if (!fitPolyline(work.table, visit.all.pieces, visit.n, line)) return false;
    if (work.shading.lit) line.light(visit.all.lit(work, visit.n));
    return true;
  }

 private:
  static constexpr int32_t kUnknown = -1, kNone = -2;

  std::vector<int32_t> places_;  // [splat] in lines_
  std::vector<Polyline> lines_;
};

/// Where what is made for a splat is kept for its next call; null: nowhere.
struct Kept {
  Lines* lines = nullptr;
  size_t index = 0;
};

/// `several`: the splat touches more than one block, be they open or not: how a block is painted must not depend on others,
/// of which another process may know.
HWY_INLINE BlockMask paintVisit(const TileWork& work, BlockMask blocks, bool several, const Visit& visit,
                                const float* footprint, const Kept& kept) {
  const auto& [visits, fits, n] = visit;
  const Ellipse e = visit.ellipse();
  // A skewed footprint may be a tenth higher than F(0).
  const bool thin = e.amplitude * kPeak * fits.most.at[n] < (e.skewed ? 0.3f : 0.34f);
  if (visit.fit() == kConstant) {
    const Shade shade = shadeOf(fits, n);
    if (thin) return paintBlocks<false, true>(work, blocks, e, shade, footprint);
    return paintBlocks<false, false>(work, blocks, e, shade, footprint);
  }
  const Scalar scalar = visit.scalar();
  if (visit.fit() == kParabola) {
    Shade shade = shadeOf(fits, n);
    shade.s = along(visits.pieces, n, scalar, -1, 1);
    if (thin) return paintBlocks<true, true>(work, blocks, e, shade, footprint);
    return paintBlocks<true, false>(work, blocks, e, shade, footprint);
  }
  // A polyline's error is a 25th of a parabola's or so, where it does not fall much faster; and it is as much
  // work as a block looked up.
  if (fits.excess.at[n] < 25 && several) {
    Polyline own;
    const Polyline* const line = kept.lines                     ? kept.lines->of(kept.index, work, visit)
                                 : Lines::fit(work, visit, own) ? &own
                                                                : nullptr;
    if (line)
      return paintPolyline(work, blocks, e, *line, along(visits.pieces, n, scalar, 0, Polyline::kParts),
                           footprint);
  }
  return paintPixelByPixel(work, blocks, e, scalar, visits.lit(work, n), footprint);
}

/// Sixteen splats, prepared.
struct Prepared {
  Visits visits;
  Fits fits{};
  ColourVisits colours;
  IntRow numbers;  // of the tile's splats
  size_t count;

  /// Those of work.order from `begin` on.
  HWY_INLINE void prepare(const TileWork& work, size_t begin) {
    count = std::min(kLanes, work.order.size() - begin);
    // The next sixteen come from anywhere in the batch.
    const size_t end = std::min(begin + 2 * kLanes, work.order.size());
    for (size_t n = begin + count; n < end; ++n) hwy::Prefetch(&work.splats[work.order[n]]);
    for (size_t n = 0; n < kLanes; ++n)
      numbers.at[n] = static_cast<int32_t>(work.order[begin + std::min(n, count - 1)]);
    setUp(work, numbers, visits);
    if (work.shading.per_pixel) {
      fitPieces(work.table, visits.pieces, count, fits);
      if (!work.colours) fitNearSides(work.table, visits, count, fits);
    } else {
      fitMeans(work.table, visits.pieces, count, fits);
    }
    if (work.colours)
      setUpColours(work, numbers, visits, fits, count, colours);
    else if (work.shading.lit)
      fits.light(visits.diffuse, visits.specular);
  }

  /// The blocks that splat n may touch; none if it can be left out.
  HWY_INLINE BlockMask touched(size_t n) const {
    return fits.fit.at[n] == kNothing ? 0 : blocksOf(visits, n);
  }

  /// Paints splat n in `blocks`, some of those touched; returns those of them that are saturated then.
  HWY_INLINE BlockMask paint(const TileWork& work, BlockMask blocks, BlockMask touched, size_t n,
                             const float* footprint, const Kept& kept = {}) const {
    const auto number = static_cast<size_t>(numbers.at[n]);
    if (work.colours) return paintColoured(work, blocks, {visits, fits, colours, n}, number, footprint);
    const Visit visit{visits, fits, n};
    if (visits.cut.at[n] != 0) return paintCut(work, blocks, visit, number, footprint);
    return paintVisit(work, blocks, std::popcount(touched) > 1, visit, footprint, kept);
  }
};

BlockMask paintInOrder(const TileWork& work) {
  const float* footprint = footprintPolynomial();
  BlockMask open = work.open;
  Prepared prepared;
  for (size_t begin = 0; begin < work.order.size() && open != 0; begin += kLanes) {
    prepared.prepare(work, begin);
    for (size_t n = 0; n < prepared.count; ++n) {
      const BlockMask touched = prepared.touched(n), blocks = touched & open;
      if (blocks != 0) open &= ~prepared.paint(work, blocks, touched, n, footprint);
    }
  }
  return open;
}

/// The blocks of an order tile.
BlockMask blocksOfOrderTile(size_t number) {
  constexpr size_t kBlocksAlong = kOrderSide / kBlockSide;
  const size_t row = number / kOrderTilesAlong * kBlocksAlong,
               column = number % kOrderTilesAlong * kBlocksAlong;
  BlockMask blocks = 0;
  for (size_t n = 0; n < kBlocksAlong; ++n)
    blocks |= ((BlockMask{1} << kBlocksAlong) - 1) << ((row + n) * kTileBlocks + column);
  return blocks;
}

/// Each order tile in its own order. Splats are prepared once for all.
BlockMask paintByLists(const TileWork& work) {
  const float* footprint = footprintPolynomial();
  const size_t count = work.order.size(), groups = (count + kLanes - 1) / kLanes;
  const auto prepared = hwy::AllocateAligned<Prepared>(groups);
  if (!prepared) throw std::bad_alloc();
  std::vector<uint8_t> is_prepared(groups);
  std::vector<BlockMask> touched(count);
  Lines lines(count);
  BlockMask open = work.open;
  for (size_t number = 0; number < kOrderTiles; ++number) {
    const BlockMask of_tile = blocksOfOrderTile(number);
    if ((open & of_tile) == 0) continue;
    for (const uint64_t item : (*work.lists)[number]) {
      const auto index = static_cast<uint32_t>(item);
      const size_t of_index = index / kLanes, begin = of_index * kLanes;
      Prepared& group = prepared[of_index];
      if (!is_prepared[of_index]) {
        is_prepared[of_index] = 1;
        group.fits = {};
        group.prepare(work, begin);
        for (size_t n = 0; n < group.count; ++n) touched[begin + n] = group.touched(n);
      }
      const BlockMask blocks = touched[index] & open & of_tile;
      if (blocks == 0) continue;
      open &= ~group.paint(work, blocks, touched[index], index % kLanes, footprint, {&lines, index});
      if ((open & of_tile) == 0) break;
    }
  }
  return open;
}

BlockMask paintTile(const TileWork& work) {
  return work.lists ? paintByLists(work) : paintInOrder(work);
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(paintTile);

BlockMask paintTile(const TileWork& work) {
  return HWY_DYNAMIC_DISPATCH(paintTile)(work);
}

}  // namespace curvisplat
#endif
