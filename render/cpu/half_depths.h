// Takes the pixels of a tile towards half of their opacity, splat by splat from the nearest: their optical depth is
// summed until it is what half of the opacity needs. In vectors, in double precision.
//
// In place of what comes through, which would take an exponential for every pixel of a splat, the optical depth itself
// is summed: half of the opacity a is reached at -ln(1 - a/2).
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "render/colour/classification.h"
#include "render/project/footprint.h"
#include "render/project/screen_splat.h"
#include "render/project/tile_set.h"

namespace curvisplat {

/// The extinction of ClassificationTable::mean() alone. Immutable; any thread.
class MeanExtinction {
 public:
  explicit MeanExtinction(const ClassificationTable& table);

  /// The scalar in cells of the table. Monotonic.
  double inCells(double scalar) const;
  bool isLinear() const { return !log_scale_; }
  double scale() const { return scale_; }
  double bias() const { return bias_; }
  /// The integral up to x cells is begin(c) + slope(c) (x - max(c, 0)), with c the floor of x, from -1 to kCells.
  const double* begins() const { return begins_.data() + 1; }
  const double* slopes() const { return slopes_.data() + 1; }

 private:
  bool log_scale_;
  double scale_, bias_;
  std::vector<double> begins_, slopes_;  // [kCells + 2], from -1 on
};

/// The pixels of a tile, in rows.
struct HalfTile {
  static constexpr size_t kPixels = size_t{kTileSide} * kTileSide;
  static constexpr double kFound = std::numeric_limits<double>::infinity();

  alignas(64) std::array<double, kPixels> depth{};  // optical, so far
  alignas(
      64) std::array<double, kPixels> target{};  // that of half of the opacity; kFound: nothing is looked for
  alignas(64) std::array<double, kPixels> next_layer{};  // its distance; infinite: none
};

/// A splat, unpacked (screen_splat.h).
struct HalfSplat {
  double x, y, per_l11, l21, per_l22;
  double amplitude;  // positive
  double mean, slope0, slope1, half_width;
  ScreenDepth depth;
  const ScreenCut* cut;       // or null
  const FootprintSkew* skew;  // or null
};

/// Gets the events at pixels of the tile.
class HalfEvents {
 public:
  virtual ~HalfEvents() = default;
  /// The splat lies at `distance` there, behind the next layer.
  virtual void passLayers(size_t pixel, double distance) = 0;
  /// The splat took the pixel over its target, after `part` of its optical depth there.
  virtual void reach(size_t pixel, double part) = 0;
};

/// Pixels of the picture: the tile's first, and those that the splat may touch, the last included.
struct HalfBox {
  int tile_x, tile_y, x0, y0, x1, y1;
};

/// Adds a splat to the pixels in the box that are not found. Calls `events` first for layers, then for targets. The same
/// bits for any threads.
void addToHalf(const HalfSplat& splat, const HalfBox& box, const MeanExtinction& extinction, HalfTile& tile,
               HalfEvents& events);

}  // namespace curvisplat
