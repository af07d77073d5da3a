#include "render/export/iso_cells.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "render/project/tile_set.h"
#include "render/surface/iso_field.h"

namespace curvisplat {
namespace {

constexpr uint32_t kSide = kTileSide;
constexpr uint32_t kBlock = 4,
                   kBlocks = kSide / kBlock + 1;  // of columns; the last has those of the next tile
constexpr uint32_t kColumns = kBlocks * kBlock;
constexpr float kMinWeight = 0.02f, kMinInside = 0.15f;  // as along rays (iso_rays.cpp)
constexpr int kMoves = 3;

/// The planes that splats of a tile may reach.
struct Planes {
  uint32_t begin = 0, end = 0;

  uint32_t count() const { return end - begin; }
};

Planes planesOf(std::span<const IsoSplats::Placed> splats, const IsoLattice& lattice) {
  double near = INFINITY, far = -INFINITY;
  for (const IsoSplats::Placed& placed : splats) {
    const double begin = double{placed.splat->near};
    near = std::min(near, begin);
    far = std::max(far, 2 * placed.splat->centre.z - begin);
  }
  if (!(near <= far)) return {};
  const double last = lattice.size[2];
  return {static_cast<uint32_t>(std::clamp(std::floor(near / lattice.spacing) - 1, 0.0, last)),
          static_cast<uint32_t>(std::clamp(std::ceil(far / lattice.spacing) + 2, 0.0, last))};
}

struct Corner {
  uint32_t x, y;
};
/// A tile's first column.
Corner cornerOf(size_t tile, const IsoLattice& lattice) {
  const size_t columns = (lattice.size[0] + kSide - 1) / kSide;
  return {static_cast<uint32_t>(tile % columns) * kSide, static_cast<uint32_t>(tile / columns) * kSide};
}

/// The most splats that touch a block of columns and the ones after them.
size_t mostOfBlocks(std::span<const IsoSplats::Placed> splats, const Corner& corner) {
  std::array<size_t, size_t{kBlocks} * kBlocks> counts{};
  const auto blockAt = [](float place, uint32_t begin) {
    return static_cast<size_t>(
        std::clamp((place - static_cast<float>(begin)) / kBlock, 0.0f, static_cast<float>(kBlocks) - 0.5f));
  };
  for (const IsoSplats::Placed& placed : splats) {
    const IsoSplat& s = *placed.splat;
    for (size_t row = blockAt(s.y0 - kBlock - 1, corner.y); row <= blockAt(s.y1, corner.y); ++row)
      for (size_t column = blockAt(s.x0 - kBlock - 1, corner.x); column <= blockAt(s.x1, corner.x); ++column)
        ++counts[row * kBlocks + column];
  }
  return *std::max_element(counts.begin(), counts.end());
}

class TileOfCells {
 public:
  TileOfCells(const IsoSplats& splats, size_t tile, const IsoLattice& lattice)
      : splats_(splats),
        lattice_(lattice),
        in_tile_(splats.inTile(tile)),
        planes_(planesOf(in_tile_, lattice)) {
    const Corner corner = cornerOf(tile, lattice);
    x0_ = corner.x;
    y0_ = corner.y;
    const size_t most = mostOfBlocks(in_tile_, corner);
    crossed_.reserve(most);
    active_.reserve(most);
  }

  IsoCells find() {
    if (planes_.count() < 2) return {};
    values_.assign(size_t{kColumns} * kColumns * planes_.count(), std::numeric_limits<float>::quiet_NaN());
    for (uint32_t y = 0; y < kColumns; y += kBlock)
      for (uint32_t x = 0; x < kColumns; x += kBlock) sample(x, y);
    for (uint32_t y = 0; y < kSide; y += kBlock)
      for (uint32_t x = 0; x < kSide; x += kBlock) findVertices(x, y);
    for (uint32_t y = 0; y < kSide; ++y)
      for (uint32_t x = 0; x < kSide; ++x)
        for (uint32_t k = planes_.begin; k < planes_.end; ++k) findQuads({x, y, k});
    return std::move(out_);
  }

 private:
  struct Point {
    uint32_t x, y, k;  // columns of the tile, a plane
  };

  /// Whether the lattice has the columns around it.
  bool isCell(uint32_t x, uint32_t y) const {
    return x0_ + x + 1 < lattice_.size[0] && y0_ + y + 1 < lattice_.size[1];
  }
  float& at(const Point& p) {
    return values_[(size_t{p.y} * kColumns + p.x) * planes_.count() + (p.k - planes_.begin)];
  }
  double acrossOf(double pixel, int extent) const { return (pixel + 0.5 - 0.5 * extent) * lattice_.spacing; }
  double acrossX(double x) const { return acrossOf(x, splats_.settings().view.size.width); }
  double acrossY(double y) const { return acrossOf(y, splats_.settings().view.size.height); }

