#include "stream/model/growth_code.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <numeric>

namespace curvisplat {
namespace {

static_assert(3 * kRotationBits == kGrowthFrameBits);

/// std::nearbyint() of a number far below 2^51, without a call.
int nearestInteger(double x) {
  constexpr double kShift = 0x1.8p52;
  return static_cast<int>((x + kShift) - kShift);
}

uint32_t lowBits(int value, int bits) {
  return static_cast<uint32_t>(value) & ((1u << bits) - 1);
}
int signedBits(uint32_t code, int shift, int bits) {
  const auto value = static_cast<int>(code >> shift & ((1u << bits) - 1));
  return value < 1 << (bits - 1) ? value : value - (1 << bits);
}

/// Unit vectors, and growths in steps.
struct Steps {
  std::array<glm::dvec3, 3> axis;
  std::array<int, 3> growth;
};

/// The shortest rotation from the frame's axis that is nearest to the one that grows.
glm::dquat rotationOfOne(Steps& steps, int grows) {
  const glm::dvec3 from = steps.axis[grows];
  int to = 0;
  for (int n = 1; n < 3; ++n)
    if (std::abs(from[n]) > std::abs(from[to])) to = n;
  const double sign = from[to] < 0 ? -1 : 1;
  const int growth = sign < 0 ? -steps.growth[grows] : steps.growth[grows];
  steps.growth = {};
  steps.growth[to] = growth;
  glm::dvec3 frame(0.0);
  frame[to] = 1;
  const glm::dvec3 around = glm::cross(frame, sign * from);
  return glm::normalize(glm::dquat(1 + std::abs(from[to]), around.x, around.y, around.z));
}

/// The order and the signs of the axes that make the rotation smallest.
glm::dquat rotationOfAll(Steps& steps) {
  constexpr std::array<std::array<int, 3>, 6> kOrders{
      {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  const auto& axis = steps.axis;
  std::array<int, 3> best = kOrders[0];
  double largest = -1;
  for (const std::array<int, 3>& order : kOrders) {
    const double trace = std::abs(axis[order[0]].x) + std::abs(axis[order[1]].y) + std::abs(axis[order[2]].z);
    if (trace > largest) {
      largest = trace;
      best = order;
    }
  }
  glm::dmat3 frame;
  std::array<int, 3> growth;
  int least = 0;
  for (int n = 0; n < 3; ++n) {
    const double sign = axis[best[n]][n] < 0 ? -1 : 1;
    frame[n] = sign * axis[best[n]];
    growth[n] = static_cast<int>(sign) * steps.growth[best[n]];
    if (frame[n][n] < frame[least][least]) least = n;
  }
  if (glm::determinant(frame) < 0) {
    frame[least] = -frame[least];
    growth[least] = -growth[least];
  }
  steps.growth = growth;
  const glm::dquat rotation = glm::normalize(glm::quat_cast(frame));
  return rotation.w < 0 ? -rotation : rotation;
}

/// The axes of every rotation that codes have: 144 KiB, for the root and the divisions that a rotation takes.
class RotatedAxes {
 public:
  RotatedAxes() {
    for (uint32_t rotation = 0; rotation < axes_.size(); ++rotation) {
      glm::vec3 q;
      for (int n = 0; n < 3; ++n)
        q[n] = static_cast<float>(signedBits(rotation, n * kRotationBits, kRotationBits) * kRotationStep);
      const float w = std::sqrt(std::max(0.0f, 1 - glm::dot(q, q)));
      const glm::mat3 frame = glm::mat3_cast(glm::normalize(glm::quat(w, q.x, q.y, q.z)));
      axes_[rotation] = {frame[0], frame[1], frame[2]};
    }
  }
  const auto& all() const { return axes_; }

 private:
  std::array<GrowthFrame, 1 << kGrowthFrameBits> axes_;
};

}  // namespace

uint32_t packGrowthCode(std::array<glm::dvec3, 3> axis, std::array<double, 3> growth) {
  Steps steps{axis, {}};
  int count = 0, last = 0, none = 0;
  for (int n = 0; n < 3; ++n) {
    steps.growth[n] = nearestInteger(
        std::clamp(growth[n] / kGrowthStep, -1.0 * kLargestGrowthCode, 1.0 * kLargestGrowthCode));
    if (steps.growth[n] != 0) {
      ++count;
      last = n;
    } else {
      none = n;
    }
  }
  if (count == 0) return kNoGrowth;
  if (count == 2) steps.axis[none] = glm::cross(axis[(none + 1) % 3], axis[(none + 2) % 3]);
  const glm::dquat rotation = count == 1 ? rotationOfOne(steps, last) : rotationOfAll(steps);
  uint32_t code = 0;
  for (int n = 0; n < 3; ++n) code |= lowBits(steps.growth[n], kGrowthBits) << n * kGrowthBits;
  const std::array<double, 3> numbers{rotation.x, rotation.y, rotation.z};
  for (int n = 0; n < 3; ++n) {
    const int number = nearestInteger(numbers[n] / kRotationStep);
    code |= lowBits(std::clamp(number, -kLargestRotationCode, kLargestRotationCode), kRotationBits)
            << (kGrowthFrameShift + n * kRotationBits);
  }
  return code;
}

std::span<const GrowthFrame> growthFrames() {
  static const RotatedAxes axes;
  return axes.all();
}

CellGrowth cellGrowth(uint32_t growth_code) {
  CellGrowth result;
  for (size_t n = 0; n < 3; ++n) result.growth[n] = growthOf(growth_code, n);
  result.axis = growthFrames()[frameNumber(growth_code)];
  return result;
}

bool isPossibleGrowthCode(uint32_t growth_code) {
  if (growth_code == kNoGrowth) return true;
  if (growth_code >> (kGrowthFrameShift + 3 * kRotationBits) != 0) return false;
  bool any = false;
  for (int n = 0; n < 3; ++n) {
    const int growth = signedBits(growth_code, n * kGrowthBits, kGrowthBits);
    if (std::abs(growth) > kLargestGrowthCode) return false;
    any |= growth != 0;
    if (signedBits(growth_code, kGrowthFrameShift + n * kRotationBits, kRotationBits) < -kLargestRotationCode)
      return false;
  }
  return any;
}

}  // namespace curvisplat
