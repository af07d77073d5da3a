#include "render/project/projection.h"

#include <algorithm>
#include <cmath>

#include "render/project/footprint.h"
#include "render/project/light.h"
#include "render/project/plane_block.h"
#include "render/project/plane_cuts.h"
#include "render/project/splat_chooser.h"
#include "render/project/splat_pieces.h"
#include "stream/base/error.h"
#include "stream/base/vector_clones.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

constexpr size_t kBlock = 256;  // splats at a time: the arrays between the two loops stay in the L1 cache
static_assert(kBlock <= GrowthBlock::kMaxSplats);

/// The results that the arithmetic loop passes to the loop that chooses.
struct Block {
  float x[kBlock], y[kBlock], depth[kBlock];
  float l11[kBlock], l21[kBlock], l22[kBlock];
  float amplitude[kBlock];
  float slope0[kBlock], slope1[kBlock], half_width[kBlock], along[kBlock];
  float order[kBlock];       // BrickProjector::depths()
  int32_t too_wide[kBlock];  // perspective: to be cut up, or before the near plane
  uint32_t skew[kBlock];     // of splats that are drawn as they are

  Ellipse ellipse(size_t n) const {
    return {l11[n], l21[n], l22[n], amplitude[n], slope0[n], slope1[n], half_width[n], along[n]};
  }
  [[gnu::always_inline]] void set(size_t n, const Ellipse& ellipse) {
    l11[n] = ellipse.l11;
    l21[n] = ellipse.l21;
    l22[n] = ellipse.l22;
    amplitude[n] = ellipse.amplitude;
    slope0[n] = ellipse.slope0;
    slope1[n] = ellipse.slope1;
    half_width[n] = ellipse.half_width;
    along[n] = ellipse.along;
  }
};

ScreenSplat screenSplat(float x, float y, const Ellipse& e, float mean, const PlaneSlope& slope) {
  return {x, y,       e.l11, e.l21, e.l22,   e.amplitude, mean, e.slope0, e.slope1, e.half_width,
          0, e.along, 0,     0,     slope.x, slope.y};
}

CURVISPLAT_VECTOR_CLONES void computeBlock(const OrthographicMap& map,
                                           const GeometryArrays<const float>& geometry,
                                           const VariableArrays<const float>& variable, size_t begin,
                                           size_t count, Block& block) {
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const size_t i = begin + n;
    const float x = geometry.x[i], y = geometry.y[i], z = geometry.z[i];
    block.x[n] = map.x + map.rows.x0 * x + map.rows.y0 * y + map.rows.z0 * z;
    block.y[n] = map.y + map.rows.x1 * x + map.rows.y1 * y + map.rows.z1 * z;
    block.order[n] = block.depth[n] = map.depth.x * x + map.depth.y * y + map.depth.z * z;
    block.too_wide[n] = 0;
    block.set(n, ellipseOf(map.rows, shapeOf(geometry, i), slopeOf(variable, i), variable.variance[i],
                           geometry.weight[i] * map.volume, map.low_pass));
  }
}

CURVISPLAT_VECTOR_CLONES void computeBlock(const PerspectiveMap& map,
                                           const GeometryArrays<const float>& geometry,
                                           const VariableArrays<const float>& variable, size_t begin,
                                           size_t count, Block& block) {
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const size_t i = begin + n;
    const float x = geometry.x[i], y = geometry.y[i], z = geometry.z[i];
    const PerspectiveMap::Centre centre = map.centreOf(x, y, z);
    const Shape shape = shapeOf(geometry, i);
    block.x[n] = map.pixelX(centre);
    block.y[n] = map.pixelY(centre);
    block.depth[n] = centre.distance;
    block.order[n] = map.orderAt(centre, x, y, z);
    block.too_wide[n] = map.tooWide(centre, map.radiusOf(shape));
    block.set(n, ellipseOf(map.rowsAt(centre), shape, slopeOf(variable, i), variable.variance[i],
                           geometry.weight[i] * map.volumeAt(centre), map.low_pass));
  }
}

template <typename Map>
[[gnu::always_inline]] inline void fillPlanes(const Map& map, const GeometryArrays<const float>& geometry,
                                              size_t begin, size_t count, PlaneBlock& planes) {
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const size_t i = begin + n;
    const float x = geometry.x[i], y = geometry.y[i], z = geometry.z[i];
    planes.fill(n, rowsAt(map, x, y, z), map.depthPixels(x, y, z), shapeOf(geometry, i));
  }
}

