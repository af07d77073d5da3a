#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "stream/base/error.h"
#include "stream/base/threads.h"
#include "stream/codec/geometry_codec.h"
#include "stream/codec/planes.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

/// The numbers of a splat beside its place.
struct Shape {
  double a0, a1, a2, l10, l20, l21, weight;

  /// Finite, positive, and in the range of a float. Without branches.
  bool isFine() const {
    constexpr double kLargest = std::numeric_limits<float>::max();
    const auto positive = [](double value) { return (value > 0) & (value <= kLargest); };
    const auto finite = [](double value) { return std::abs(value) <= kLargest; };
    return positive(a0) & positive(a1) & positive(a2) & finite(l10) & finite(l20) & finite(l21) &
           (weight >= 0) & (weight <= kLargest);
  }
};

double axisAs(double value, double) {
  return value;
}
float axisAs(double value, float) {
  return std::max(static_cast<float>(value), std::numeric_limits<float>::min());
}

/// The arrays of codes of one stream, as long as it is decoded.
struct ShapeCodes {
  // a0, a1, volume, l21, l10, l20 and weight, or the low and the high halves of doubles: a0, a1, a2, l10, l20, l21, weight.
  std::array<std::vector<uint32_t>, 14> arrays;
  std::vector<uint32_t> scratch;
};

template <typename Number>
class GeometryDecoder {
 public:
  GeometryDecoder(const GeometryHeader& header, uint32_t count, PlaneReader& planes, DecodedPlaces& places,
                  const ShapeArrays<Number>& shapes)
      : header_(header), count_(count), planes_(planes), out_(places), shapes_(shapes) {
    for (auto& array : out_.position) array.resize(count);
    out_.border_code.resize(count);
    out_.growth_code.resize(count);
    codes().scratch.resize(count);
  }

  void decode() {
    decodeRuns();
    decodePositions();
    readShapes();
    if (header_.raw & kRawShapes)
      decodeWeights([this](size_t n) { return rawShape(n); });
    else
      decodeCodedShapes();
    decodeBorders();
    decodeGrowth();
  }

