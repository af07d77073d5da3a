#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <new>
#include <vector>

#include "render/cpu/tile.h"
#include "stream/base/threads.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
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

/// A splat of one colour, or one parabola, with all that its blocks need: two cache lines.
struct alignas(64) Plain {
  Ellipse e;
  Shade shade;
  bool fitted;
};
static_assert(sizeof(Plain) == 128);

/// A splat with lines.
struct alignas(64) Lined {
  Ellipse e;
  Along s;
  Lines lines;
};

HWY_INLINE void blendPlain(const Plain& plain, const float* footprint, Corner corner, BlockColours& colours) {
  blendOver(plain.e, footprint, corner, plain.shade, plain.fitted, colours);
}

HWY_INLINE void blendLined(const Lined& lined, const float* footprint, Corner corner, BlockColours& colours) {
  blendOver(lined.e, footprint, corner, lined.s, lined.lines, colours);
}

// These paint `blocks`, and return those of them that are saturated then.

HWY_NOINLINE BlockMask paintPixelByPixel(const TileWork& work, BlockMask blocks, const Ellipse& e,
                                         const Scalar& scalar, const Lit& lit, const float* footprint) {
  return paintLookedUpBlocks(work, blocks, lit, [&](int block, LookedUp& out) HWY_ATTR {
    return lookUpBlock(e, scalar, {work.table, footprint}, cornerOf(block), out);
  });
}

HWY_INLINE bool isPlain(const Visit& visit) {
  return visit.fit() == kConstant || visit.fit() == kParabola;
}

/// Writes it where it is to be: copying what has just been written in parts would wait for that.
HWY_INLINE void makePlain(const Visit& visit, Plain* place) {
  const auto& [visits, fits, n] = visit;
  Plain& plain = *new (place) Plain{visit.ellipse(), shadeOf(fits, n), visit.fit() == kParabola};
  if (plain.fitted) plain.shade.s = along(visits.pieces, n, visit.scalar(), -1, 1);
}

/// Whether lines do for the splat: then they are at `place`.
HWY_INLINE bool makeLined(const TileWork& work, const Visit& visit, Lined& place) {
  if (!mayHaveLines(visit) || !fitLines(work, visit, place.lines)) return false;
  place.e = visit.ellipse();
  place.s = alongLines(visit);
  return true;
}

HWY_INLINE BlockMask paintVisit(const TileWork& work, BlockMask blocks, const Visit& visit,
                                const float* footprint) {
  if (isPlain(visit)) {
    alignas(Plain) std::byte place[sizeof(Plain)];
    auto* const plain = reinterpret_cast<Plain*>(place);
    makePlain(visit, plain);
    return blendBlocks(work, blocks, [&](int block, BlockColours& colours) HWY_ATTR {
      blendPlain(*plain, footprint, cornerOf(block), colours);
    });
  }
  if (Lined lined; makeLined(work, visit, lined))
    return blendBlocks(work, blocks, [&](int block, BlockColours& colours) HWY_ATTR {
      blendLined(lined, footprint, cornerOf(block), colours);
    });
  return paintPixelByPixel(work, blocks, visit.ellipse(), visit.scalar(), visit.all.lit(work, visit.n),
                           footprint);
}

/// Sixteen splats, prepared.
struct Prepared {
  Visits visits;
  Fits fits{};
  ColourVisits colours;
  IntRow numbers;  // of the tile's splats
  size_t count;

  /// Prepares the splats of work.order from `begin` on.
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

  /// Whether splat n can be left out.
  HWY_INLINE bool isNothing(size_t n) const { return fits.fit.at[n] == kNothing; }

  /// Paints splat n in `blocks`, some of those touched; returns those of them that are saturated then.
  HWY_INLINE BlockMask paint(const TileWork& work, BlockMask blocks, size_t n, const float* footprint) const {
    const auto number = static_cast<size_t>(numbers.at[n]);
    if (work.colours) return paintColoured(work, blocks, {visits, fits, colours, n}, number, footprint);
    const Visit visit{visits, fits, n};
    if (visits.cut.at[n] != 0) return paintCut(work, blocks, visit, number, footprint);
    return paintVisit(work, blocks, visit, footprint);
  }
};

BlockMask paintInOrder(const TileWork& work) {
  const float* footprint = footprintPolynomial();
  const TileCorner corner{static_cast<float>(work.x), static_cast<float>(work.y)};
  BlockMask open = work.open;
  Prepared prepared;
  for (size_t begin = 0; begin < work.order.size() && open != 0; begin += kLanes) {
    prepared.prepare(work, begin);
    for (size_t n = 0; n < prepared.count; ++n) {
      if (prepared.isNothing(n)) continue;
      const ScreenSplat& splat = work.splats[static_cast<size_t>(prepared.numbers.at[n])];
      const BlockMask blocks = open & orderTilesOf(corner, splat);
      if (blocks != 0) open &= ~prepared.paint(work, blocks, n, footprint);
    }
  }
  return open;
}

