#include "stream/geometry_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "stream/error.h"
#include "stream/log_table.h"
#include "stream/planes.h"
#include "stream/shape_extent.h"

namespace curvisplat {
namespace {

constexpr double kKernelDeviation = 0.44655;
constexpr double kPositionError = 0.05;  // of the smallest standard deviation
constexpr int kLeastPositionBits = 5;    // merging's lattice of 32 voxels an axis
constexpr int kMostPositionBits = 32;

// Half a step is what a number can be off. With E = A⁻¹ A' - I lower triangular, |E00|, |E11| <= 0.0071,
// |E22| <= 0.0149 (it makes up for both, and for half a volume step) and each shear's entry <= 0.0138, the
// Frobenius norm of (I + E)(I + E)ᵀ - I, which bounds the spectral norm, is below 0.05.
constexpr double kAxisStep = 0.014;
constexpr double kShearStep = 0.027;
constexpr double kVolumeStep = 0.0016;
// Weights of nodes agree with the decoded volume within half a volume step and are then coded as 0.
constexpr double kWeightStep = 0.0019;

constexpr uint32_t kLargestLogCode = 0xffff;
constexpr double kLargestShearCode = 1e9;
constexpr int kLargestWeightCode = 100000;  // a ratio of e^±190

// Codes of weights: 0 is V = a0 a1 a2, 1 is V = 0, others are zigzag(steps) + 1.
constexpr uint32_t kVolumeWeight = 0, kZeroWeight = 1;

constexpr size_t kMostRunBytes = 50;  // five varints

int positionBits(const RootCube& root, const Cell& cell, double smallest_axis) {
  const double interval = 2 * kPositionError * kKernelDeviation * smallest_axis / std::sqrt(3.0);
  const double bits = std::ceil(std::log2(root.cellSize(cell.level) / interval));
  const int lattice_bits = kPositionBits - static_cast<int>(cell.level);
  return static_cast<int>(
      std::clamp(bits, 1.0 * kLeastPositionBits, 1.0 * std::min(kMostPositionBits, lattice_bits)));
}

/// The steps of the shears of splat n, which depend on its decoded axes and, for l10, on its decoded l21: an
/// error of l10 moves the third axis l21 times as far.
struct ShearSteps {
  static double l21(const DecodedGeometry& d, size_t n) { return kShearStep * d.axis[2][n] / d.axis[1][n]; }
  static double l10(const DecodedGeometry& d, size_t n) {
    const double lever = std::abs(d.shear[2][n]) * d.axis[1][n] / d.axis[2][n];
    return kShearStep * d.axis[1][n] / (d.axis[0][n] * std::max(1.0, lever));
  }
  static double l20(const DecodedGeometry& d, size_t n) { return kShearStep * d.axis[2][n] / d.axis[0][n]; }
};

/// e^(n kWeightStep) at n + kLargestWeightCode.
const LogTable& ratioTable() {
  static const LogTable table(-kWeightStep * kLargestWeightCode, kWeightStep, 2 * kLargestWeightCode);
  return table;
}

// ---- encoding ----

class GeometryEncoder {
 public:
  GeometryEncoder(const RootCube& root, const BrickSplats& brick, DecodedGeometry& decoded)
      : root_(root), brick_(brick), decoded_(decoded), count_(brick.size()) {
    decoded_.resize(count_);
    codes_.resize(count_);
    targets_.resize(count_);
    steps_.resize(count_);
    residuals_.resize(count_);
  }

  std::vector<std::byte> encode() {
    decoded_.runs = brick_.runs;
    decoded_.rows = rowsOf(brick_.runs, count_);
    sample_ = sampleOf(decoded_.rows);
    encodeRuns();
    encodePositions();
    // Shapes are tried first as they should be. What was already added is taken back if they don't fit.
    const PlaneWriter planes = planes_;
    const size_t arrays = arrays_;
    if (!encodeShapes()) {
      planes_ = planes;
      arrays_ = arrays;
      encodeRawShapes();
    }
    encodeWeights();
    return planes_.compress(std::as_bytes(std::span(&header_, 1)));
  }