CURVISPLAT_VECTOR_CLONES void computePlanes(const OrthographicMap& map,
                                            const GeometryArrays<const float>& geometry, size_t begin,
                                            size_t count, PlaneBlock& planes) {
  fillPlanes(map, geometry, begin, count, planes);
}

CURVISPLAT_VECTOR_CLONES void computePlanes(const PerspectiveMap& map,
                                            const GeometryArrays<const float>& geometry, size_t begin,
                                            size_t count, PlaneBlock& planes) {
  fillPlanes(map, geometry, begin, count, planes);
}

/// Computes the skews, as skewOf() has them.
template <typename Map>
void computeSkews(const Map& map, const GeometryArrays<const float>& geometry, size_t begin, size_t count,
                  GrowthBlock& growth, Block& block) {
  if (!growth.fill({geometry.growth_code + begin, count})) {
    std::fill_n(block.skew, count, 0u);
    return;
  }
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const size_t i = begin + n;
    block.skew[n] = growth.skewOf(n, rowsAt(map, geometry.x[i], geometry.y[i], geometry.z[i]),
                                  shapeOf(geometry, i), {block.l11[n], block.l21[n], block.l22[n]});
  }
}

/// The budget that parts and cutting may still use for a brick: pieces that are drawn, and looks at any.
struct CutBudget {
  size_t pieces = BrickProjector::kMaxPieces;
  size_t looks = 16 * BrickProjector::kMaxPieces;
};

struct BrickArrays {
  const GeometryArrays<const float>& geometry;
  const VariableArrays<const float>& variable;
  const VariableArrays<const float>* colours;  // null: of pictures of one scalar
};

/// A cell at a border is drawn as a wider splat that is cut at the face, which gives it the right density; but its scalar
/// stays that of the cell, which does not reach as far into those behind it. `cell`: its ellipse; `x`, `y`: its centre.
void keepScalarOf(const Ellipse& cell, float mean, float x, float y, ScreenSplat& splat, ScreenCut& cut) {
  const float by_y = cell.slope1 / cell.l22, by_x = (cell.slope0 - cell.l21 * by_y) / cell.l11;
  splat.mean = mean + by_x * (splat.x - x) + by_y * (splat.y - y);
  splat.slope0 = splat.l11 * by_x + splat.l21 * by_y;
  splat.slope1 = splat.l22 * by_y;
  splat.half_width = cell.half_width;
  // Painters take the wide splat's optical depth for the cell's, which is this share of it.
  splat.along = cell.along * DepthsLeft::atCentre(cut).share;
  cut.correlation = 0;
}

/// The cuts of the splats of a brick.
struct Cutting {
  const BorderStyle* borders;  // null: cells at borders are drawn as any cell, and clip planes do not cut
  LocalClipPlanes clip;
  LocalLayers layers;
};

/// The projection of one brick by one map.
struct BrickPass {
  const BrickArrays& brick;
  const Cutting& cutting;
  const SlopeRules& rules;
  SplatChooser& chooser;
  ProjectionCounts& counts;
  CutBudget left = {};
  BorderPieces parts = {},
               coloured_parts = {};  // of the splat in hand: clearing them takes as long as filling them
};

/// How one splat is cut.
struct SplatCutting {
  uint32_t border_code = kNoBorder;
  bool clipped = false;  // a clip plane crosses it
  bool layered = false;  // it meets layers, and is drawn as one piece if it is not cut otherwise
  PlaneSlope plane = {};
};

