#include "preprocess/convert/splat_record.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

static_assert(std::endian::native == std::endian::little,
              "words of 24 and 48 bits are the low bytes of larger ones");

// The 24 bits of a positive float that a record keeps of an axis.
constexpr int kDroppedBits = 7;

uint32_t axisBits(double axis) {
  constexpr float kLargest = 0x1p127f;  // rounds up to no infinity
  const float single = std::clamp(recordFloat(axis), std::numeric_limits<float>::min(), kLargest);
  return (std::bit_cast<uint32_t>(single) + (1u << (kDroppedBits - 1))) >> kDroppedBits;
}

double axisOf(uint32_t bits) {
  return std::bit_cast<float>(bits << kDroppedBits);
}

// Steps of weight / (a0 a1 a2), as regular splats keep it. Those below a quarter would lose digits.
constexpr double kRatioSteps = 0x1p15;
constexpr double kSmallestRatio = 0.25, kLargestRatio = 0xffff / kRatioSteps;

double product(const std::array<double, 3>& axis) {
  return axis[0] * axis[1] * axis[2];
}

}  // namespace

void packRecord(const NodeSplat& node_splat, std::span<const SplatScalar> values,
                const RootPosition& position, std::vector<std::byte>& out) {
  CURVISPLAT_CHECK_OP(node_splat.node, <, kMaxNodes);
  const double cell = product(node_splat.splat.axis);
  const double ratio = cell > 0 ? node_splat.splat.weight / cell : 0;
  const bool irregular = !node_splat.regular || node_splat.border_code != kNoBorder ||
                         !(ratio >= kSmallestRatio) || !(ratio <= kLargestRatio);
  const size_t bytes = irregular ? irregularRecordBytes(values.size()) : regularRecordBytes(values.size());
  const size_t start = out.size();
  out.resize(start + bytes);
  std::byte* at = out.data() + start;

  const auto putWord48 = [&at](uint64_t word) {
    std::memcpy(at, &word, 6);
    at += 6;
  };
  const auto putFloat = [&at](double value) {
    const float single = recordFloat(value);
    std::memcpy(at, &single, sizeof single);
    at += sizeof single;
  };
  putWord48(node_splat.node | uint64_t{irregular} << 47);
  for (const uint64_t coordinate : position.at) putWord48(coordinate);
  for (const double axis : node_splat.splat.axis) {
    const uint32_t bits = axisBits(axis);
    std::memcpy(at, &bits, 3);
    at += 3;
  }
  for (const double shear : node_splat.splat.shear) putFloat(shear);
  const auto ratio_code = irregular ? uint16_t{0} : static_cast<uint16_t>(ratio * kRatioSteps + 0.5);
  std::memcpy(at, &ratio_code, sizeof ratio_code);
  at += sizeof ratio_code;
  std::memcpy(at, &node_splat.growth_code, sizeof node_splat.growth_code);
  at += sizeof node_splat.growth_code;
  for (const SplatScalar& value : values) {
    putFloat(value.mean);
    for (int axis = 0; axis < 3; ++axis) putFloat(value.slope[axis]);
  }
  if (irregular) {
    putFloat(ratio);
    std::memcpy(at, &node_splat.border_code, sizeof node_splat.border_code);
    at += sizeof node_splat.border_code;
    for (const SplatScalar& value : values) putFloat(value.variance);
  }
}

SplatCodes unpackRecord(const std::byte* record, Splat& splat, std::span<SplatScalar> values) {
  const bool irregular = recordIsIrregular(record);
  const std::byte* at = record + 24;
  const auto takeFloat = [&at] {
    float single;
    std::memcpy(&single, at, sizeof single);
    at += sizeof single;
    return static_cast<double>(single);
  };
  for (double& axis : splat.axis) {
    uint32_t bits;  // as recordWord48()
    std::memcpy(&bits, at, sizeof bits);
    at += 3;
    axis = axisOf(bits & 0xffffff);
  }
  for (double& shear : splat.shear) shear = takeFloat();
  uint16_t ratio_code;
  std::memcpy(&ratio_code, at, sizeof ratio_code);
  at += sizeof ratio_code;
  SplatCodes codes;
  std::memcpy(&codes.growth, at, sizeof codes.growth);
  at += sizeof codes.growth;
  for (SplatScalar& value : values) {
    value.mean = takeFloat();
    for (int axis = 0; axis < 3; ++axis) value.slope[axis] = takeFloat();
    value.variance = 0;
  }
  splat.weight = product(splat.axis);
  if (!irregular) {
    splat.weight *= ratio_code / kRatioSteps;
    return codes;
  }
  splat.weight *= takeFloat();
  std::memcpy(&codes.border, at, sizeof codes.border);
  at += sizeof codes.border;
  for (SplatScalar& value : values) value.variance = takeFloat();
  return codes;
}

}  // namespace curvisplat
