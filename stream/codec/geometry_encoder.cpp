#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "stream/codec/geometry_codec.h"
#include "stream/codec/log_codes.h"
#include "stream/codec/planes.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "stream/model/kernel.h"
#include "stream/model/splats.h"

namespace curvisplat {
namespace {

constexpr double kPositionError = 0.05;  // as a fraction of the smallest standard deviation
constexpr double kLargestShearCode = 1e9;
constexpr double kLargestMissingWeight = 1e-5;  // of the sum of a brick's weights

/// std::nearbyint() of numbers below 2^51, in two additions; larger ones stay large.
double nearestInteger(double x) {
  constexpr double kShift = 0x1.8p52;
  return (x + kShift) - kShift;
}

int positionBits(const RootCube& root, const Cell& cell, double smallest_axis) {
  const double interval = 2 * kPositionError * kKernelSigma * smallest_axis / std::sqrt(3.0);
  const double bits = std::ceil(std::log2(root.cellSize(cell.level) / interval));
  const int lattice_bits = kPositionBits - static_cast<int>(cell.level);
  return static_cast<int>(
      std::clamp(bits, 1.0 * kMinPositionBits, 1.0 * std::min(kMaxPositionBits, lattice_bits)));
}

int positionBits(const RootCube& root, const Cell& cell, std::span<const Splat> splats) {
  constexpr double kSlack = 0.01;
  const double most = smallestSingularValue(splats, kSlack);
  const int bits = positionBits(root, cell, most);
  // Whatever it is within the slack, the number of bits is nearly always the same.
  if (positionBits(root, cell, most / (1 + kSlack)) == bits) return bits;
  return positionBits(root, cell, smallestSingularValue(splats));
}

class GeometryEncoder {
 public:
  GeometryEncoder(const RootCube& root, const BrickSplats& brick, DecodedGeometry& decoded)
      : root_(root), brick_(brick), decoded_(decoded), count_(brick.size()) {
    decoded_.resize(count_);
    codes_.resize(count_);
    targets_.resize(count_);
    residuals_.resize(count_);
  }

  std::vector<std::byte> encode() {
    decoded_.runs = brick_.runs;
    decoded_.rows = rowsOf(brick_.runs, count_);
    sample_ = sampleOf(decoded_.rows);
    encodeRuns();
    encodePositions();
    // Try the compact codes first. If a shape does not fit them, discard what was added and store raw floats.
    const PlaneWriter planes = planes_;
    const size_t arrays = arrays_;
    if (!encodeShapes()) {
      planes_ = planes;
      arrays_ = arrays;
      encodeRawShapes();
    }
    encodeWeights();
    encodeBorders();
    encodeGrowth();
    return planes_.compress(std::as_bytes(std::span(&header_, 1)));
  }

 private:
  void encodeRuns() {
    std::vector<std::byte> bytes;
    NodeRun before;
    // Differences as zigzag varints: consecutive rows take a byte per number.
    const auto put = [&](uint64_t now, uint64_t then) {
      const uint64_t difference = now - then;
      appendVarint(bytes, difference << 1 ^ (0 - (difference >> 63)));
    };
    for (const NodeRun& run : brick_.runs) {
      put(run.block, before.block);
      put(run.k, before.k);
      put(run.j, before.j);
      put(run.i, before.i);
      put(run.count, before.count);
      before = run;
    }
    header_.runs_bytes = static_cast<uint32_t>(bytes.size());
    planes_.addBytes(bytes);
  }

  void encodePositions() {
    const int bits = positionBits(root_, brick_.cell, brick_.splats);
    header_.position_bits = static_cast<uint8_t>(bits);
    decoded_.position_bits = bits;
    const int lattice_bits = kPositionBits - static_cast<int>(brick_.cell.level);
    const uint64_t in_cell = (uint64_t{1} << lattice_bits) - 1;
    for (int axis = 0; axis < 3; ++axis) {
      auto& position = decoded_.position[axis];
      for (size_t n = 0; n < count_; ++n)
        position[n] =
            static_cast<uint32_t>((brick_.positions[n].at[axis] & in_cell) >> (lattice_bits - bits));
      addPredicted(position);
    }
  }

