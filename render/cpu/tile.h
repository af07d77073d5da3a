// A tile of the picture, as the processor's painter keeps it in memory, and what it is painted with. A
// picture is square tiles, row by row; each fits in a core's first-level cache. One thread at a time
// paints a block, and mostly all of the tile.
//
//   tile    8 x 8 blocks in rows           16 KiB
//   block   4 x 4 pixels                   256 bytes, 4 cache lines
//   in it   red [16], green [16], blue [16] (premultiplied), transmittance [16], each in rows of 4
//
// Splats come nearest first, and each is blended under those before it. A block is saturated, and takes no
// more splats, once the largest transmittance T of its pixels is below kSaturated. The remaining splats
// could have added at most T times a colour or an opacity in 0..1 to a pixel: less than 1/4096, a sixteenth
// of an 8-bit step, so the picture differs from the complete one by 72 dB or more. Whether a block is
// saturated after a given splat does not depend on how splats were batched, so the bits of the picture do
// not either.
//
// A block is one vector of 16 floats a channel, or a few narrower ones: no vector is ever partly filled or
// unaligned, and a small splat touches few.
//
// A tile is painted with two tables: ShadingTable, which classifies pixels, and footprintPolynomial().
// paintTile() may paint different tiles, and different blocks of a tile, on any threads at a time.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/painter.h"
#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"
#include "render/tiles/tile_queues.h"

namespace curvisplat {

/// A classification table as the CPU's painter reads it: what one look-up needs lies in one place, and how
/// far the mean over an interval is from a straight line or a parabola is bounded by two look-ups.
///
/// With f the table's density (a value a cell), the mean over an interval of width 2w, as the interval
/// moves, is the box filter of the line through the cells' values. Its second derivative is the second
/// differences of f, spread over 2w. Over a move by h the parabola through both ends and the middle is off
/// by at most (Peano's kernels, evaluated)
///
///     0.097 h m sum of |second differences|,   0.0189 h² m sum of |third differences|,   m = min(1, h/2w)
///
/// with the sums over the cells that the interval passes over. (What a table of cells leaves open, ripples
/// of an eighth of a cell's step, does not count.)
///
/// Takes 160 KiB and 0.1 ms to build. Immutable.
class ShadingTable {
 public:
  /// Colour times extinction, and extinction.
  struct alignas(16) Value {
    float of[4];
  };
  struct Cell {
    Value start;    // the integral up to where the cell begins
    Value density;  // in the cell
  };
  /// Summed up to the cell's beginning; of each cell the largest component counts.
  struct Bend {
    float second, third;  // |differences|
  };

  explicit ShadingTable(const ClassificationTable& table);

  bool logScale() const { return log_scale_; }
  float scale() const { return scale_; }
  float bias() const { return bias_; }
  float mostExtinction() const { return most_extinction_; }

  /// [kCells + 3]: all below the table, its cells, all above it, and where that would end. An x in cells is
  /// in element floor(x + 1), at the most kCells + 1; its start lies at x = element - 1.
  const Cell* cells() const { return cells_.data(); }
  const Bend* bends() const { return bends_.data(); }

 private:
  bool log_scale_;
  float scale_, bias_, most_extinction_ = 0;
  std::vector<Cell> cells_;
  std::vector<Bend> bends_;
};

inline constexpr int kBlockSide = 4;
inline constexpr int kBlockPixels = kBlockSide * kBlockSide;
inline constexpr int kBlockFloats = 4 * kBlockPixels;
inline constexpr int kTileBlocks = kTileSide / kBlockSide;  // along a side
inline constexpr int kTileFloats = 4 * kTileSide * kTileSide;

// A splat's mean extinction, and colour times extinction, are looked up for every pixel, unless a constant, a parabola
// or, where a splat has many pixels in the tile, fifteen lines over the splat, as far as it is in the tile, are known to
// differ by less than this part of the largest extinction there (which changes the opacity of all splats together by less
// than e^-1 / 256), or by less than this optical depth. A flat splat, which has one colour throughout, is a constant.
inline constexpr float kRelativeError = 1.0f / 256;
inline constexpr float kDepthError = 2e-5f;

inline constexpr float kSaturated = 1.0f / 4096;

/// Bit kTileBlocks * row + column: a block.
using BlockMask = uint64_t;
static_assert(kTileBlocks * kTileBlocks == 64);

/// The layers of a tile's pixels, and the windows behind the first (tile_windows.h).
struct TileWindows {
  int layers;     // the most of any pixel
  float* depths;  // [layers][pixels of the tile, block by block]; infinite where a pixel has fewer
  float* behind;  // [windows - 1][kTileFloats]
  std::array<uint8_t, 64> open;  // of each block: how many windows, from the first, take more
};

/// The bytes that a thread may keep of prepared splats, of up to 600 bytes each. A wake of 2.3 M splats
/// took 1.5 times the processor time with 1 MiB, 1.1 times with 2, and with 4 what it takes without a bound.
inline constexpr uint64_t kMinPreparedBytes = uint64_t{1} << 19, kMaxPreparedBytes = uint64_t{4} << 20;

/// Splats to be painted under what a tile holds.
struct TileWork {
  float* tile;                          // [kTileFloats], on a cache line
  int x, y;                             // of its first pixel
  BlockMask open;                       // the blocks that are not saturated; has one at least
  std::span<const ScreenSplat> splats;  // one that is cut behind its records
  std::span<const uint32_t> order;      // of `splats`, nearest first
  const std::array<OrderList, kOrderTiles>*
      lists;  // of `order`, in that of each order tile; null: in its own
  const ShadingTable& table;
  const ShadingTable* colours;  // of pictures of two scalars; else null
  PixelShading shading;
  TileWindows* windows = nullptr;  // null: no layers, and no splats with a ScreenDepth
  // The bytes that may be kept of prepared splats: when they take more they are forgotten, and prepared again
  // for other blocks.
  uint64_t prepared_bytes = kMaxPreparedBytes;
};

/// Paints in the widest vectors that the processor has, and returns the blocks that are open then. Pure but
/// for the tile. Every pixel's arithmetic is the same in all vectors: the bits are too, where there are
/// fused multiply-adds.
BlockMask paintTile(const TileWork& work);

/// Coefficients of x^n: F(rho) / x², x = 1 - (rho / support)², to within 2e-4 of F.
inline constexpr int kFootprintTerms = 9;
const float* footprintPolynomial();  // [kFootprintTerms]

}  // namespace curvisplat
