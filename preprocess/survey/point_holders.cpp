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

/// Calls each(number) for points that may lie in the cell, among them all that do. Any thread.
template <typename Each>
void PointHolders::forEachNear(const std::array<glm::dvec3, 8>& corner, const Each& each) const {
  BoundingBox box;
  for (const glm::dvec3& node : corner) box.add(node);
  const auto each_in_box = [&](uint32_t n) {
    if (box.holds(points_[n].position)) each(n);
  };
  if (!bins_.forEachOfFew(box, each_in_box)) tree_.forEachNear(corner, each);
}

/// Whether the point is to be located in the cells of `block`. Any thread.
bool PointHolders::isWanted(uint32_t point, uint32_t block) const {
  return points_[point].block != block && counts_[point] < kMaxHolders &&
         latest_[point].load(std::memory_order_relaxed) != block + 1;
}

void PointHolders::locate(const GridBlock& block, const LoadedSlab& loaded, const Progress& progress) {
  const uint32_t number = loaded.slab.block;
  tbb::enumerable_thread_specific<std::vector<uint32_t>> found;
  forEachCell(
      block, loaded,
      [&](uint64_t, uint64_t) {
        progress.throwIfStopped();
        return true;
      },
      [&](size_t at, size_t row, size_t plane, uint64_t, uint64_t, uint64_t) {
        const std::array<glm::dvec3, 8> corner = cornersIn(loaded, at, row, plane);
        forEachNear(corner, [&](uint32_t n) {
          // Two cells may both contain a point of their common face.
          if (isWanted(n, number) && holds(corner, points_[n].position) &&
              latest_[n].exchange(number + 1, std::memory_order_relaxed) != number + 1)
            found.local().push_back(n);
        });
      });
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
  if (2 * finished_ <= tree_.size()) return given_;
  std::vector<uint32_t> wanted;
  tree_.forEach([&](uint32_t point) {
    if (counts_[point] < kMaxHolders) wanted.push_back(point);
  });
  bins_ = PointBins(points_, wanted);
  tree_ = PointTree(points_, std::span<const uint32_t>(wanted));
  finished_ = 0;
  return given_;
}

}  // namespace curvisplat