  bool encodeShapes() {
    LogTable axis0, axis1, volume;
    const auto as_it_is = [] { return 0.0; };
    if (!encodeLogs([](const Splat& s) { return s.axis[0]; }, kAxisStep,
                    {header_.log_axis0, axis0, decoded_.axis[0]}, as_it_is) ||
        !encodeLogs([](const Splat& s) { return s.axis[1]; }, kAxisStep,
                    {header_.log_axis1, axis1, decoded_.axis[1]}, as_it_is) ||
        !encodeLogs([](const Splat& s) { return s.axis[0] * s.axis[1] * s.axis[2]; }, kVolumeStep,
                    {header_.log_volume, volume, decoded_.axis[2]}, [&] { return missingVolume(); }))
      return false;
    for (size_t n = 0; n < count_; ++n) decoded_.axis[2][n] /= decoded_.axis[0][n] * decoded_.axis[1][n];
    const auto &a0 = decoded_.axis[0], &a1 = decoded_.axis[1], &a2 = decoded_.axis[2],
               &l21 = decoded_.shear[2];
    return encodeShear(
               2, [&](size_t n) { return ShearSteps::l21(a1[n], a2[n]); },
               [&](size_t n) { return brick_.splats[n].shear[2]; }) &&
           encodeShear(
               0, [&](size_t n) { return ShearSteps::l10(a0[n], a1[n], a2[n], l21[n]); },
               [&](size_t n) { return brick_.splats[n].shear[0]; }) &&
           encodeShear(
               1, [&](size_t n) { return ShearSteps::l20(a0[n], a2[n]); },
               [&](size_t n) {
                 const auto& shear = brick_.splats[n].shear;
                 return shear[1] + shear[2] * (decoded_.shear[0][n] - shear[0]);
               });
  }

  /// The start of the codes of logarithms, and what they decode to.
  struct DecodedLogs {
    double& base;
    LogTable& table;
    std::vector<double>& out;
  };

  /// `shift()` is added to the base once all are decoded.
  template <typename Length, typename Shift>
  bool encodeLogs(Length length, double step, const DecodedLogs& decoded, const Shift& shift) {
    for (size_t n = 0; n < count_; ++n) targets_[n] = length(brick_.splats[n]);
    const std::optional<LogCodes> logs = logCodes(targets_, step, kLargestLogCode, codes_.data());
    if (!logs) return false;
    const auto decode = [&](double base) {
      decoded.base = base;
      decoded.table = LogTable(base, step, logs->largest);
      for (size_t n = 0; n < count_; ++n) decoded.out[n] = decoded.table[codes_[n]];
    };
    decode(logs->lowest);
    if (const double more = shift(); more != 0) decode(logs->lowest + more);
    addPredicted(codes_);
    return true;
  }

  /// The logarithm of what the decoded volumes lack for the weights to have the right sum. Cells that are all alike, or all a little
  /// longer than their weight, are rounded in one direction; the rounding of a brick would not average out.
  double missingVolume() const {
    constexpr double kMax = 0.25 * kVolumeStep;  // of shapes, which have a bound to keep
    double exact = 0, decoded = 0;
    for (size_t n = 0; n < count_; ++n) {
      const double weight = brick_.splats[n].weight, volume = decoded_.axis[2][n];
      exact += weight;
      // Decides as encodeWeights() does: other weights have codes of their own, and errors either way.
      decoded += std::abs(weight - volume) < 0.5 * kWeightStep * volume ? volume : weight;
    }
    const double ratio = exact / decoded;
    return ratio > 0 && std::isfinite(ratio) ? std::clamp(std::log(ratio), -kMax, kMax) : 0.0;
  }