  /// The field at the points of sixteen columns. The same fan whichever tile it is for.
  void sample(uint32_t x, uint32_t y) {
    IsoFan fan;
    fan.corner = {acrossX(x0_ + x), acrossY(y0_ + y)};
    for (size_t ray = 0; ray < kIsoRays; ++ray) {
      fan.x[ray] = static_cast<float>(static_cast<double>(ray % kBlock) * lattice_.spacing);
      fan.y[ray] = static_cast<float>(static_cast<double>(ray / kBlock) * lattice_.spacing);
    }
    cross(fan, {x0_ + x, y0_ + y, x0_ + x + kBlock, y0_ + y + kBlock}, -INFINITY, INFINITY);
    IsoField field;
    IsoRow z;
    for (uint32_t k = planes_.begin; k < planes_.end; ++k) {
      z.fill(static_cast<float>(k * lattice_.spacing));
      active_.clear();
      for (const IsoCrossed& splat : crossed_)
        if (splat.begin <= z[0] && splat.end >= z[0]) active_.push_back(&splat);
      if (active_.empty()) continue;
      sumField(active_, z, field);
      for (uint32_t ray = 0; ray < kIsoRays; ++ray)
        if (field.weight[ray] > kMinWeight) at({x + ray % kBlock, y + ray / kBlock, k}) = field.value[ray];
    }
  }

  struct Pixels {
    uint32_t x0, y0, x1, y1;
  };
  /// Crosses the splats that touch the pixels and depths.
  void cross(const IsoFan& fan, const Pixels& pixels, double near, double far) {
    crossed_.clear();
    for (const IsoSplats::Placed& placed : in_tile_) {
      const IsoSplat& s = *placed.splat;
      if (!(s.x1 >= static_cast<float>(pixels.x0) && s.x0 <= static_cast<float>(pixels.x1) &&
            s.y1 >= static_cast<float>(pixels.y0) && s.y0 <= static_cast<float>(pixels.y1)))
        continue;
      if (double{s.near} > far || 2 * s.centre.z - double{s.near} < near) continue;
      crossed_.emplace_back();
      if (!crossSplat(placed, fan, crossed_.back())) crossed_.pop_back();
    }
  }

  struct Started {
    Point cell;
    glm::dvec3 at;  // view axes
  };

