#include "preprocess/splats/joint_line.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <numbers>

namespace curvisplat {
namespace {

constexpr double kMax = 127;

int8_t rounded(double x) {
  return static_cast<int8_t>(std::clamp(std::round(x), -kMax, kMax));
}

bool isUsable(double x) {
  return x > 0 && std::isfinite(x);
}

/// rounded(log2(ratio()) / step). std::log2() is slow, and needed only where the quotient is close to the middle between two integers.
template <typename Ratio>
int8_t roundedLogarithm(double squared_ratio, double step, const Ratio& ratio) {
  constexpr double kSmallest = 1e-30, kLargest = 1e30;  // well within what a float can hold
  constexpr double kClose = 0.01;     // in steps: more than 50 times halfLogarithm()'s error
  constexpr int kMaxSteps = 1 << 12;  // for ratios in this range
  if (squared_ratio > kSmallest && squared_ratio < kLargest) {
    const double per_step = 1 / (std::numbers::ln2 * step);
    const double steps = per_step * static_cast<double>(halfLogarithm(static_cast<float>(squared_ratio)));
    const double shifted = steps + (kMaxSteps + 0.5);
    const int nearest = static_cast<int>(shifted);
    if (const double part = shifted - nearest; part > kClose && part < 1 - kClose) {
      constexpr int kMaxRounded = static_cast<int>(kMax);
      return static_cast<int8_t>(std::clamp(nearest - kMaxSteps, -kMaxRounded, kMaxRounded));
    }
  }
  return rounded(std::log2(ratio()) / step);
}

}  // namespace

JointLine::JointLine(const CellRow& row, double unit) : unit_(static_cast<float>(unit)) {
  if (!isUsable(unit_) || !std::all_of(row.begin(), row.end(), isUsable)) {
    unit_ = 0;
    return;
  }
  for (size_t n = 0; n < row.size(); ++n) {
    const double ratio = row[n] / unit_;
    logarithms_[n] = roundedLogarithm(ratio * ratio, kStep, [&] { return ratio; });
  }
}

JointLine JointLine::ofExtents(const SquaredExtents& extents, double unit) {
  JointLine line;
  const auto rounded_unit = static_cast<float>(unit);
  if (!isUsable(rounded_unit) || !std::all_of(extents.begin(), extents.end(), isUsable)) return line;
  line.unit_ = rounded_unit;
  const double per_unit = 0.25 / (line.unit() * line.unit());
  for (size_t n = 0; n < extents.size(); ++n) {
    if (n > 0 && extents[n] == extents[n - 1]) {  // as on lines of two nodes, and in even cells
      line.logarithms_[n] = line.logarithms_[n - 1];
      continue;
    }
    const auto ratio = [&] { return 0.5 * std::sqrt(extents[n]) / line.unit(); };
    line.logarithms_[n] = roundedLogarithm(extents[n] * per_unit, kStep, ratio);
  }
  return line;
}

CellRow JointLine::row() const {
  CellRow row;
  for (size_t n = 0; n < row.size(); ++n) row[n] = unit_ * std::exp2(kStep * logarithms_[n]);
  return row;
}

glm::dvec3 JointLine::inward() const {
  return glm::normalize(glm::dvec3(inward_[0], inward_[1], inward_[2]));
}

void JointLine::setInward(const glm::dvec3& unit_vector) {
  for (int n = 0; n < 3; ++n) inward_[static_cast<size_t>(n)] = rounded(kMax * unit_vector[n]);
}

}  // namespace curvisplat