  template <typename StepOf, typename Target>
  bool encodeShear(int which, StepOf step_of, Target target) {
    auto& out = decoded_.shear[which];
    bool fits = true;
    for (size_t n = 0; n < count_; ++n) {
      const double step = step_of(n);
      const double code = nearestInteger(target(n) / step);
      const bool this_fits = std::abs(code) < kLargestShearCode;  // false for NaN
      fits &= this_fits;
      const int32_t kept = this_fits ? static_cast<int32_t>(code) : 0;
      codes_[n] = static_cast<uint32_t>(kept);
      out[n] = kept * step;
    }
    addPredicted(codes_);
    return fits;
  }

  void encodeRawShapes() {
    header_.raw |= kRawShapes;
    header_.log_axis0 = header_.log_axis1 = header_.log_volume = 0;
    for (int n = 0; n < 3; ++n) addRaw(decoded_.axis[n], [n](const Splat& s) { return s.axis[n]; });
    for (int n = 0; n < 3; ++n) addRaw(decoded_.shear[n], [n](const Splat& s) { return s.shear[n]; });
  }

  void encodeWeights() {
    bool fits = true;
    steps_.assign(count_, 0);
    targets_.assign(count_, 0);  // in steps, before rounding
    double missing = 0, sum = 0;
    for (size_t n = 0; n < count_ && fits; ++n) {
      const double weight = brick_.splats[n].weight, ratio = weight / decodedVolume(n);
      if (weight > 0 && std::abs(ratio - 1) < 0.5 * kWeightStep) {
        targets_[n] = (ratio - 1) / kWeightStep;
      } else if (weight > 0) {
        targets_[n] = std::log(ratio) / kWeightStep;
        fits = std::abs(targets_[n]) <= kLargestWeightCode - 1;
        steps_[n] = fits ? static_cast<int>(std::nearbyint(targets_[n])) : 0;
      }
      decoded_.weight[n] = weight > 0 ? decodedWeight(n) : 0;
      missing += weight - decoded_.weight[n];
      sum += weight;
    }
    if (!fits) {
      header_.raw |= kRawWeights;
      return addRaw(decoded_.weight, [](const Splat& s) { return s.weight; });
    }
    if (std::abs(missing) > kLargestMissingWeight * sum) spread(missing);
    for (size_t n = 0; n < count_; ++n)
      codes_[n] = steps_[n] != 0                 ? zigzag(static_cast<uint32_t>(steps_[n])) + 1
                  : brick_.splats[n].weight == 0 ? kZeroWeight
                                                 : kVolumeWeight;
    header_.arrays[arrays_++] = {Predictor::kNone, planes_.add(codes_)};
  }

  double decodedVolume(size_t n) const {
    return decoded_.axis[0][n] * decoded_.axis[1][n] * decoded_.axis[2][n];
  }
  double decodedWeight(size_t n) const {
    return steps_[n] == 0 ? decodedVolume(n)
                          : decodedVolume(n) * ratioTable()[steps_[n] + kLargestWeightCode];
  }

  /// The splats whose weights come nearer to what they were if they are `more` steps larger: those first that gain most, of
  /// equal ones the first.
  std::vector<uint32_t> byGain(int more) const {
    // The gain is rounded to 1/64 of a step, since equal cells differ by the rounding of their numbers. Half a step is the most
    // that rounding has left.
    constexpr uint32_t kParts = 64, kMost = kParts / 2, kNone = kMost + 1;
    const auto gainOf = [&](size_t n) {
      const double gain = (targets_[n] - steps_[n]) * more;
      if (!(brick_.splats[n].weight > 0 && gain > 0)) return kNone;
      return std::min(static_cast<uint32_t>(std::nearbyint(gain * kParts)), kMost);
    };
    std::vector<uint8_t> gains(count_);
    std::array<uint32_t, kNone + 1> counts{}, places{};
    for (size_t n = 0; n < count_; ++n) ++counts[gains[n] = static_cast<uint8_t>(gainOf(n))];
    uint32_t place = 0;
    for (uint32_t gain = kMost + 1; gain-- > 0;) places[gain] = std::exchange(place, place + counts[gain]);
    std::vector<uint32_t> order(place);
    for (uint32_t n = 0; n < count_; ++n)
      if (gains[n] != kNone) order[places[gains[n]]++] = n;
    return order;
  }

