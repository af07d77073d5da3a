#include "render/colour/classification.h"

#include <utility>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr int kSamplesPerCell = 8;

glm::dvec4 weighted(const TransferFunction::Value& value) {
  return {value.colour * value.extinction, value.extinction};
}

}  // namespace

namespace {

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

}  // namespace curvisplat
