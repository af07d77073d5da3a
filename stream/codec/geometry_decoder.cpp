#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "stream/base/error.h"
#include "stream/codec/geometry_codec.h"
#include "stream/codec/geometry_steps.h"
#include "stream/codec/planes.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

class GeometryDecoder {
 public:
  GeometryDecoder(const GeometryHeader& header, uint32_t count, PlaneReader& planes, DecodedGeometry& out)
      : header_(header), count_(count), planes_(planes), out_(out) {
    out_.resize(count);
    codes().resize(count);
  }

  void decode() {
    decodeRuns();
    decodePositions();
    if (header_.raw & kRawShapes) {
      for (auto* arrays : {&out_.axis, &out_.shear})
        for (auto& array : *arrays) readRaw(array);
    } else {
      decodeShapes();
    }
    decodeWeights();
    decodeBorders();
    decodeGrowth();
    checkFinite();
  }

 private:
  static std::vector<uint32_t>& codes() {
    thread_local std::vector<uint32_t> scratch;
    return scratch;
  }

  void decodeRuns() {
    std::span<const std::byte> bytes = planes_.bytes(header_.runs_bytes);
    out_.runs.clear();
    NodeRun run;
    const auto take = [&](uint64_t& value) {
      const uint64_t code = takeVarint(bytes);
      value += code >> 1 ^ (0 - (code & 1));
    };
    uint64_t total = 0;
    while (!bytes.empty()) {
      uint64_t block = run.block;
      take(block);
      take(run.k), take(run.j), take(run.i), take(run.count);
      if (block > std::numeric_limits<uint32_t>::max() || run.count == 0 || run.count > count_ - total ||
          run.i > std::numeric_limits<uint64_t>::max() - run.count)
        throw Error("node run {} is invalid", out_.runs.size());
      run.block = static_cast<uint32_t>(block);
      total += run.count;
      out_.runs.push_back(run);
    }
    if (header_.runs_bytes != 0 && total != count_)
      throw Error("its node runs hold {} nodes (expected {})", total, count_);
    out_.rows = rowsOf(out_.runs, count_);
  }

  void decodePositions() {
    const int bits = header_.position_bits;
    out_.position_bits = bits;
    uint32_t any = 0;
    for (auto& position : out_.position) {
      readPredicted(position);
      for (uint32_t value : position) any |= value;
    }
    if (static_cast<int>(std::bit_width(any)) > bits) throw Error("a position is outside of the cell");
  }

  void decodeShapes() {
    decodeLogs(header_.log_axis0, kAxisStep, out_.axis[0]);
    decodeLogs(header_.log_axis1, kAxisStep, out_.axis[1]);
    decodeLogs(header_.log_volume, kVolumeStep, out_.axis[2]);
    double *a0 = out_.axis[0].data(), *a1 = out_.axis[1].data(), *a2 = out_.axis[2].data();
    for (size_t n = 0; n < count_; ++n) a2[n] /= a0[n] * a1[n];
    decodeShear(2, ShearSteps::l21);
    decodeShear(0, ShearSteps::l10);
    decodeShear(1, ShearSteps::l20);
  }

  void decodeLogs(double base, double step, std::vector<double>& out) {
    auto& codes = GeometryDecoder::codes();
    readPredicted(codes);
    uint32_t any = 0;
    for (uint32_t code : codes) any |= code;
    if (any > kLargestLogCode) throw Error("the code of an axis or a volume is out of range");
    const LogTable table(base, step, any);
    for (size_t n = 0; n < count_; ++n) out[n] = table[codes[n]];
  }

  template <typename StepOf>
  void decodeShear(int which, StepOf step_of) {
    auto& codes = GeometryDecoder::codes();
    readPredicted(codes);
    double* out = out_.shear[which].data();
    for (size_t n = 0; n < count_; ++n) out[n] = static_cast<int32_t>(codes[n]) * step_of(out_, n);
  }

  void decodeWeights() {
    if (header_.raw & kRawWeights) return readRaw(out_.weight);
    auto& codes = GeometryDecoder::codes();
    // Weights that differ from the volume follow no pattern along the rows, so they are not predicted.
    if (const Predictor predictor = readResiduals(codes); predictor != Predictor::kNone)
      throw Error("its weight array has predictor {} (expected 0: none)", static_cast<int>(predictor));
    const LogTable& ratios = ratioTable();
    const double *a0 = out_.axis[0].data(), *a1 = out_.axis[1].data(), *a2 = out_.axis[2].data();
    double* weight = out_.weight.data();
    for (size_t n = 0; n < count_; ++n) weight[n] = a0[n] * a1[n] * a2[n];
    for (size_t n = 0; n < count_; ++n) {
      if (codes[n] == kVolumeWeight) continue;
      const auto steps = static_cast<int32_t>(unzigzag(codes[n] - 1));
      if (std::abs(steps) > kLargestWeightCode) throw Error("the code of a weight is out of range");
      weight[n] =
          codes[n] == kZeroWeight ? 0 : weight[n] * ratios[static_cast<uint32_t>(steps + kLargestWeightCode)];
    }
  }