/// Takes splat `i` to the parts and pieces that it is drawn as, and chooses among them: the best fate of any.
/// Nothing if that takes more than what the pass has left, which it counts down.
template <typename Map>
std::optional<SplatChooser::Fate> choosePieces(const Map& map, BrickPass& pass, size_t i,
                                               const SplatCutting& how, const BySlope& by_slope) {
  const BrickArrays& brick = pass.brick;
  const Cutting& cutting = pass.cutting;
  SplatChooser& chooser = pass.chooser;
  CutBudget& left = pass.left;
  const VariableArrays<const float>& variable = brick.variable;
  const InwardAxes inward = inwardAxes(how.border_code);
  const uint32_t layers = layersOf(how.border_code);
  const SplatPiece whole = wholeOf(brick.geometry, variable, i);
  const glm::dvec3 slope(whole.slope.w0, whole.slope.w1, whole.slope.w2);
  if (chooser.transparentThroughout(whole.mean, static_cast<float>(drawnSlope(slope, inward)),
                                    variable.variance[i]))
    return SplatChooser::Fate::kTransparent;
  auto best = SplatChooser::Fate::kOffScreen;
  // A splat that is cut has a record of its own, as any splat; what it takes beyond that counts.
  const size_t least = brick.colours ? 2 : 1;
  const bool has_faces = inward.faces != 0 || layers != 0;
  size_t own = how.clipped || how.layered || has_faces ? least : 0;
  const SplatPiece* part = nullptr;      // that is placed
  const SplatPiece* coloured = nullptr;  // the same, with the scalar of the colours
  bool part_clipped = false;             // a clip plane crosses the part
  const auto take = [&](const SplatPiece& piece, const PlacedPiece& at) {
    if (left.pieces + own == 0) return false;
    Ellipse ellipse = ellipseOf(at.rows, piece.shape, piece.slope, variable.variance[i],
                                piece.weight * at.volume, map.low_pass);
    ellipse.along *= shareOfAlong(at.rows, piece, map.low_pass.footprint_px2);
    LayerSide side = LayerSide::kBefore;
    if (!cutting.layers.empty())
      side = cutting.layers.sideOf(at.x, at.y, ellipse, at.depth, at.depth_row, piece.shape);
    if (side == LayerSide::kBehind) return true;
    ScreenCut cut;
    const Remains remains = cutAtFaces(at.rows, piece, ellipse, map.low_pass.footprint_px2, cut);
    if (remains == Remains::kNothing) return true;
    const bool faces = remains == Remains::kSome, across = side == LayerSide::kAcross;
    const size_t records = least + (faces ? 1u : 0u) + (across ? 1u : 0u);
    if (left.pieces + own < records) return false;
    ScreenSplat splat = screenSplat(at.x, at.y, ellipse, piece.mean, how.plane);
    splat.amplitude *= by_slope.opacity;
    if (piece.growth.count > 0) splat.skew = skewOf(at.rows, piece.growth, ellipse);
    const bool whole_part = piece.position == part->position;  // perspective has not cut it up
    if (faces && whole_part && !across && !part_clipped && !brick.colours) {
      const glm::vec3 back = whole.position - piece.position;
      const float x = at.x + at.rows.x0 * back.x + at.rows.y0 * back.y + at.rows.z0 * back.z;
      const float y = at.y + at.rows.x1 * back.x + at.rows.y1 * back.y + at.rows.z1 * back.z;
      const Ellipse cell = ellipseOf(at.rows, whole.shape, whole.slope, variable.variance[i],
                                     whole.weight * at.volume, map.low_pass);
      keepScalarOf(cell, whole.mean, x, y, splat, cut);
    } else if (faces && !across) {
      splat.along = alongLeft(ellipse, cut);
    }
    ScreenDepth along_ray;
    if (across) {
      along_ray = depthAlongRay(at.rows, at.depth_row, cutting.layers.depthOf(at.depth), piece, ellipse,
                                map.low_pass.footprint_px2);
      along_ray.has_cut = faces;
    }
    ScreenColour colour;
    if (coloured)
      colour = colourOf(map, at, withScalarOf(*coloured, piece), brick.colours->variance[i], faces, across);
    const auto fate = records == 1
                          ? chooser.choose(splat, at.order, by_slope.lit)
                          : chooser.chooseWith({faces ? &cut : nullptr, across ? &along_ray : nullptr,
                                                coloured ? &colour : nullptr},
                                               splat, at.order, by_slope.lit);
    if (fate == SplatChooser::Fate::kKept) {
      left.pieces -= records - own;
      own = 0;
    }
    best = std::max(best, fate);
    return true;
  };
  const auto divide = [&](const SplatPiece& piece, BorderPieces& parts) {
    if (how.border_code != kNoBorder) return partsAtBorder(piece, inward, layers, *cutting.borders, parts);
    parts[0] = piece;
    return size_t{1};
  };
  const size_t count = divide(whole, pass.parts);
  if (brick.colours) divide(wholeOf(brick.geometry, *brick.colours, i), pass.coloured_parts);
  for (size_t n = 0; n < count; ++n) {
    part = &pass.parts[n];
    if (brick.colours) coloured = &pass.coloured_parts[n];
    const int own_faces = pass.parts[n].faces.count;
    if (how.clipped) cutting.clip.addFaces(pass.parts[n]);
    part_clipped = pass.parts[n].faces.count != own_faces;
    if (!place(map, pass.parts[n], left.looks, take)) return {};
  }
  return best;
}

