#include "render/colour/classification.h"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr int kSamplesPerCell = 8;

glm::dvec4 weighted(const TransferFunction::Value& value) {
  return {value.colour * value.extinction, value.extinction};
}

/// The part of a function's range that data in [data_low, data_high] reaches.
std::pair<double, double> coveredRange(const TransferFunction& transfer_function, double data_low,
                                       double data_high) {
  const auto [from, to] = transfer_function.range();
  double low = std::clamp(from, data_low, data_high);
  if (transfer_function.logScale()) low = std::max(low, from);  // the data may end below zero
  double high = std::clamp(to, data_low, data_high);
  // A constant field, or a transfer function that is constant over the data: any interval will do. Also of data that differ by
  // so little that a table's scale would be infinite in single precision.
  constexpr double kNarrowest = 1e-34;
  const bool is_narrow = transfer_function.logScale() ? !(high > low) : !(high - low > kNarrowest);
  if (is_narrow) high = low + std::max(std::abs(low), 1.0) * 1e-3;
  return {low, high};
}

}  // namespace

ClassificationTable ClassificationTable::of(const TransferFunction& transfer_function, double data_low,
                                            double data_high) {
  const auto [low, high] = coveredRange(transfer_function, data_low, data_high);
  return {[&](double scalar) { return transfer_function.at(scalar); }, low, high,
          transfer_function.logScale()};
}

ClassificationTable ClassificationTable::ofColours(const TransferFunction& transfer_function, double data_low,
                                                   double data_high) {
  const auto [low, high] = coveredRange(transfer_function, data_low, data_high);
  return {[&](double scalar) {
            return TransferFunction::Value{transfer_function.at(scalar).colour, 1};
          },
          low, high, transfer_function.logScale()};
}

ClassificationTable::ClassificationTable(const std::function<TransferFunction::Value(double)>& at, double low,
                                         double high, bool log_scale)
    : log_scale_(log_scale), below_(weighted(at(low))), above_(weighted(at(high))) {
  CURVISPLAT_CHECK_OP(low, <, high);
  if (log_scale) CURVISPLAT_CHECK_OP(low, >, 0.0);
  const double from = log_scale ? std::log(low) : low;
  const double to = log_scale ? std::log(high) : high;
  scale_ = kCells / (to - from);
  bias_ = -from * scale_;

  exact_.resize(kCells + 1, glm::dvec4(0.0));
  next_opaque_.resize(kCells + 2);
  std::vector<bool> opaque(kCells + 2);
  opaque.front() = below_.w > 0;
  opaque.back() = above_.w > 0;
  for (int cell = 0; cell < kCells; ++cell) {
    glm::dvec4 sum(0.0);
    for (int sample = 0; sample < kSamplesPerCell; ++sample) {
      const double x = cell + (sample + 0.5) / kSamplesPerCell;
      const double v = from + (to - from) * x / kCells;
      sum += weighted(at(log_scale ? std::exp(v) : v));
    }
    exact_[cell + 1] = exact_[cell] + sum / double{kSamplesPerCell};
    opaque[cell + 1] = sum.w > 0;
  }
  cumulative_.assign(exact_.begin(), exact_.end());
  uint32_t next = kCells + 2;
  for (uint32_t element = kCells + 2; element-- > 0;)
    next_opaque_[element] = next = opaque[element] ? element : next;
}

double ClassificationTable::integral(double x, int component) const {
  const double inside = std::clamp(x, 0.0, double{kCells});
  const int cell = std::min(static_cast<int>(inside), kCells - 1);
  return std::lerp(exact_[cell][component], exact_[cell + 1][component], inside - cell) +
         below_[component] * std::min(x, 0.0) + above_[component] * std::max(x - kCells, 0.0);
}

glm::dvec4 ClassificationTable::mean(double centre, double half_width) const {
  const auto in_cells = [this](double scalar) {
    return scale_ * (log_scale_ ? std::log(std::max(scalar, double{kMinLogarithmic})) : scalar) + bias_;
  };
  double from = in_cells(centre - half_width), to = in_cells(centre + half_width);
  if (to - from < 1) {
    const double middle = 0.5 * (from + to);
    from = middle - 0.5;
    to = middle + 0.5;
  }
  glm::dvec4 mean;
  for (int component = 0; component < 4; ++component)
    mean[component] = std::max(0.0, (integral(to, component) - integral(from, component)) / (to - from));
  return mean;
}

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

/// The extremes of two blocks each.
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

ColourTable::ColourTable(const TransferFunction& function) : log_scale_(function.logScale()) {
  const auto [from, to] = function.range();
  low_ = log_scale_ ? std::log(from) : from;
  const double high = log_scale_ ? std::log(to) : to;
  scale_ = high > low_ ? kCells / (high - low_) : 0;
  values_.reserve(kCells + 1);
  for (int n = 0; n <= kCells; ++n) {
    const double x = low_ + (high - low_) * n / kCells;
    const TransferFunction::Value value = function.at(log_scale_ ? std::exp(x) : x);
    values_.emplace_back(glm::vec3(value.colour), -std::expm1(-value.extinction * function.opacityUnit()));
  }
}

glm::vec4 ColourTable::valueAt(double scalar) const {
  constexpr double kMin = 1e-300;
  const double v = log_scale_ ? std::log(std::max(scalar, kMin)) : scalar;
  const double x = std::clamp((v - low_) * scale_, 0.0, double{kCells});
  const int cell = std::min(static_cast<int>(x), kCells - 1);
  return glm::mix(values_[static_cast<size_t>(cell)], values_[static_cast<size_t>(cell) + 1],
                  static_cast<float>(x - cell));
}

}  // namespace curvisplat
