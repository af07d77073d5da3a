#include "preprocess/convert/value_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace curvisplat {
namespace {

constexpr size_t kRowsAtOnce = 256;
constexpr float kLargest = std::numeric_limits<float>::max();

/// A number above 0, up to 1.
double hashOf(uint64_t node) {
  uint64_t hash = node + 0x9e3779b97f4a7c15;
  hash = (hash ^ hash >> 30) * 0xbf58476d1ce4e5b9;
  hash = (hash ^ hash >> 27) * 0x94d049bb133111eb;
  hash ^= hash >> 31;
  return static_cast<double>((hash >> 11) + 1) * 0x1p-53;
}

}  // namespace

void ValueSample::Adder::add(uint64_t node, double weight, std::span<const SplatScalar> values) {
  if (!(weight > 0)) return;
  const double priority = hashOf(node) / weight;
  if (priority > sample_->threshold_.load(std::memory_order_relaxed)) return;
  rows_.insert(rows_.end(), {priority, static_cast<double>(node), weight});
  for (const SplatScalar& value : values) rows_.push_back(static_cast<float>(value.mean));
  if (rows_.size() >= kRowsAtOnce * sample_->columns_) flush();
}

void ValueSample::Adder::flush() {
  if (rows_.empty()) return;
  sample_->add(rows_);
  rows_.clear();
}

void ValueSample::add(std::span<const double> rows) {
  const MutexLock lock(adding_);
  rows_.insert(rows_.end(), rows.begin(), rows.end());
  if (rows_.size() < 2 * splats_ * columns_) return;
  rows_ = smallest(rows_);
  double largest = 0;
  for (size_t at = 0; at < rows_.size(); at += columns_) largest = std::max(largest, rows_[at + kPriority]);
  threshold_.store(largest, std::memory_order_relaxed);
}

std::vector<double> ValueSample::smallest(std::span<const double> rows) const {
  std::vector<size_t> order(rows.size() / columns_);
  std::iota(order.begin(), order.end(), size_t{0});
  const auto first = [&](size_t a, size_t b) {
    const auto x = rows.subspan(a * columns_, columns_), y = rows.subspan(b * columns_, columns_);
    return x[kPriority] != y[kPriority] ? x[kPriority] < y[kPriority] : x[kNode] < y[kNode];
  };
  if (order.size() > splats_) {
    std::nth_element(order.begin(), order.begin() + static_cast<ptrdiff_t>(splats_), order.end(), first);
    order.resize(splats_);
  }
  std::vector<double> kept;
  kept.reserve(order.size() * columns_);
  for (const size_t row : order)
    kept.insert(kept.end(), rows.begin() + static_cast<ptrdiff_t>(row * columns_),
                rows.begin() + static_cast<ptrdiff_t>((row + 1) * columns_));
  return kept;
}

std::vector<double> ValueSample::rows() const {
  const MutexLock lock(adding_);
  return smallest(rows_);
}

void ValueSample::gatherFrom(Ranks& ranks) {
  const std::vector<Ranks::Bytes> others = ranks.gather(toBytes(rows()));
  for (size_t n = 1; n < others.size(); ++n) add(fromBytes<double>(others[n]));
}

std::vector<ValueSample::Weighed> ValueSample::sorted(size_t variable, double& total) const {
  const std::vector<double> rows = this->rows();
  const size_t count = rows.size() / columns_;
  double least_weight = 0;
  if (count == splats_)
    for (size_t at = 0; at < rows.size(); at += columns_)
      least_weight = std::max(least_weight, rows[at + kPriority]);
  if (least_weight > 0) least_weight = 1 / least_weight;
  std::vector<Weighed> values(count);
  for (size_t n = 0; n < count; ++n)
    values[n] = {static_cast<float>(rows[n * columns_ + kValues + variable]),
                 std::max(least_weight, rows[n * columns_ + kWeight])};
  // By weight, too, so that sums have the same bits whatever the order.
  std::sort(values.begin(), values.end(), [](const Weighed& a, const Weighed& b) {
    return a.value != b.value ? a.value < b.value : a.weight < b.weight;
  });
  total = 0;
  for (const Weighed& value : values) total += value.weight;
  return values;
}

ValueSpread ValueSample::spreadOf(size_t variable) const {
  double total = 0;
  const std::vector<Weighed> values = sorted(variable, total);
  const auto percentile = [&](double part) {
    double below = 0;
    for (const Weighed& value : values)
      if ((below += value.weight) >= part * total) return double{value.value};
    return values.empty() ? 0.0 : double{values.back().value};
  };
  // Where nearly all of the volume has one value, the rest says how far values spread.
  for (const double tail : {0.05, 0.01, 0.001, 0.0}) {
    const double scale = percentile(1 - tail) - percentile(tail);
    if (scale > 0) return {percentile(0.5), scale};
  }
  return {};
}

HistogramBins ValueSample::binsOf(size_t variable) const {
  constexpr double kBins = 4096;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  double total = 0;
  const std::vector<Weighed> values = sorted(variable, total);
  HistogramBins bins;
  double below = 0, next = total / kBins;
  for (size_t n = 0; n < values.size();) {
    const float value = values[n].value;
    double here = 0;
    for (; n < values.size() && values[n].value == value; ++n) here += values[n].weight;
    below += here;
    if (below < next) continue;
    next = (std::floor(below / total * kBins) + 1) / kBins * total;
    if (bins.edges.empty() || bins.edges.back() < value) bins.edges.push_back(value);
    // A value with more than a bin's share is a bin by itself.
    if (here * kBins > total && value < kLargest) bins.edges.push_back(std::nextafter(value, kInfinity));
  }
  bins.shares.assign(bins.edges.size() + 1, 0);
  size_t bin = 0;
  for (const Weighed& value : values) {
    while (bin < bins.edges.size() && bins.edges[bin] <= value.value) ++bin;
    bins.shares[bin] += value.weight / total;
  }
  return bins;
}

}  // namespace curvisplat
