#include "preprocess/survey/overlap_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/survey/slab_cells.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr double kPoints = 100'000;  // approximate number of points inside all blocks; more at their faces
constexpr size_t kFewBlocks = 200;   // with more of them fewer points are at their faces

glm::dvec3 pointIn(const std::array<glm::dvec3, 8>& corner, double u, double v, double w) {
  const auto along_i = [&](size_t c) { return glm::mix(corner[c], corner[c + 1], u); };
  return glm::mix(glm::mix(along_i(0), along_i(2), v), glm::mix(along_i(4), along_i(6), v), w);
}

AxisSampling alongAxis(uint64_t nodes, double cells_in_all, size_t blocks) {
  // One of every `step` cells along each axis.
  const double step = std::max(1.0, std::cbrt(cells_in_all / kPoints));
  return {nodes - 1, static_cast<uint64_t>(static_cast<double>(nodes - 1) / step), blocks > kFewBlocks};
}

}  // namespace

AxisSampling::AxisSampling(uint64_t cells, uint64_t wanted, bool few) : cells_(cells) {
  const std::vector<Point> end = few ? std::vector<Point>{{0.1, 0.2}, {0.6, 0.8}}
                                     : std::vector<Point>{{0.05, 0.1}, {0.2, 0.2}, {0.65, 0.7}};
  if (cells == 1) {
    for (const Point& point : end) {
      first_.push_back({point.t / 2, point.cells / 2});
      first_.push_back({1 - point.t / 2, point.cells / 2});
    }
    return;
  }
  first_ = end;
  for (const Point& point : end) last_.push_back({1 - point.t, point.cells});
  inner_ = cells - 2;
  count_ = std::min(inner_, std::max<uint64_t>(1, wanted));
  middle_.cells = static_cast<double>(inner_) / static_cast<double>(std::max<uint64_t>(1, count_));
}

AxisSampling::Cell AxisSampling::at(uint64_t cell) const {
  if (cell == 0) return {first_, 0};
  if (cell >= cells_) return {{}, points()};
  if (cell == cells_ - 1) return {last_, first_.size() + count_};
  // Inner point n is in inner cell (2 n + 1) inner_ / (2 count_). The first that is not before this one:
  const uint64_t inner = cell - 1;
  const uint64_t n = (2 * inner * count_ + inner_ - 1) / inner_ / 2;
  const bool is_here = n < count_ && (2 * n + 1) * inner_ / (2 * count_) == inner;
  return {is_here ? std::span(&middle_, 1) : std::span<const Point>(), first_.size() + n};
}

BlockSampling::BlockSampling(const GridBlock& block, double cells_in_all, size_t blocks)
    : ni_(block.ni),
      nj_(block.nj),
      i(alongAxis(block.ni, cells_in_all, blocks)),
      j(alongAxis(block.nj, cells_in_all, blocks)),
      k(alongAxis(block.nk, cells_in_all, blocks)) {}

uint64_t BlockSampling::pointsBefore(uint64_t cell) const {
  const AxisSampling::Cell w = k.at(planeOf(cell)), v = j.at(cell / ni_ % nj_), u = i.at(cell % ni_);
  return (w.before * j.points() + w.points.size() * v.before) * i.points() +
         w.points.size() * v.points.size() * u.before;
}

uint64_t BlockSampling::endOfPart(uint64_t begin, uint64_t most) const {
  CURVISPLAT_CHECK(most >= kMaxPointsOfCell);
  uint64_t at_i = begin % ni_, at_j = begin / ni_ % nj_, left = most;
  for (uint64_t at_k = planeOf(begin); at_k < k.cells(); ++at_k, at_j = at_i = 0) {
    const uint64_t in_k = k.at(at_k).points.size(), plane = in_k * j.points() * i.points();
    if (in_k == 0) continue;
    if (at_j == 0 && at_i == 0 && plane <= left) {
      left -= plane;
      continue;
    }
    for (; at_j < j.cells(); ++at_j, at_i = 0) {
      const uint64_t in_row = in_k * j.at(at_j).points.size();
      if (in_row == 0) continue;
      if (at_i == 0 && in_row * i.points() <= left) {
        left -= in_row * i.points();
        continue;
      }
      for (; at_i < i.cells(); ++at_i) {
        const uint64_t in_cell = in_row * i.at(at_i).points.size();
        if (in_cell > left) return cellNumber(at_i, at_j, at_k);
        left -= in_cell;
      }
    }
  }
  return endOfCells();
}

PointPicker::PointPicker(const GridBlock& block, const BlockSampling& sampling, const CellPart& part,
                         std::vector<BlockPoint>& points)
    : block_(block),
      sampling_(sampling),
      part_(part),
      points_(points),
      first_(points.size()),
      skipped_(sampling.pointsBefore(part.begin)) {
  points.resize(first_ + (sampling.pointsBefore(part.end) - skipped_), BlockPoint{{}, 0, part.block});
}

void PointPicker::add(const LoadedSlab& loaded) {
  forEachCell(
      block_, loaded,
      [&](uint64_t j, uint64_t k) {
        return !sampling_.j.at(j).points.empty() && !sampling_.k.at(k).points.empty();
      },
      [&](size_t at, size_t row, size_t plane, uint64_t i, uint64_t j, uint64_t k) {
        const AxisSampling::Cell along_i = sampling_.i.at(i);
        const uint64_t cell = sampling_.cellNumber(i, j, k);
        if (along_i.points.empty() || cell < part_.begin || cell >= part_.end) return;
        const std::array<glm::dvec3, 8> corner = cornersIn(loaded, at, row, plane);
        const double volume = std::abs(Hexahedron(corner).volume());
        BlockPoint* point = &points_[first_ + (sampling_.pointsBefore(cell) - skipped_)];
        for (const auto& w : sampling_.k.at(k).points)
          for (const auto& v : sampling_.j.at(j).points)
            for (const auto& u : along_i.points) {
              point->position = pointIn(corner, u.t, v.t, w.t);
              point++->volume = volume * u.cells * v.cells * w.cells;
            }
      });
}

void PointPicker::finish(double& volume, const BoxTree* others) {
  for (size_t n = first_; n < points_.size(); ++n) volume += points_[n].volume;
  points_.erase(std::remove_if(points_.begin() + static_cast<ptrdiff_t>(first_), points_.end(),
                               [](const BlockPoint& point) { return point.volume == 0; }),
                points_.end());
  if (others) keepPointsInOthers(points_, first_, *others);
}

void keepPointsInOthers(std::vector<BlockPoint>& points, size_t first, const BoxTree& boxes) {
  size_t kept = first;
  for (size_t n = first; n < points.size();) {
    const uint32_t block = points[n].block;
    BoundingBox around;
    size_t end = n;
    for (; end < points.size() && points[end].block == block; ++end) around.add(points[end].position);
    if (!boxes.anotherTouches(around, block)) {
      n = end;
      continue;
    }
    for (; n < end; ++n)
      if (boxes.anotherHolds(points[n].position, block)) points[kept++] = points[n];
  }
  points.resize(kept);
}

}  // namespace curvisplat