/// False if the range would take more than what the pass has left, which it counts down.
template <typename Map>
bool projectRange(const Map& map, BrickPass& pass, const SplatRange& range) {
  const BrickArrays& brick = pass.brick;
  const Cutting& cutting = pass.cutting;
  ProjectionCounts& counts = pass.counts;
  const GeometryArrays<const float>& geometry = brick.geometry;
  const VariableArrays<const float>& variable = brick.variable;
  Block block;
  GrowthBlock growth;
  PlaneBlock planes;
  std::array<ClipSide, kBlock> sides{};
  for (size_t begin = range.begin; begin < range.end; begin += kBlock) {
    const size_t count = std::min(kBlock, range.end - begin);
    computeBlock(map, geometry, variable, begin, count, block);
    computeSkews(map, geometry, begin, count, growth, block);
    computePlanes(map, geometry, begin, count, planes);
    if (!cutting.clip.empty()) cutting.clip.sidesOf(geometry, begin, count, sides);
    for (size_t n = 0; n < count; ++n) {
      const size_t i = begin + n;
      ++counts.read;
      SplatCutting how{cutting.borders ? geometry.border_code[i] : kNoBorder, sides[n] == ClipSide::kAcross,
                       false, planes.of(n)};
      if (how.clipped && !cutting.borders) {
        if (!cutting.clip.contains({geometry.x[i], geometry.y[i], geometry.z[i]}))
          sides[n] = ClipSide::kOutside;
        how.clipped = false;
      }
      if (sides[n] == ClipSide::kOutside) {
        ++counts.clipped;
        continue;
      }
      bool in_pieces = block.too_wide[n] || how.border_code != kNoBorder || how.clipped;
      if (!cutting.layers.empty() && !in_pieces) {
        const LayerSide side = cutting.layers.sideOf(
            block.x[n], block.y[n], block.ellipse(n), block.depth[n],
            map.depthRow(geometry.x[i], geometry.y[i], geometry.z[i]), shapeOf(geometry, i));
        if (side == LayerSide::kBehind) {
          ++counts.hidden;
          continue;
        }
        in_pieces = how.layered = side == LayerSide::kAcross;
      }
      const BySlope by_slope = pass.rules.of(geometry, variable, i);
      if (!(by_slope.opacity > 0)) {
        ++counts.transparent;
        continue;
      }
      SplatChooser::Fate fate;
      if (in_pieces) {
        const auto best = choosePieces(map, pass, i, how, by_slope);
        if (!best) return false;
        fate = *best;
      } else {
        const Ellipse ellipse = block.ellipse(n);
        ScreenSplat splat = screenSplat(block.x[n], block.y[n], ellipse, variable.mean[i], how.plane);
        splat.amplitude *= by_slope.opacity;
        splat.skew = block.skew[n];
        if (brick.colours) {
          const ScreenColour colour = colourOf(map, geometry, *brick.colours, i);
          fate = pass.chooser.chooseWith({nullptr, nullptr, &colour}, splat, block.order[n], by_slope.lit);
        } else {
          fate = pass.chooser.choose(splat, block.order[n], by_slope.lit);
        }
      }
      counts.off_screen += fate == SplatChooser::Fate::kOffScreen;
      counts.transparent += fate == SplatChooser::Fate::kTransparent;
      counts.drawn += fate == SplatChooser::Fate::kKept;
    }
  }
  return true;
}

}  // namespace