/// Splats that are painted one block at a time, by the lists of the blocks. Each is prepared when it is first needed, with
/// its fifteen neighbours, and kept until forget(). Each thread has one for all its tiles: memory that is freed and taken
/// again costs a fault a page.
class Listed {
 public:
  /// Begins with the splats of a tile; `work` must stay until they are painted.
  void begin(const TileWork& work) {
    work_ = &work;
    places_.resize(work.order.size());
    forget();
  }

  /// Paints a part of an order tile's list in its block. Whether that is saturated then. Some are looked up before the
  /// first of them is blended: what was written as many narrow vectors is not ready at once to be read as a wide one.
  HWY_INLINE bool paint(const OrderList& list, int block) {
    const Corner corner = cornerOf(block);
    float* const at = work_->tile + block * kBlockFloats;
    BlockColours colours(at);
    bool found[kAtOnce], saturated = false;
    lookAhead(list, 0);
    for (size_t begin = 0; begin < list.size() && !saturated; begin += kAtOnce) {
      lookAhead(list, begin + kAtOnce);
      const OrderList some = list.subspan(begin, std::min(kAtOnce, list.size() - begin));
      for (size_t n = 0; n < some.size(); ++n) {
        const uint32_t number = numberOf(some[n]);
        if (places_[number].way == kUnknown) prepare(number / kLanes);
        const auto [way, place] = places_[number];
        if (way == kPixels)
          found[n] = lookUpBlock(pixelwise_[place].e, pixelwise_[place].scalar, {work_->table, footprint_},
                                 corner, looked_up_[n]);
        else if (way == kCutPixels)
          found[n] = lookUpCut(*work_, cuts_[place], footprint_, block, looked_up_[n]);
      }
      for (size_t n = 0; n < some.size() && !saturated; ++n) {
        const auto [way, place] = places_[numberOf(some[n])];
        switch (way) {
          case kPlain:
            blendPlain(plains_[place], footprint_, corner, colours);
            break;
          case kLines:
            blendLined(lined_[place], footprint_, corner, colours);
            break;
          case kPixels:
            if (found[n]) blendLookedUp(looked_up_[n], pixelwise_[place].lit, colours);
            break;
          case kCutPixels:
            if (found[n]) blendLookedUp(looked_up_[n], cuts_[place].lit, colours);
            break;
          case kCut:
            blendFitted(cuts_[place], footprint_, block, colours);
            break;
          case kCutLines:
            blendLines(lined_cuts_[place].cut, lined_cuts_[place].lines, footprint_, block, colours);
            break;
          case kWindowed:
          case kColoured:
            colours.store(at);
            saturated = paintOther(way, place, block);
            colours.load(at);
            continue;
          default:
            continue;
        }
        saturated = colours.areSaturated();
      }
    }
    colours.store(at);
    return saturated;
  }

  uint64_t preparedBytes() const {
    return plains_.size() * sizeof(Plain) + pixelwise_.size() * sizeof(PixelwiseSplat) +
           lined_.size() * sizeof(Lined) + cuts_.size() * sizeof(CutSplat) +
           lined_cuts_.size() * sizeof(LinedCut) + coloured_.size() * sizeof(Prepared);
  }

  void forget() {
    std::fill(places_.begin(), places_.end(), Place{});
    plains_.clear();
    lined_.clear();
    pixelwise_.clear();
    cuts_.clear();
    lined_cuts_.clear();
    coloured_.clear();
  }

 private:
  static constexpr size_t kAtOnce = 8;
  enum Way : uint32_t {
    kUnknown,
    kPlain,
    kLines,
    kPixels,
    kCut,
    kCutLines,
    kCutPixels,
    kWindowed,
    kColoured,
    kNoWay
  };
  /// The place of a splat's preparation: `at` counts in the vector of its way; of kColoured, in lanes of
  /// coloured_.
  struct Place {
    Way way = kUnknown;
    uint32_t at = 0;
  };
  struct alignas(64) PixelwiseSplat {
    Ellipse e;
    Scalar scalar;
    Lit lit;
  };
  struct alignas(64) LinedCut {
    CutSplat cut;
    Lines lines;
  };