  /// The mean of where the surface crosses a cube's edges, if it does; its vertex starts there.
  bool start(const Point& cell, glm::dvec3& middle) {
    static constexpr std::array<std::array<uint8_t, 2>, 12> kEdges{
        {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};
    std::array<float, 8> corners;
    bool below = false, above = false;
    for (uint32_t n = 0; n < 8; ++n) {
      corners[n] = at({cell.x + (n & 1), cell.y + (n >> 1 & 1), cell.k + (n >> 2)});
      below = below || corners[n] < 0;
      above = above || corners[n] >= 0;
    }
    if (!below || !above) return false;
    glm::dvec3 sum(0.0);
    int count = 0;
    for (const auto& [a, b] : kEdges) {
      if (!((corners[a] < 0 && corners[b] >= 0) || (corners[b] < 0 && corners[a] >= 0))) continue;
      const auto placeOf = [](unsigned n) { return glm::dvec3(n & 1, n >> 1 & 1, n >> 2); };
      const double part = double{corners[a]} / (double{corners[a]} - double{corners[b]});
      sum += glm::mix(placeOf(a), placeOf(b), part);
      ++count;
    }
    if (count == 0) return false;
    middle = sum / double(count);
    return true;
  }

  void findVertices(uint32_t x0, uint32_t y0) {
    std::vector<Started> started;
    for (uint32_t k = planes_.begin; k + 1 < planes_.end; ++k)
      for (uint32_t y = y0; y < y0 + kBlock; ++y)
        for (uint32_t x = x0; x < x0 + kBlock; ++x) {
          glm::dvec3 middle;
          if (!isCell(x, y) || !start({x, y, k}, middle)) continue;
          started.push_back({{x, y, k},
                             {acrossX(x0_ + x + middle.x), acrossY(y0_ + y + middle.y),
                              lattice_.spacing * (k + middle.z)}});
          if (started.size() == kIsoRays) finish(started, x0, y0);
        }
    if (!started.empty()) finish(started, x0, y0);
  }

  /// Moves up to sixteen vertices of a block onto the surface, within their cubes.
  void finish(std::vector<Started>& started, uint32_t x0, uint32_t y0) {
    IsoField field;
    IsoSlopes slopes;
    IsoRow z;
    for (int move = 0; move <= kMoves; ++move) {
      IsoFan fan;
      fan.corner = {started[0].at.x, started[0].at.y};
      double near = INFINITY, far = -INFINITY;
      for (size_t n = 0; n < kIsoRays; ++n) {
        const glm::dvec3 at = started[std::min(n, started.size() - 1)].at;
        fan.x[n] = static_cast<float>(at.x - fan.corner.x);
        fan.y[n] = static_cast<float>(at.y - fan.corner.y);
        z[n] = static_cast<float>(at.z);
        near = std::min(near, at.z);
        far = std::max(far, at.z);
      }
      cross(fan, {x0_ + x0, y0_ + y0, x0_ + x0 + kBlock + 1, y0_ + y0 + kBlock + 1}, near, far);
      active_.clear();
      for (const IsoCrossed& splat : crossed_) active_.push_back(&splat);
      sumSlopes(active_, z, slopes);
      if (move == kMoves) break;
      sumField(active_, z, field);
      for (size_t n = 0; n < started.size(); ++n) {
        const glm::dvec3 slope(slopes.x[n], slopes.y[n], slopes.z[n]);
        const double steep2 = glm::dot(slope, slope);
        if (!(steep2 > 0)) continue;
        const Point& cell = started[n].cell;
        const glm::dvec3 lower(acrossX(x0_ + cell.x), acrossY(y0_ + cell.y), lattice_.spacing * cell.k);
        const glm::dvec3 moved = started[n].at - double{field.value[n]} / steep2 * slope;
        started[n].at = glm::clamp(moved, lower, lower + lattice_.spacing);
      }
    }
    for (size_t n = 0; n < started.size(); ++n) {
      const glm::vec3 slope(slopes.x[n], slopes.y[n], slopes.z[n]);
      const float length = glm::length(slope);
      const Point& cell = started[n].cell;
      out_.cells.push_back({lattice_.number(x0_ + cell.x, y0_ + cell.y, cell.k),
                            {started[n].at, length > 0 ? -slope / length : glm::vec3(0, 0, 1),
                             insideAt(n, started[n].at, slopes.weight[n])}});
    }
    started.clear();
  }

  /// How far inside borders' faces a point is, in the splats' own lengths, from -1 to 1.
  float insideAt(size_t ray, const glm::dvec3& at, float weight) const {
    if (!(weight > 0)) return -1;
    float sum = weight;
    for (const IsoCrossed& crossed : crossed_) {
      if (crossed.splat->faces.empty()) continue;
      const IsoSplat& s = *crossed.splat->splat;
      const glm::vec3 off(at - s.centre);
      const glm::vec3 u = off.x * s.by_right + off.y * s.by_down + off.z * s.by_forward;
      float least = 1;
      for (const CutFace& face : crossed.splat->faces)
        least = std::min(least, glm::dot(face.inward, u) + face.distance);
      sum += isoWeight(crossed, ray, static_cast<float>(at.z)) * (std::max(least, -1.0f) - 1);
    }
    return std::min(sum / weight, weight / kMinInside - 1);
  }

  /// Finds the quads between the cubes around the edges that go on from a point: counter-clockwise as seen
  /// from smaller values, in view axes.
  void findQuads(const Point& p) {
    const float here = at(p);
    if (std::isnan(here) || !isCell(p.x, p.y) || p.k + 1 >= planes_.end) return;
    const uint64_t i = x0_ + p.x, j = y0_ + p.y, k = p.k;
    const auto number = [&](uint64_t x, uint64_t y, uint64_t z) {
      return lattice_.number(i - x, j - y, k - z);
    };
    const auto add = [&](float there, const std::array<uint64_t, 4>& cells) {
      if (!((here < 0 && there >= 0) || (there < 0 && here >= 0))) return;
      if (here < 0) return void(out_.quads.push_back({cells[3], cells[2], cells[1], cells[0]}));
      out_.quads.push_back(cells);
    };
    if (i > 0 && j > 0)
      add(at({p.x, p.y, p.k + 1}), {number(1, 1, 0), number(0, 1, 0), number(0, 0, 0), number(1, 0, 0)});
    if (j > 0 && p.k > planes_.begin)
      add(at({p.x + 1, p.y, p.k}), {number(0, 1, 1), number(0, 0, 1), number(0, 0, 0), number(0, 1, 0)});
    if (i > 0 && p.k > planes_.begin)
      add(at({p.x, p.y + 1, p.k}), {number(1, 0, 1), number(1, 0, 0), number(0, 0, 0), number(0, 0, 1)});
  }

  const IsoSplats& splats_;
  const IsoLattice& lattice_;
  const std::span<const IsoSplats::Placed> in_tile_;
  const Planes planes_;
  uint32_t x0_ = 0, y0_ = 0;
  std::vector<float> values_;  // less the isovalue; NaN: no field
  std::vector<IsoCrossed> crossed_;
  std::vector<const IsoCrossed*> active_;
  IsoCells out_;
};

}  // namespace

IsoCells isoCells(const IsoSplats& splats, size_t tile, const IsoLattice& lattice) {
  return TileOfCells(splats, tile, lattice).find();
}

uint64_t isoCellsBytes(const IsoSplats& splats, size_t tile, const IsoLattice& lattice) {
  const auto in_tile = splats.inTile(tile);
  constexpr uint64_t kCellBytes = 2 * sizeof(IsoCells::Cell) + 3 * 2 * sizeof(std::array<uint64_t, 4>);
  const uint64_t planes = planesOf(in_tile, lattice).count();
  // A surface seldom goes through each column more often than eight times.
  return planes * kColumns * kColumns * sizeof(float) + 8 * uint64_t{kSide} * kSide * kCellBytes +
         mostOfBlocks(in_tile, cornerOf(tile, lattice)) * (sizeof(IsoCrossed) + sizeof(const IsoCrossed*));
}

}  // namespace curvisplat