double largestReach(double low_pass_px2) {
  // The slope along L's columns is at most √(x (x + λ)) / (x + ε) times |w|, x the squared extent of the
  // splat on the screen; x below is where that is largest.
  constexpr double kEpsilon = kSlopeLowPass;
  const double farthest =
      std::max(std::sqrt(3.0) * std::abs(kHalfCellStyle.cut.offset / kHalfCellStyle.cut.size), kPartsReach);
  if (low_pass_px2 <= 2 * kEpsilon) return kKernelSupport + farthest;
  const double x = low_pass_px2 * kEpsilon / (low_pass_px2 - 2 * kEpsilon);
  return farthest + kKernelSupport * std::sqrt(x * (x + low_pass_px2)) / (x + kEpsilon);
}

BrickProjector::BrickProjector() {
  splats_.reserve(kMaxSplats);
  depths_.reserve(kMaxSplats);
}

void BrickProjector::project(const ProjectionSettings& settings, const ClassificationTable& table,
                             const glm::dvec3& cell_min, const SplatGeometry& geometry,
                             const SplatVariable& variable) {
  const SplatRange all{0, static_cast<uint32_t>(geometry.size())};
  project(settings, table, cell_min, arraysOf(geometry), arraysOf(variable), {&all, 1});
}

void BrickProjector::project(const ProjectionSettings& settings, const ClassificationTable& table,
                             const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
                             const BrickValues& values, std::span<const SplatRange> ranges) {
  CURVISPLAT_CHECK_OP(geometry.size(), ==, values.scalar.size());
  if (values.colours) CURVISPLAT_CHECK_OP(geometry.size(), ==, values.colours->size());
  for (const SplatRange& range : ranges) CURVISPLAT_CHECK_OP(range.end, <=, geometry.size());
  Cutting cutting{nullptr, LocalClipPlanes(settings.clip_planes, cell_min),
                  LocalLayers(settings.layers, settings.view, cell_min)};
  const BrickArrays brick{geometry, values.scalar, values.colours ? &*values.colours : nullptr};
  SlopeRules rules{{}, settings.gradient.get(), glm::vec3(1.0 / settings.view.scale)};
  if (settings.light) rules.light.emplace(*settings.light, settings.light_g0, settings.view, cell_min);
  if (settings.light && settings.shadows) rules.shadows = settings.shadows->local(cell_min);
  SplatChooser chooser(settings.view, largestReach(settings.view.low_pass_px2),
                       {settings.per_pixel, settings.lit()}, table, {splats_, depths_});
  const auto projectAll = [&](const auto& map) {
    BrickPass pass{brick, cutting, rules, chooser, counts_};
    return std::all_of(ranges.begin(), ranges.end(),
                       [&](const SplatRange& range) { return projectRange(map, pass, range); });
  };
  // Where the near plane is too near for float, coarser is not less: then what was cut until there is drawn.
  constexpr float kCoarsest = 1e30f;
  const auto attempt = [&](const BorderStyle* borders, float coarseness) {
    splats_.clear();
    depths_.clear();
    counts_ = {};
    cutting.borders = borders;
    return settings.view.projection == Projection::kOrthographic
               ? projectAll(OrthographicMap(settings.view, cell_min))
               : projectAll(PerspectiveMap(settings.view, cell_min, coarseness));
  };
  const bool pairs = isOfPairs(settings.borders);
  const BorderStyle& single = pairs ? kWholeCellStyle : settings.borders;
  bool complete = pairs && attempt(&settings.borders, 1);
  // Beyond a few hundred it is for splats that are in no grid.
  for (float coarseness = 1; !complete && coarseness < kCoarsest; coarseness *= coarseness < 256 ? 2 : 16)
    complete = attempt(coarseness == 1 ? &single : nullptr, coarseness);
  counts_.pieces = splats_.size();
}

void BrickProjector::keepTouching(const TileSet& tiles) {
  size_t kept = 0, first_record = 0;  // the records of a splat come before it
  for (size_t n = 0; n < splats_.size(); ++n) {
    const ScreenSplat& splat = splats_[n];
    if (isRecord(splat)) continue;
    if (tiles.touches(footprintBox(splat)))
      for (size_t from = first_record; from <= n; ++from, ++kept) {
        splats_[kept] = splats_[from];
        depths_[kept] = depths_[from];
      }
    first_record = n + 1;
  }
  splats_.resize(kept);
  depths_.resize(kept);
}

}  // namespace curvisplat
