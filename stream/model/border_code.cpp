#include "stream/model/border_code.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>

#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr uint32_t kReversed = 4;
constexpr int kFacesShift = 5;
constexpr double kLargest = std::numbers::sqrt2 / 2;  // that a number which is not the largest can be
constexpr double kSteps = 255;

glm::dquat rotationOf(std::span<const glm::dvec3> inward) {
  if (inward.size() == 1) {
    // The shortest from the first axis: neighbours have similar ones.
    const glm::dvec3& q = inward[0];
    return q.x > -0.9999 ? glm::normalize(glm::dquat(1 + q.x, 0, -q.z, q.y)) : glm::dquat(0, 0, 0, 1);
  }
  return glm::normalize(glm::quat_cast(glm::dmat3(inward[0], inward[1], glm::cross(inward[0], inward[1]))));
}

constexpr uint32_t kLayer = 4;
constexpr int kInwardShift = 8, kDistanceShift = 24;
constexpr double kDistanceSteps = 128;  // to a cell
constexpr int kRatioShift = 3;
constexpr uint32_t kRatioBits = 0x1f;
constexpr double kSmallestRatio = 0.75, kRatioSteps = 10;  // to a factor of 2
constexpr uint32_t kMaxRatio = 21;                         // of 3
constexpr double kLongestNext = 3;                         // splats behind, to a merged one's length
// Numbers that stand where a merged splat has its ratio: a plate, and the layers behind several faces.
constexpr uint32_t kPlate = 22, kLayers = 24, kThreeLayers = 4;

/// Packs a unit vector into 16 bits: the octahedron |x| + |y| + |z| = 1, its lower half folded outwards.
uint32_t packDirection(const glm::dvec3& q) {
  const double inverse = 1 / (std::abs(q.x) + std::abs(q.y) + std::abs(q.z));
  double u = q.x * inverse, v = q.y * inverse;
  if (q.z < 0) {
    const double folded = (1 - std::abs(v)) * (u < 0 ? -1 : 1);
    v = (1 - std::abs(u)) * (v < 0 ? -1 : 1);
    u = folded;
  }
  const auto steps = [](double x) {
    return static_cast<uint32_t>(std::clamp(0.5 + 0.5 * x, 0.0, 1.0) * kSteps + 0.5);
  };
  return steps(u) | steps(v) << 8;
}

glm::vec3 unpackDirection(uint32_t bits) {
  const auto number = [](uint32_t steps) { return static_cast<float>(steps / kSteps * 2 - 1); };
  glm::vec3 q(number(bits & 0xff), number(bits >> 8 & 0xff), 0.0f);
  q.z = 1 - std::abs(q.x) - std::abs(q.y);
  if (q.z < 0) {
    const float folded = (1 - std::abs(q.y)) * (q.x < 0 ? -1.0f : 1.0f);
    q.y = (1 - std::abs(q.x)) * (q.y < 0 ? -1.0f : 1.0f);
    q.x = folded;
  }
  return glm::normalize(q);
}

struct PackedRotation {
  uint32_t largest;  // which number is left out
  uint32_t others;   // bits 8-31 of a code
};

PackedRotation packRotation(const glm::dquat& rotation) {
  const std::array<double, 4> numbers{rotation.w, rotation.x, rotation.y, rotation.z};
  PackedRotation packed{0, 0};
  for (uint32_t n = 1; n < 4; ++n)
    if (std::abs(numbers[n]) > std::abs(numbers[packed.largest])) packed.largest = n;
  const double sign = numbers[packed.largest] < 0 ? -1 : 1;
  int shift = 8;
  for (uint32_t n = 0; n < 4; ++n) {
    if (n == packed.largest) continue;
    const double unit = std::clamp(0.5 + 0.5 * sign * numbers[n] / kLargest, 0.0, 1.0);
    packed.others |= static_cast<uint32_t>(unit * kSteps + 0.5) << shift;
    shift += 8;
  }
  return packed;
}

/// The numbers that the codes of a quaternion stand for.
class RotationNumbers {
 public:
  RotationNumbers() {
    for (uint32_t code = 0; code < numbers_.size(); ++code)
      numbers_[code] = static_cast<float>((code / kSteps * 2 - 1) * kLargest);
  }
  float of(uint32_t code) const { return numbers_[code & 0xff]; }

 private:
  std::array<float, 256> numbers_;
};

/// Number `largest` of the quaternion is left out of the code.
glm::mat3 unpackRotation(uint32_t code, uint32_t largest) {
  static const RotationNumbers unpacked;
  std::array<float, 4> numbers{};
  float sum = 0;
  int shift = 8;
  for (uint32_t n = 0; n < 4; ++n) {
    if (n == largest) continue;
    numbers[n] = unpacked.of(code >> shift);
    sum += numbers[n] * numbers[n];
    shift += 8;
  }
  numbers[largest] = std::sqrt(std::max(0.0f, 1 - sum));
  return glm::mat3_cast(glm::normalize(glm::quat(numbers[0], numbers[1], numbers[2], numbers[3])));
}

}  // namespace

uint32_t packLayerCode(const glm::dvec3& inward, double distance) {
  const double steps = std::round(distance * kDistanceSteps);
  if (!(steps >= 1 && steps <= kSteps)) return kNoBorder;
  return kLayer | packDirection(inward) << kInwardShift | static_cast<uint32_t>(steps) << kDistanceShift;
}