  /// Rounds weights the other way until their sum lacks nothing: those first that change least by it, and of equal ones the
  /// first, so that codes stay in runs. Cells that are all alike have all been rounded in one direction.
  void spread(double missing) {
    const int more = missing > 0 ? 1 : -1;
    for (const uint32_t n : byGain(more)) {
      const double before = decoded_.weight[n];
      steps_[n] += more;
      decoded_.weight[n] = decodedWeight(n);
      const double left = missing - (decoded_.weight[n] - before);
      if (std::abs(left) < std::abs(missing)) {
        missing = left;
      } else {
        steps_[n] -= more;
        decoded_.weight[n] = before;
      }
    }
  }

  void encodeBorders() {
    const auto& border_codes = brick_.border_codes;
    std::fill(decoded_.border_code.begin(), decoded_.border_code.end(), kNoBorder);
    if (std::all_of(border_codes.begin(), border_codes.end(),
                    [](uint32_t half) { return half == kNoBorder; }))
      return;
    header_.raw |= kHasBorders;
    decoded_.border_code = border_codes;
    for (int shift = 0; shift < 32; shift += 8) {
      for (size_t n = 0; n < count_; ++n) codes_[n] = border_codes[n] >> shift & 0xff;
      addPredicted(codes_);
    }
  }

  void encodeGrowth() {
    const auto& growth_codes = brick_.growth_codes;
    std::fill(decoded_.growth_code.begin(), decoded_.growth_code.end(), kNoGrowth);
    if (std::all_of(growth_codes.begin(), growth_codes.end(),
                    [](uint32_t code) { return code == kNoGrowth; }))
      return;
    header_.raw |= kHasGrowth;
    decoded_.growth_code = growth_codes;
    constexpr uint32_t kFirst = (1u << kGrowthBitsOfFirstArray) - 1;
    for (size_t n = 0; n < count_; ++n) codes_[n] = growth_codes[n] & kFirst;
    addPredicted(codes_);
    for (size_t n = 0; n < count_; ++n) codes_[n] = growth_codes[n] >> kGrowthBitsOfFirstArray;
    addPredicted(codes_);
  }

  void addPredicted(std::span<const uint32_t> values) {
    const Predictor predictor = bestPredictor(sample_, values).predictor;
    residualsOf(predictor, decoded_.rows, values.data(), residuals_.data());
    header_.arrays[arrays_++] = {predictor, planes_.add(residuals_)};
  }

  template <typename Get>
  void addRaw(std::vector<double>& out, Get get) {
    for (int shift : {0, 32}) {
      for (size_t n = 0; n < count_; ++n) {
        out[n] = get(brick_.splats[n]);
        codes_[n] = static_cast<uint32_t>(std::bit_cast<uint64_t>(out[n]) >> shift);
      }
      addPredicted(codes_);
    }
  }

  const RootCube& root_;
  const BrickSplats& brick_;
  DecodedGeometry& decoded_;
  const size_t count_;
  GeometryHeader header_{};
  PlaneWriter planes_;
  size_t arrays_ = 0;
  std::vector<Row> sample_;
  std::vector<uint32_t> codes_, residuals_;
  std::vector<double> targets_;
  std::vector<int> steps_;  // of weights
};

}  // namespace

std::vector<std::byte> encodeGeometryStream(const RootCube& root, const BrickSplats& brick,
                                            DecodedGeometry& decoded) {
  return GeometryEncoder(root, brick, decoded).encode();
}

}  // namespace curvisplat