  template <typename Prepared>
  static HWY_INLINE void prefetchAll(const Prepared& prepared) {
    const auto* const at = reinterpret_cast<const std::byte*>(&prepared);
    for (size_t line = 0; line < sizeof(Prepared); line += 64) hwy::Prefetch(at + line);
  }
  HWY_INLINE void prefetch(Place place) const {
    if (place.way == kPlain)
      prefetchAll(plains_[place.at]);
    else if (place.way == kPixels)
      prefetchAll(pixelwise_[place.at]);
    else if (place.way == kLines)
      prefetchAll(lined_[place.at]);
    else if (place.way == kCutPixels || place.way == kCut || place.way == kWindowed)
      prefetchAll(cuts_[place.at]);
    else if (place.way == kCutLines)
      prefetchAll(lined_cuts_[place.at]);
  }
  /// Fetches what is prepared of the next splats from `begin` on, and the places of those behind them. Blocks
  /// need splats in orders of their own, from more memory than a core's nearest cache holds.
  HWY_INLINE void lookAhead(const OrderList& list, size_t begin) const {
    const size_t end = std::min(begin + kAtOnce, list.size()), last = std::min(end + kAtOnce, list.size());
    for (size_t n = begin; n < end; ++n) prefetch(places_[numberOf(list[n])]);
    for (size_t n = end; n < last; ++n) hwy::Prefetch(&places_[numberOf(list[n])]);
  }
  HWY_NOINLINE bool paintOther(Way way, uint32_t place, int block) {
    if (way == kWindowed) return paintWindowed(*work_, cuts_[place], footprint_, block);
    const Prepared& group = coloured_[place / kLanes];
    return group.paint(*work_, BlockMask{1} << block, place % kLanes, footprint_) != 0;
  }

  HWY_NOINLINE void prepare(size_t number) {
    const size_t begin = number * kLanes;
    Prepared& group = work_->colours ? coloured_.emplace_back() : group_;
    group.prepare(*work_, begin);
    for (size_t n = 0; n < group.count; ++n) {
      const Visit visit{group.visits, group.fits, n};
      places_[begin + n] =
          group.isNothing(n) ? Place{kNoWay} : make(visit, static_cast<size_t>(group.numbers.at[n]));
    }
  }

  /// `splat`: in the splats of the tile.
  HWY_INLINE Place make(const Visit& visit, size_t splat) {
    const auto last = [](const auto& prepared) { return static_cast<uint32_t>(prepared.size() - 1); };
    if (work_->colours)
      return {kColoured, last(coloured_) * uint32_t{kLanes} + static_cast<uint32_t>(visit.n)};
    if (visit.all.cut.at[visit.n] != 0) {
      CutSplat& cut = cuts_.emplace_back();
      makeCut(*work_, visit, splat, cut);
      if (cut.windowed) return {kWindowed, last(cuts_)};
      if (cut.fit != kOther) return {kCut, last(cuts_)};
      if (!mayHaveLines(visit, cut)) return {kCutPixels, last(cuts_)};
      if (!fitLines(*work_, visit, lined_cuts_.emplace_back().lines)) {
        lined_cuts_.pop_back();
        return {kCutPixels, last(cuts_)};
      }
      cut.shade.whole.s = alongLines(visit);
      lined_cuts_.back().cut = cut;
      cuts_.pop_back();
      return {kCutLines, last(lined_cuts_)};
    }
    if (isPlain(visit)) {
      makePlain(visit, &plains_.emplace_back());
      return {kPlain, last(plains_)};
    }
    if (makeLined(*work_, visit, lined_.emplace_back())) return {kLines, last(lined_)};
    lined_.pop_back();
    pixelwise_.push_back({visit.ellipse(), visit.scalar(), visit.all.lit(*work_, visit.n)});
    return {kPixels, last(pixelwise_)};
  }

  const TileWork* work_ = nullptr;
  const float* const footprint_ = footprintPolynomial();
  Prepared group_;
  LookedUp looked_up_[kAtOnce];
  std::vector<Place> places_;  // [splat]
  std::vector<Plain> plains_;
  std::vector<Lined> lined_;
  std::vector<PixelwiseSplat> pixelwise_;
  std::vector<CutSplat> cuts_;
  std::vector<LinedCut> lined_cuts_;
  std::vector<Prepared> coloured_;  // in pictures of two scalars
};

static_assert(kOrderSide == kBlockSide);  // blocks are the order tiles, and have their numbers

/// Each block in its own order. They advance together, by steps of depth: neighbours then need the same splats at about
/// the same time, and what is prepared of a splat can be forgotten when there is much of it.
BlockMask paintByLists(const TileWork& work) {
  constexpr size_t kStep = 64;  // splats of the longest list
  const auto& lists = *work.lists;
  const OrderList longest = *std::max_element(
      lists.begin(), lists.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
  static const PerThread<Listed> of_threads;
  Listed& listed = of_threads.own();
  listed.begin(work);
  size_t painted[kOrderTiles] = {};  // of each list
  BlockMask open = work.open;
  for (size_t step = kStep; open != 0; step += kStep) {
    const bool last = step >= longest.size();
    const uint32_t end = last ? 0 : keyOf(longest[step]);
    for (BlockMask left = open; left != 0;) {
      const int block = takeFirst(left);
      const OrderList rest = lists[static_cast<size_t>(block)].subspan(painted[block]);
      size_t count = last ? rest.size() : 0;
      while (!last && count < rest.size() && keyOf(rest[count]) < end) ++count;
      if (listed.paint(rest.first(count), block)) open &= ~(BlockMask{1} << block);
      painted[block] += count;
      if (listed.preparedBytes() > work.prepared_bytes) listed.forget();
    }
    if (last) break;
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