  void decodeBorders() {
    std::fill(out_.border_code.begin(), out_.border_code.end(), kNoBorder);
    if (!(header_.raw & kHasBorders)) return;
    auto& codes = GeometryDecoder::codes();
    uint32_t any = 0;
    for (int shift = 0; shift < 32; shift += 8) {
      readPredicted(codes);
      for (size_t n = 0; n < count_; ++n) {
        any |= codes[n];
        out_.border_code[n] |= codes[n] << shift;
      }
    }
    bool fine = any <= 0xff;
    for (uint32_t border_code : out_.border_code) fine &= isPossibleBorderCode(border_code);
    if (!fine) throw Error("a border code is invalid");
  }

  void decodeGrowth() {
    std::fill(out_.growth_code.begin(), out_.growth_code.end(), kNoGrowth);
    if (!(header_.raw & kHasGrowth)) return;
    auto& codes = GeometryDecoder::codes();
    readPredicted(out_.growth_code);
    readPredicted(codes);
    bool fine = true;
    for (size_t n = 0; n < count_; ++n) {
      fine &= out_.growth_code[n] >> kGrowthBitsOfFirstArray == 0 &&
              codes[n] >> (32 - kGrowthBitsOfFirstArray) == 0;
      out_.growth_code[n] |= codes[n] << kGrowthBitsOfFirstArray;
      fine &= isPossibleGrowthCode(out_.growth_code[n]);
    }
    if (!fine) throw Error("a growth code is invalid");
  }

  /// Throws Error for infinite or NaN numbers, and for axes or weights out of range. One comparison per
  /// element and no branches.
  void checkFinite() const {
    constexpr double kLargest = std::numeric_limits<float>::max();  // they are converted to floats
    bool fine = true;
    for (const auto& array : out_.axis)
      for (double value : array) fine &= value > 0 && value <= kLargest;
    for (const auto& array : out_.shear)
      for (double value : array) fine &= std::abs(value) <= kLargest;
    for (double value : out_.weight) fine &= value >= 0 && value <= kLargest;
    if (!fine) throw Error("the shape or weight of a splat is not finite or not positive");
  }

  Predictor readResiduals(std::span<uint32_t> out) {
    const ArrayCode code = header_.arrays[array_++];
    planes_.values(code.planes, out);
    return code.predictor;
  }

  void readPredicted(std::span<uint32_t> out) {
    const Predictor predictor = readResiduals(out);
    uint32_t* values = out.data();
    for (size_t n = 0; n < out.size(); ++n) values[n] = unzigzag(values[n]);
    if (predictor == Predictor::kNone) return;
    predictRows(predictor, out_.rows, values,
                [values](uint32_t n, uint32_t predicted) { return values[n] += predicted; });
  }

  void readRaw(std::vector<double>& out) {
    auto& codes = GeometryDecoder::codes();
    std::vector<uint32_t> low(count_);
    readPredicted(low);
    readPredicted(codes);
    for (size_t n = 0; n < count_; ++n) out[n] = std::bit_cast<double>(uint64_t{codes[n]} << 32 | low[n]);
  }

  const GeometryHeader& header_;
  const uint32_t count_;
  PlaneReader& planes_;
  DecodedGeometry& out_;
  size_t array_ = 0;
};

size_t arraysOf(const GeometryHeader& header) {
  return 3 + (header.raw & kRawShapes ? 12 : 6) + (header.raw & kRawWeights ? 2 : 1) +
         (header.raw & kHasBorders ? 4 : 0) + (header.raw & kHasGrowth ? 2 : 0);
}

}  // namespace

void DecodedGeometry::resize(size_t count) {
  for (auto& array : position) array.resize(count);
  for (auto* arrays : {&axis, &shear})
    for (auto& array : *arrays) array.resize(count);
  weight.resize(count);
  border_code.resize(count);
  growth_code.resize(count);
}

void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedGeometry& out) {
  GeometryHeader header;
  if (bytes.size() < sizeof header)
    throw Error("it ends in its header (found {} bytes, expected at least {})", bytes.size(), sizeof header);
  std::memcpy(&header, bytes.data(), sizeof header);
  const int lattice_bits = kPositionBits - static_cast<int>(cell.level);
  if (header.position_bits < kMinPositionBits ||
      header.position_bits > std::min(kMaxPositionBits, lattice_bits))
    throw Error("it has {} bits per position (expected {} to {})", header.position_bits, kMinPositionBits,
                std::min(kMaxPositionBits, lattice_bits));
  if (header.raw > (kRawShapes | kRawWeights | kHasBorders | kHasGrowth) ||
      header.runs_bytes > kMaxRunBytes * count)
    throw Error("its header is invalid");
  size_t unpacked = header.runs_bytes;
  for (size_t n = 0; n < arraysOf(header); ++n) {
    if (!isPossible(header.arrays[n])) throw Error("its header is invalid");
    unpacked += size_t{header.arrays[n].planes} * count;
  }
  PlaneReader planes(bytes.subspan(sizeof header), unpacked);
  GeometryDecoder(header, count, planes, out).decode();
}

uint64_t latticePosition(uint32_t code, int position_bits, uint32_t level, uint32_t cell_at) {
  const int lattice_bits = kPositionBits - static_cast<int>(level);
  const int dropped = lattice_bits - position_bits;
  const uint64_t middle = dropped == 0 ? 0 : uint64_t{1} << (dropped - 1);
  return uint64_t{cell_at} << lattice_bits | uint64_t{code} << dropped | middle;
}

}  // namespace curvisplat