uint32_t packMergedCode(const glm::dvec3& inward, double distance, double ratio) {
  if (!(distance <= 1 && ratio > 0)) return kNoBorder;
  const uint32_t code = packLayerCode(inward, distance);
  if (code == kNoBorder) return kNoBorder;
  const double step = 1 + kRatioSteps * std::log2(std::max(ratio, kSmallestRatio) / kSmallestRatio);
  return code | static_cast<uint32_t>(std::min(std::round(step), 1.0 * kMaxRatio)) << kRatioShift;
}

uint32_t packPlateCode(const glm::dvec3& across) {
  return kLayer | kPlate << kRatioShift | packDirection(across) << kInwardShift;
}

uint32_t packBorderCode(std::span<const glm::dvec3> inward, uint32_t faces) {
  if (inward.empty()) return kNoBorder;
  const PackedRotation rotation = packRotation(rotationOf(inward));
  auto code = static_cast<uint32_t>(inward.size()) | rotation.largest << 3 | faces << kFacesShift;
  if (inward.size() == 3 && glm::dot(glm::cross(inward[0], inward[1]), inward[2]) < 0) code |= kReversed;
  return code | rotation.others;
}

uint32_t packLayersCode(std::span<const glm::dvec3> inward, size_t count) {
  if (count > 0) {
    const uint32_t code = packBorderCode(inward, (1u << inward.size()) - 1);
    return (code & ~3u) | static_cast<uint32_t>(count);
  }
  const PackedRotation rotation = packRotation(rotationOf(inward));
  const uint32_t form = kLayers + rotation.largest + (inward.size() == 3 ? kThreeLayers : 0);
  return kLayer | form << kRatioShift | rotation.others;
}

InwardAxes inwardAxes(uint32_t border_code) {
  InwardAxes inward;
  inward.count = static_cast<int>(border_code & 3);
  const uint32_t ratio = border_code >> kRatioShift & kRatioBits;
  if (inward.count == 0 && ratio >= kLayers) {
    const glm::mat3 frame = unpackRotation(border_code, ratio & 3);
    inward.axis = {frame[0], frame[1], frame[2]};
    return inward;
  }
  if (inward.count == 0) {
    if (border_code == kNoBorder) return inward;
    inward.count = 1;
    inward.axis[0] = unpackDirection(border_code >> kInwardShift & 0xffff);
    inward.plate = ratio == kPlate;
    if (inward.plate) return inward;
    inward.faces = 1;
    inward.distance = static_cast<float>((border_code >> kDistanceShift) / kDistanceSteps);
    inward.behind = ratio == 0;
    if (ratio != 0)
      inward.ratio = static_cast<float>(std::min(kSmallestRatio * std::exp2((ratio - 1) / kRatioSteps),
                                                 kLongestNext / (2.0 * inward.distance)));
    return inward;
  }
  inward.faces = border_code >> kFacesShift & ((1u << inward.count) - 1);
  const glm::mat3 frame = unpackRotation(border_code, border_code >> 3 & 3);
  inward.axis = {frame[0], frame[1], border_code & kReversed ? -frame[2] : frame[2]};
  return inward;
}

uint32_t layersOf(uint32_t border_code) {
  const uint32_t own = (1u << (border_code & 3)) - 1, ratio = border_code >> kRatioShift & kRatioBits;
  if (own != 0) return border_code >> kFacesShift & 7 & ~own;
  return ratio < kLayers ? 0 : (ratio & kThreeLayers) != 0 ? 7 : 3;
}

bool isPossibleBorderCode(uint32_t border_code) {
  if (border_code == kNoBorder || (border_code & 3) != 0) return true;
  if ((border_code & 7) != kLayer) return false;
  const uint32_t ratio = border_code >> kRatioShift & kRatioBits, distance = border_code >> kDistanceShift;
  if (ratio >= kLayers) return true;
  if (ratio == kPlate) return distance == 0;
  return ratio <= kMaxRatio && distance != 0 && (ratio == 0 || distance <= kDistanceSteps);
}

BorderPart mergedPart(const InwardAxes& inward) {
  const float thickness = 2 * inward.distance, w = 1 / inward.ratio;
  const float next = thickness * inward.ratio;  // the length of the splats behind
  return {next * kMergedDistance(w) - inward.distance, next * kMergedSize(w), inward.ratio * kMergedShare(w)};
}

double borderReach(uint32_t border_code) {
  if (border_code == kNoBorder) return 0;
  const uint32_t own = (1u << (border_code & 3)) - 1;
  if (own != 0) return (border_code >> kFacesShift & own) != 0 ? kCutReach : kPartsReach;
  const uint32_t ratio = border_code >> kRatioShift & kRatioBits;
  if (ratio == 0 || ratio >= kPlate) return 0;
  const BorderPart part = mergedPart(inwardAxes(border_code));
  return std::max(0.0, part.offset + kKernelSupport * (part.size - 1));
}

double drawnSlope(const glm::dvec3& slope, uint32_t border_code) {
  return drawnSlope(slope, inwardAxes(border_code));
}

double drawnSlope(const glm::dvec3& slope, const InwardAxes& inward) {
  double squared = glm::dot(slope, slope);
  constexpr double kWidest = kHalfCellStyle.cut.size + kWidening;
  if (inward.behind) return std::sqrt(squared);
  const double widest = inward.ratio > 0 ? std::max(mergedPart(inward).size, 1.0f) : kWidest;
  for (int n = 0; n < inward.count; ++n) {
    const double along = glm::dot(slope, glm::dvec3(inward.axis[static_cast<size_t>(n)]));
    if (inward.hasFace(n)) squared += (widest * widest - 1) * along * along;
  }
  return std::sqrt(squared);
}

}  // namespace curvisplat