 private:
  void encodeRuns() {
    std::vector<std::byte> bytes;
    NodeRun before;
    // Differences as zigzag varints: rows one after another cost a byte a number.
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
    const int bits = positionBits(root_, brick_.cell, smallestSingularValue(brick_.splats));
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
    if (!encodeLogs([](const Splat& s) { return std::log(s.axis[0]); }, kAxisStep, header_.log_axis0, axis0,
                    decoded_.axis[0]) ||
        !encodeLogs([](const Splat& s) { return std::log(s.axis[1]); }, kAxisStep, header_.log_axis1, axis1,
                    decoded_.axis[1]) ||
        !encodeLogs(
            [](const Splat& s) { return std::log(s.axis[0] * s.axis[1] * s.axis[2]); },
            kVolumeStep, header_.log_volume, volume, decoded_.axis[2]))
      return false;
    for (size_t n = 0; n < count_; ++n) decoded_.axis[2][n] /= decoded_.axis[0][n] * decoded_.axis[1][n];
    return encodeShear(2, ShearSteps::l21, [&](size_t n) { return brick_.splats[n].shear[2]; }) &&
           encodeShear(0, ShearSteps::l10, [&](size_t n) { return brick_.splats[n].shear[0]; }) &&
           encodeShear(1, ShearSteps::l20, [&](size_t n) {
             const auto& shear = brick_.splats[n].shear;
             return shear[1] + shear[2] * (decoded_.shear[0][n] - shear[0]);
           });
  }

  template <typename Log>
  bool encodeLogs(Log log, double step, double& base, LogTable& table, std::vector<double>& out) {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (size_t n = 0; n < count_; ++n) {
      targets_[n] = log(brick_.splats[n]);
      least = std::min(least, targets_[n]);
      most = std::max(most, targets_[n]);
    }
    if (!((most - least) / step < kLargestLogCode)) return false;
    base = least;
    table = LogTable(least, step, static_cast<uint32_t>((most - least) / step) + 1);
    for (size_t n = 0; n < count_; ++n) {
      codes_[n] = static_cast<uint32_t>((targets_[n] - least) / step + 0.5);
      out[n] = table[codes_[n]];
    }
    addPredicted(codes_);
    return true;
  }

  /// In a closed loop: each shear is predicted from decoded ones.
  template <typename StepOf, typename Target>
  bool encodeShear(int which, StepOf step_of, Target target) {
    for (size_t n = 0; n < count_; ++n) {
      targets_[n] = target(n);
      steps_[n] = step_of(decoded_, n);
    }
    const Predictor predictor = bestPredictor(sample_, targets_, steps_);
    auto& out = decoded_.shear[which];
    bool fits = true;
    predictRows(predictor, decoded_.rows, out.data(), [&](uint32_t n, double predicted) {
      const double code = std::nearbyint((targets_[n] - predicted) / steps_[n]);
      fits &= std::abs(code) < kLargestShearCode;  // false for NaN
      const int32_t kept = fits ? static_cast<int32_t>(code) : 0;
      residuals_[n] = zigzag(static_cast<uint32_t>(kept));
      return out[n] = predicted + kept * steps_[n];
    });
    header_.arrays[arrays_++] = {predictor, planes_.add(residuals_)};
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
    for (size_t n = 0; n < count_ && fits; ++n) {
      const double volume = decoded_.axis[0][n] * decoded_.axis[1][n] * decoded_.axis[2][n];
      const double ratio = brick_.splats[n].weight / volume;
      if (std::abs(ratio - 1) < 0.5 * kWeightStep) {
        codes_[n] = kVolumeWeight;
        decoded_.weight[n] = volume;
      } else if (brick_.splats[n].weight == 0) {
        codes_[n] = kZeroWeight;
        decoded_.weight[n] = 0;
      } else {
        const double steps = std::nearbyint(std::log(ratio) / kWeightStep);
        fits = std::abs(steps) <= kLargestWeightCode;
        const int kept = fits ? static_cast<int>(steps) : 0;
        codes_[n] = kept == 0 ? kVolumeWeight : zigzag(static_cast<uint32_t>(kept)) + 1;
        decoded_.weight[n] = kept == 0 ? volume : volume * ratioTable()[kept + kLargestWeightCode];
      }
    }
    if (fits) {
      header_.arrays[arrays_++] = {Predictor::none, planes_.add(codes_)};
    } else {
      header_.raw |= kRawWeights;
      addRaw(decoded_.weight, [](const Splat& s) { return s.weight; });
    }
  }

  void addPredicted(std::span<const uint32_t> values) {
    const Predictor predictor = bestPredictor(sample_, values);
    predictRows(predictor, decoded_.rows, values.data(), [&](uint32_t n, uint32_t predicted) {
      residuals_[n] = zigzag(values[n] - predicted);
      return values[n];
    });
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
  std::vector<double> targets_, steps_;
};

// ---- decoding ----

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
        throw Error("run {} of its nodes is impossible", out_.runs.size());
      run.block = static_cast<uint32_t>(block);
      total += run.count;
      out_.runs.push_back(run);
    }
    if (header_.runs_bytes != 0 && total != count_)
      throw Error("its node runs hold {} nodes, not {}", total, count_);
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
    if (static_cast<int>(std::bit_width(any)) > bits) throw Error("a position in it is outside the cell");
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
    if (any > kLargestLogCode) throw Error("a size in it is out of range");
    const LogTable table(base, step, any);
    for (size_t n = 0; n < count_; ++n) out[n] = table[codes[n]];
  }