 private:
  static ShapeCodes& codes() {
    static const PerThread<ShapeCodes> codes;
    return codes.own();
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

  /// Codes and halves of shapes and weights, in the order of the stream.
  void readShapes() {
    const bool raw = header_.raw & kRawShapes;
    for (size_t n = 0; n < (raw ? 12 : 6); ++n) readPredicted(arrayOfShape(n));
    if (header_.raw & kRawWeights) {
      for (size_t n : {12, 13}) readPredicted(arrayOfShape(n));
    } else if (const Predictor predictor = readResiduals(arrayOfShape(12)); predictor != Predictor::kNone) {
      // Weights that differ from the volume follow no pattern along the rows, so they are not predicted.
      throw Error("its weight array has predictor {} (expected 0: none)", static_cast<int>(predictor));
    }
  }

  std::vector<uint32_t>& arrayOfShape(size_t n) {
    std::vector<uint32_t>& array = codes().arrays[n];
    array.resize(count_);
    return array;
  }

  double rawNumber(size_t which, size_t n) const {
    const auto& arrays = codes().arrays;
    return std::bit_cast<double>(uint64_t{arrays[2 * which + 1][n]} << 32 | arrays[2 * which][n]);
  }

  Shape rawShape(size_t n) const {
    return {rawNumber(0, n),
            rawNumber(1, n),
            rawNumber(2, n),
            rawNumber(3, n),
            rawNumber(4, n),
            rawNumber(5, n),
            0};
  }

  void decodeCodedShapes() {
    const auto& arrays = codes().arrays;
    const auto tableOf = [&](size_t which, double base, double step) {
      uint32_t any = 0;
      for (uint32_t code : arrays[which]) any |= code;
      if (any > kLargestLogCode) throw Error("the code of an axis or a volume is out of range");
      return LogTable(base, step, any);
    };
    const LogTable axis0 = tableOf(0, header_.log_axis0, kAxisStep);
    const LogTable axis1 = tableOf(1, header_.log_axis1, kAxisStep);
    const LogTable volume = tableOf(2, header_.log_volume, kVolumeStep);
    const uint32_t *c0 = arrays[0].data(), *c1 = arrays[1].data(), *c2 = arrays[2].data();
    const uint32_t *c21 = arrays[3].data(), *c10 = arrays[4].data(), *c20 = arrays[5].data();
    decodeWeights([&](size_t n) {
      Shape shape;
      shape.a0 = axis0[c0[n]];
      shape.a1 = axis1[c1[n]];
      shape.a2 = volume[c2[n]] / (shape.a0 * shape.a1);
      shape.l21 = static_cast<int32_t>(c21[n]) * ShearSteps::l21(shape.a1, shape.a2);
      shape.l10 = static_cast<int32_t>(c10[n]) * ShearSteps::l10(shape.a0, shape.a1, shape.a2, shape.l21);
      shape.l20 = static_cast<int32_t>(c20[n]) * ShearSteps::l20(shape.a0, shape.a2);
      return shape;
    });
  }

  template <typename ShapeOf>
  void decodeWeights(const ShapeOf& shape_of) {
    if (header_.raw & kRawWeights)
      return store(shape_of, [&](const Shape&, size_t n) { return rawNumber(6, n); });
    const LogTable& ratios = ratioTable();
    const uint32_t* code = codes().arrays[12].data();
    store(shape_of, [&, code](const Shape& shape, size_t n) {
      const double volume = shape.a0 * shape.a1 * shape.a2;
      if (code[n] == kVolumeWeight) return volume;
      const auto steps = static_cast<int32_t>(unzigzag(code[n] - 1));
      if (std::abs(steps) > kLargestWeightCode) throw Error("the code of a weight is out of range");
      return code[n] == kZeroWeight ? 0.0
                                    : volume * ratios[static_cast<uint32_t>(steps + kLargestWeightCode)];
    });
  }

  /// Throws Error for infinite or NaN numbers, and for axes or weights out of range.
  template <typename ShapeOf, typename WeightOf>
  void store(const ShapeOf& shape_of, const WeightOf& weight_of) {
    bool fine = true;
    for (size_t n = 0; n < count_; ++n) {
      Shape shape = shape_of(n);
      shape.weight = weight_of(shape, n);
      fine &= shape.isFine();
      const std::array axis{shape.a0, shape.a1, shape.a2}, shear{shape.l10, shape.l20, shape.l21};
      for (size_t c = 0; c < 3; ++c) {
        shapes_.axis[c][n] = axisAs(axis[c], Number());
        shapes_.shear[c][n] = static_cast<Number>(shear[c]);
      }
      shapes_.weight[n] = static_cast<Number>(shape.weight);
    }
    if (!fine) throw Error("the shape or weight of a splat is not finite or not positive");
  }

  void decodeBorders() {
    std::fill(out_.border_code.begin(), out_.border_code.end(), kNoBorder);
    if (!(header_.raw & kHasBorders)) return;
    auto& codes = GeometryDecoder::codes().scratch;
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
    auto& codes = GeometryDecoder::codes().scratch;
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

  const GeometryHeader& header_;
  const uint32_t count_;
  PlaneReader& planes_;
  DecodedPlaces& out_;
  const ShapeArrays<Number>& shapes_;
  size_t array_ = 0;
};

size_t arraysOf(const GeometryHeader& header) {
  return 3 + (header.raw & kRawShapes ? 12 : 6) + (header.raw & kRawWeights ? 2 : 1) +
         (header.raw & kHasBorders ? 4 : 0) + (header.raw & kHasGrowth ? 2 : 0);
}

template <typename Number>
void decodeStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes, DecodedPlaces& places,
                  const ShapeArrays<Number>& shapes) {
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
  GeometryDecoder<Number>(header, count, planes, places, shapes).decode();
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
  out.resize(count);
  const ShapeArrays<double> shapes{{out.axis[0].data(), out.axis[1].data(), out.axis[2].data()},
                                   {out.shear[0].data(), out.shear[1].data(), out.shear[2].data()},
                                   out.weight.data()};
  decodeStream(cell, count, bytes, out, shapes);
}

void decodeGeometryStream(const Cell& cell, uint32_t count, std::span<const std::byte> bytes,
                          DecodedPlaces& places, const ShapeArrays<float>& shapes) {
  decodeStream(cell, count, bytes, places, shapes);
}

uint64_t latticePosition(uint32_t code, int position_bits, uint32_t level, uint32_t cell_at) {
  const int lattice_bits = kPositionBits - static_cast<int>(level);
  const int dropped = lattice_bits - position_bits;
  const uint64_t middle = dropped == 0 ? 0 : uint64_t{1} << (dropped - 1);
  return uint64_t{cell_at} << lattice_bits | uint64_t{code} << dropped | middle;
}

}  // namespace curvisplat
