#include "render/colour/classification_change.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>

namespace curvisplat {
namespace {

constexpr size_t kElements = ClassificationTable::kCells + 2;
constexpr size_t kNeighbours = 2;  // blocks on either side

struct Extremes {
  glm::vec4 least, most;
};

std::vector<Extremes> extremesOf(const ClassificationTable& table) {
  std::vector<Extremes> elements(kElements);
  elements.front() = {table.below(), table.below()};
  elements.back() = {table.above(), table.above()};
  const auto cumulative = table.exactCumulative();
  for (size_t cell = 0; cell < ClassificationTable::kCells; ++cell) {
    const glm::vec4 value(cumulative[cell + 1] - cumulative[cell]);
    elements[cell + 1] = {value, value};
  }
  return elements;
}

/// Of two blocks each.
std::vector<Extremes> halved(const std::vector<Extremes>& blocks) {
  std::vector<Extremes> wider((blocks.size() + 1) / 2);
  for (size_t n = 0; n < wider.size(); ++n) {
    const Extremes &a = blocks[2 * n], &b = blocks[std::min(2 * n + 1, blocks.size() - 1)];
    wider[n] = {glm::min(a.least, b.least), glm::max(a.most, b.most)};
  }
  return wider;
}

std::vector<float> changesOf(const std::vector<Extremes>& blocks) {
  std::vector<float> changes(blocks.size());
  for (size_t n = 0; n < blocks.size(); ++n) {
    const size_t end = std::min(n + kNeighbours + 1, blocks.size());
    Extremes around = blocks[n];
    for (size_t m = n - std::min(n, kNeighbours); m < end; ++m)
      around = {glm::min(around.least, blocks[m].least), glm::max(around.most, blocks[m].most)};
    const glm::vec4 change = around.most - around.least;
    changes[n] = std::max({change.x, change.y, change.z, change.w});
  }
  return changes;
}

}  // namespace

ClassificationChange::ClassificationChange(const ClassificationTable& table)
    : extinctions_(kElements), log_scale_(table.logScale()), scale_(table.scale()), bias_(table.bias()) {
  std::vector<Extremes> blocks = extremesOf(table);
  for (size_t n = 0; n < kElements; ++n) extinctions_[n] = blocks[n].most.w;
  changes_.push_back(changesOf(blocks));
  while (blocks.size() > kNeighbours + 1) {
    blocks = halved(blocks);
    changes_.push_back(changesOf(blocks));
  }
}

double ClassificationChange::cellsOf(double scalar) const {
  const double v =
      log_scale_ ? std::log(std::max(scalar, double{ClassificationTable::kMinLogarithmic})) : scalar;
  return v * scale_ + bias_;
}

std::pair<size_t, size_t> ClassificationChange::elementsOf(float low, float high) const {
  const auto element = [](double cells) {
    return static_cast<size_t>(std::clamp(std::floor(cells), -1.0, double{ClassificationTable::kCells}) + 1);
  };
  return {element(cellsOf(low) - 0.5), element(cellsOf(high) + 0.5)};
}

double ClassificationChange::deviationInCells(float low, float deviation) const {
  if (!log_scale_) return scale_ * deviation;
  // The lowest scalar's deviation is the longest; below the table nothing changes.
  const double lowest = std::max<double>(low, std::exp(-bias_ / scale_));
  return cellsOf(lowest) - cellsOf(lowest - deviation);
}

double ClassificationChange::largestChange(float low, float high, float deviation) const {
  if (!(deviation > 0)) return 0;
  const double cells = deviationInCells(low, deviation);
  size_t level = 0;
  while (level + 1 < changes_.size() && kNeighbours * std::ldexp(1.0, static_cast<int>(level)) < cells + 1)
    ++level;
  const auto [first, last] = elementsOf(low, high);
  const auto begin = changes_[level].begin();
  const float change = *std::max_element(begin + static_cast<std::ptrdiff_t>(first >> level),
                                         begin + static_cast<std::ptrdiff_t>((last >> level) + 1));
  return change * std::min(cells, 1.0);
}

double ClassificationChange::largestExtinction(float low, float high) const {
  const auto [first, last] = elementsOf(low, high);
  const auto begin = extinctions_.begin();
  return *std::max_element(begin + static_cast<std::ptrdiff_t>(first),
                           begin + static_cast<std::ptrdiff_t>(last + 1));
}

}  // namespace curvisplat
