#include "preprocess/survey/point_holders.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "preprocess/grid/hexahedron_location.h"
#include "preprocess/survey/slab_cells.h"

namespace curvisplat {
namespace {

/// Whether the trilinear hexahedron contains the point. Its faces belong to none.
bool holds(const std::array<glm::dvec3, 8>& corner, const glm::dvec3& point) {
  const std::optional<glm::dvec3> u = locateInHexahedron(corner, point);
  return u && std::abs(u->x) < 1 && std::abs(u->y) < 1 && std::abs(u->z) < 1;
}

std::vector<uint32_t> allOf(std::span<const BlockPoint> points) {
  std::vector<uint32_t> numbers(points.size());
  std::iota(numbers.begin(), numbers.end(), 0u);
  return numbers;
}

}  // namespace

PointBins::PointBins(std::span<const BlockPoint> points, const std::vector<uint32_t>& numbers) {
  for (const uint32_t n : numbers) box_.add(points[n].position);
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = box_.upper[axis] - box_.lower[axis];
    scale_[axis] = extent > 0 ? static_cast<double>(kAlongAxis) / extent : 0.0;
  }
  first_.assign(kAlongAxis * kAlongAxis * kAlongAxis + 1, 0);
  for (const uint32_t n : numbers) ++first_[binOf(points[n].position) + 1];
  for (size_t bin = 1; bin < first_.size(); ++bin) first_[bin] += first_[bin - 1];
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  sorted_.resize(numbers.size());
  for (const uint32_t n : numbers) sorted_[next[binOf(points[n].position)]++] = n;
}

std::array<uint64_t, 3> PointBins::place(const glm::dvec3& position) const {
  std::array<uint64_t, 3> place;
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (position[axis] - box_.lower[axis]) * scale_[axis];
    place[static_cast<size_t>(axis)] =
        static_cast<uint64_t>(std::clamp(at, 0.0, static_cast<double>(kAlongAxis - 1)));
  }
  return place;
}

uint64_t PointBins::binOf(const glm::dvec3& position) const {
  const auto at = place(position);
  return (at[2] * kAlongAxis + at[1]) * kAlongAxis + at[0];
}

PointHolders::PointHolders(std::span<const BlockPoint> points)
    : points_(points),
      counts_(points.size(), 0),
      latest_(points.size()),
      bins_(points, allOf(points)),
      tree_(points, allOf(points)) {}

bool PointHolders::mayHold(uint32_t block, const BoundingBox& box) const {
  return tree_.anyIn(box, [&](uint32_t point) { return points_[point].block != block; });
}

/// Adds those to `found` that the cell holds. Any thread.
void PointHolders::locateInCell(uint32_t block, const std::array<glm::dvec3, 8>& corner,
                                std::vector<uint32_t>& found) {
  BoundingBox box;
  for (const glm::dvec3& node : corner) box.add(node);
  size_t in_vain = 0;
  const auto locate = [&](uint32_t n) {
    if (!isWanted(n, block)) {
      ++in_vain;
      return;
    }
    // Two cells may both contain a point of their common face.
    if (holds(corner, points_[n].position) &&
        latest_[n].exchange(block + 1, std::memory_order_relaxed) != block + 1)
      found.push_back(n);
  };
  const auto locate_in_box = [&](uint32_t n) {
    if (box.holds(points_[n].position)) locate(n);
  };
  if (!bins_.forEachOfFew(box, locate_in_box)) tree_.forEachNear(corner, locate);
  if (in_vain > 0) in_vain_.fetch_add(in_vain, std::memory_order_relaxed);
}

/// Whether the point is to be located in the cells of `block`. Any thread.
bool PointHolders::isWanted(uint32_t point, uint32_t block) const {
  return points_[point].block != block && counts_[point] < kMaxHolders &&
         latest_[point].load(std::memory_order_relaxed) != block + 1;
}

/// So many meetings in vain cost what sorting the points again does: for each of them, and in any case. Any thread.
bool PointHolders::shouldPrune() const {
  constexpr size_t kInVainEach = 32, kInVainAnyway = 1 << 17;
  return in_vain_.load(std::memory_order_relaxed) > kInVainEach * tree_.size() + kInVainAnyway;
}

/// Sorts again the points that are still to be located in `block`. finishBlock() brings back the others.
void PointHolders::prune(uint32_t block) {
  std::vector<uint32_t> wanted;
  tree_.forEach([&](uint32_t point) {
    if (isWanted(point, block)) wanted.push_back(point);
  });
  sort(wanted);
  met_in_vain_ += in_vain_.exchange(0);
  is_pruned_ = true;
}

void PointHolders::sort(const std::vector<uint32_t>& wanted) {
  bins_ = PointBins(points_, wanted);
  tree_ = PointTree(points_, std::span<const uint32_t>(wanted));
}

void PointHolders::locate(const GridBlock& block, const LoadedSlab& loaded, const Progress& progress) {
  const Slab& slab = loaded.slab;
  const uint64_t width = slab.box.j1 - slab.box.j0;
  std::vector<uint64_t> next(rowsOf(slab.box), slab.box.i0);  // [row]: the first cell that is not searched
  tbb::enumerable_thread_specific<std::vector<uint32_t>> found;
  std::atomic<bool> complete = false;
  while (!complete && tree_.size() > 0) {
    complete = true;
    forEachCell(
        block, loaded,
        [&](uint64_t, uint64_t) {
          progress.throwIfStopped();
          return true;
        },
        [&](size_t at, size_t row, size_t plane, uint64_t i, uint64_t j, uint64_t k) {
          uint64_t& next_of_row = next[(k - slab.box.k0) * width + j - slab.box.j0];
          if (i < next_of_row) return;
          if (shouldPrune()) {
            complete = false;
            return;
          }
          next_of_row = i + 1;
          locateInCell(slab.block, cornersIn(loaded, at, row, plane), found.local());
        });
    if (!complete) prune(slab.block);
  }
  for (const auto& of_thread : found)
    for (const uint32_t point : of_thread) {
      inside_.push_back(point);
      if (++counts_[point] == kMaxHolders) ++finished_;
    }
}

std::span<const uint32_t> PointHolders::finishBlock() {
  given_.swap(inside_);
  inside_.clear();
  std::sort(given_.begin(), given_.end());
  met_in_vain_ += in_vain_.exchange(0);
  if (!is_pruned_ && 2 * finished_ <= tree_.size()) return given_;
  std::vector<uint32_t> wanted;
  for (uint32_t point = 0; point < points_.size(); ++point)
    if (counts_[point] < kMaxHolders) wanted.push_back(point);
  sort(wanted);
  finished_ = 0;
  is_pruned_ = false;
  return given_;
}

}  // namespace curvisplat