  template <typename StepOf>
  void decodeShear(int which, StepOf step_of) {
    auto& codes = GeometryDecoder::codes();
    const Predictor predictor = readResiduals(codes);
    double* out = out_.shear[which].data();
    for (size_t n = 0; n < count_; ++n) out[n] = static_cast<int32_t>(unzigzag(codes[n])) * step_of(out_, n);
    predictRows(predictor, out_.rows, out,
                [out](uint32_t n, double predicted) { return out[n] += predicted; });
  }

  void decodeWeights() {
    if (header_.raw & kRawWeights) return readRaw(out_.weight);
    auto& codes = GeometryDecoder::codes();
    // Not predicted: what makes a weight differ from the volume has no order.
    if (readResiduals(codes) != Predictor::none) throw Error("its weights are predicted");
    const LogTable& ratios = ratioTable();
    const double *a0 = out_.axis[0].data(), *a1 = out_.axis[1].data(), *a2 = out_.axis[2].data();
    double* weight = out_.weight.data();
    for (size_t n = 0; n < count_; ++n) weight[n] = a0[n] * a1[n] * a2[n];
    for (size_t n = 0; n < count_; ++n) {
      if (codes[n] == kVolumeWeight) continue;
      const auto steps = static_cast<int32_t>(unzigzag(codes[n] - 1));
      if (std::abs(steps) > kLargestWeightCode) throw Error("a weight in it is out of range");
      weight[n] =
          codes[n] == kZeroWeight ? 0 : weight[n] * ratios[static_cast<uint32_t>(steps + kLargestWeightCode)];
    }
  }

  /// Infinite or NaN numbers, and axes or weights that cannot be: one comparison an array element, no
  /// branches.
  void checkFinite() const {
    constexpr double kLargest = std::numeric_limits<float>::max();  // floats is what they become
    bool fine = true;
    for (const auto& array : out_.axis)
      for (double value : array) fine &= value > 0 && value <= kLargest;
    for (const auto& array : out_.shear)
      for (double value : array) fine &= std::abs(value) <= kLargest;
    for (double value : out_.weight) fine &= value >= 0 && value <= kLargest;
    if (!fine) throw Error("a splat in it has an impossible shape or weight");
  }

  Predictor readResiduals(std::span<uint32_t> out) {
    const ArrayCode code = header_.arrays[array_++];
    if (static_cast<int>(code.predictor) >= kPredictors) throw Error("an array in it has no known predictor");
    planes_.values(code.planes, out);
    return code.predictor;
  }

  void readPredicted(std::span<uint32_t> out) {
    const Predictor predictor = readResiduals(out);
    uint32_t* values = out.data();
    for (size_t n = 0; n < out.size(); ++n) values[n] = unzigzag(values[n]);
    if (predictor == Predictor::none) return;
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
  return 3 + (header.raw & kRawShapes ? 12 : 6) + (header.raw & kRawWeights ? 2 : 1);
}

}  // namespace

void DecodedGeometry::resize(size_t count) {
  for (auto& array : position) array.resize(count);
  for (auto* arrays : {&axis, &shear})
    for (auto& array : *arrays) array.resize(count);
  weight.resize(count);
}

std::vector<std::byte> encodeGeometryStream(const RootCube& root, const BrickSplats& brick,
                                            DecodedGeometry& decoded) {
  return GeometryEncoder(root, brick, decoded).encode();
}

void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedGeometry& out) {
  GeometryHeader header;
  if (bytes.size() < sizeof header) throw Error("it has {} bytes, fewer than its header", bytes.size());
  std::memcpy(&header, bytes.data(), sizeof header);
  const int lattice_bits = kPositionBits - static_cast<int>(cell.level);
  if (header.position_bits < kLeastPositionBits ||
      header.position_bits > std::min(kMostPositionBits, lattice_bits))
    throw Error("it has {} bits a position", header.position_bits);
  if (header.raw > (kRawShapes | kRawWeights) || header.runs_bytes > kMostRunBytes * count)
    throw Error("its header is impossible");
  size_t unpacked = header.runs_bytes;
  for (size_t n = 0; n < arraysOf(header); ++n) unpacked += size_t{header.arrays[n].planes} * count;
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
