#include "preprocess/splats/joint_line.h"

#include <algorithm>
#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

constexpr double kMost = 127;

int8_t rounded(double x) {
  return static_cast<int8_t>(std::clamp(std::round(x), -kMost, kMost));
}

}  // namespace

JointLine::JointLine(const CellRow& row, double unit) : unit_(static_cast<float>(unit)) {
  const auto is_usable = [](double x) { return x > 0 && std::isfinite(x); };
  if (!is_usable(unit_) || !std::all_of(row.begin(), row.end(), is_usable)) {
    unit_ = 0;
    return;
  }
  for (size_t n = 0; n < row.size(); ++n) logarithms_[n] = rounded(std::log2(row[n] / unit_) / kStep);
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
  for (int n = 0; n < 3; ++n) inward_[static_cast<size_t>(n)] = rounded(kMost * unit_vector[n]);
}

}  // namespace curvisplat
