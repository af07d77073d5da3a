#include "preprocess/splats/joint_growth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "preprocess/splats/shape.h"
#include "preprocess/splats/stretch.h"

namespace curvisplat {
namespace {

constexpr double kAlong = 0.7;       // cosine of directions that are about the same
constexpr double kLeast = 1.0 / 64;  // less growth becomes none
constexpr size_t kMaxHalves = 24;    // of eight parts; where more meet, the grid has collapsed

/// The growth of a cell along a direction of its frame.
double growthAlong(const CellGrowth& of_cell, const glm::vec3& q) {
  double growth = 0;
  for (size_t n = 0; n < 3; ++n) {
    const double share = glm::dot(of_cell.axis[n], q);
    if (std::abs(share) > kAlong) growth += share < 0 ? -of_cell.growth[n] : of_cell.growth[n];
  }
  return growth;
}

/// Up to three axes of a frame at right angles, with the growth along each.
class GrowthAxesOf {
 public:
  /// False if there is no place for the axis.
  bool add(glm::dvec3 axis, double growth) {
    for (size_t n = 0; n < count_; ++n) axis -= glm::dot(axis, axes_[n]) * axes_[n];
    const double length = glm::length(axis);
    if (count_ == 3 || !(length > kAlong)) return false;
    axes_[count_] = axis / length;
    growth_[count_++] = growth;
    return true;
  }
  uint32_t code() const { return packGrowthCode(axes_, growth_); }

 private:
  std::array<glm::dvec3, 3> axes_{};
  std::array<double, 3> growth_{};
  size_t count_ = 0;
};

}  // namespace

void JointGrowth::add(const NodeSplat& part) {
  if (halves_.size() > kMaxHalves) return;  // of() ignores them all
  const InwardAxes inward = inwardAxes(part.border_code);
  if (inward.behind) return;
  const CellGrowth growth = cellGrowth(part.growth_code);
  for (int n = 0; n < inward.count; ++n) {
    const glm::vec3& q = inward.axis[static_cast<size_t>(n)];
    halves_.push_back({part.splat.factor() * glm::dvec3(q), growthAlong(growth, q)});
  }
}

/// Along a direction of the merged splat's frame, in which one of its parts ends; 0 if no part ends opposite.
double JointGrowth::across(const Splat& merged, const glm::dvec3& axis) const {
  std::array<double, 2> length{}, growth{}, count{};  // behind the joint, and before it
  for (const Half& half : halves_) {
    const double share = glm::dot(glm::normalize(inFrameOf(merged, half.along)), axis);
    if (!(std::abs(share) > kAlong)) continue;
    const size_t side = share > 0 ? 0 : 1;
    length[side] += glm::length(half.along);
    growth[side] += half.growth;
    ++count[side];
  }
  if (count[0] == 0 || count[1] == 0 || !(length[0] > 0 && length[1] > 0)) return 0;
  const double expected = 0.5 * (growth[0] / count[0] - growth[1] / count[1]);
  return 0.5 * (expected + std::log(length[0] / count[0] / (length[1] / count[1])));
}

JointGrowth::Found JointGrowth::of(const Splat& merged, const NodeSplat& lowest) const {
  if (halves_.size() > kMaxHalves) return {};
  Found found;
  GrowthAxesOf axes;
  const InwardAxes inward = inwardAxes(lowest.border_code);
  const auto isInward = [&](const glm::vec3& axis) {
    return std::any_of(inward.axis.begin(), inward.axis.begin() + inward.count,
                       [&](const glm::vec3& q) { return std::abs(glm::dot(q, axis)) > kAlong; });
  };
  for (int n = 0; n < inward.count; ++n) {
    const glm::dvec3 half = lowest.splat.factor() * glm::dvec3(inward.axis[static_cast<size_t>(n)]);
    const glm::dvec3 axis = glm::normalize(inFrameOf(merged, half));
    const double growth = across(merged, axis);
    if (!(std::abs(growth) >= kLeast)) continue;
    if (axes.add(axis, growth)) found.drift += kDrift * std::clamp(growth, -0.65, 0.65) * axis;
  }
  // Along the other axes the merged splat has what its part has.
  const CellGrowth of_part = cellGrowth(lowest.growth_code);
  for (size_t n = 0; n < 3; ++n) {
    if (of_part.growth[n] == 0 || isInward(of_part.axis[n])) continue;
    const glm::dvec3 along = inFrameOf(merged, lowest.splat.factor() * glm::dvec3(of_part.axis[n]));
    const double length = glm::length(along);
    if (length > kAlong && length < 1 / kAlong) axes.add(along / length, of_part.growth[n]);
  }
  found.code = axes.code();
  return found;
}

}  // namespace curvisplat
