#include "stream/codec/values_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "stream/base/error.h"
#include "stream/base/threads.h"
#include "stream/codec/planes.h"

namespace curvisplat {
namespace {

constexpr double kMeanSteps = 65535, kFineMeanSteps = 16777215;
constexpr double kSlopeSteps = 1024, kFineSlopeSteps = 8192;
constexpr double kDeviationSteps = 4096;
constexpr size_t kMaxRowBytes = 10;  // two varints of up to 32 bits

// An array code whose predictor applies to the differences in time.
constexpr uint8_t kInTime = 8;
// An array code of means in kFineMeanSteps; of means, or of the first slope for all slopes and the deviation, by their own
// scale.
constexpr uint8_t kFine = 16, kScaled = 32;

// Limits of kAuto: values are coded by their own scale where steps are wider than these shares of the spread.
constexpr double kWidestMeanStep = 1.0 / 1000, kWidestSlopeStep = 1.0 / 450;

Predictor coded(Predictor predictor, bool in_time) {
  return static_cast<Predictor>(static_cast<uint8_t>(predictor) | (in_time ? kInTime : 0));
}
bool isInTime(const ArrayCode& code) {
  return (static_cast<uint8_t>(code.predictor) & kInTime) != 0;
}
ArrayCode spatialPart(const ArrayCode& code) {
  return {static_cast<Predictor>(static_cast<uint8_t>(code.predictor) & ~kInTime), code.planes};
}

bool has(const ArrayCode& code, uint8_t flag) {
  return (static_cast<uint8_t>(code.predictor) & flag) != 0;
}
void set(ArrayCode& code, uint8_t flags) {
  code.predictor = static_cast<Predictor>(static_cast<uint8_t>(code.predictor) | flags);
}
/// The header without the flags that Scale reads.
ValuesHeader withoutFlags(ValuesHeader header) {
  const auto clear = [](ArrayCode& code, uint8_t flags) {
    code.predictor = static_cast<Predictor>(static_cast<uint8_t>(code.predictor) & ~flags);
  };
  clear(header.arrays[0], kFine | kScaled);
  clear(header.arrays[1], kScaled);
  return header;
}

// Codes of numbers by their own scale: `bits` bits of the floating-point number 1 + |x| behind its leading one, and its
// exponent before them. Nothing but bits and exact operations: all processors get the same.
constexpr int kMeanBits = 10, kSlopeBits = 9;
static_assert(kLargestErrorByScale == 0.5 / (1 << kMeanBits));
constexpr uint64_t kBitsOfOne = std::bit_cast<uint64_t>(1.0);
constexpr int64_t kLargestExponent = 1000;

int32_t scaledCode(double x, int bits) {
  const int shift = 52 - bits;
  const uint64_t above_one = std::bit_cast<uint64_t>(1 + std::abs(x)) - kBitsOfOne;
  const auto code = static_cast<int32_t>((above_one + (uint64_t{1} << (shift - 1))) >> shift);
  return x < 0 ? -code : code;
}
double scaledNumber(uint32_t stored, int bits) {
  const auto code = static_cast<int32_t>(stored);
  const auto size = static_cast<uint64_t>(std::min(std::abs(int64_t{code}), kLargestExponent << bits));
  const double number = std::bit_cast<double>(kBitsOfOne + (size << (52 - bits))) - 1;
  return code < 0 ? -number : number;
}

/// The values that codes stand for. Shared by encoder and decoder.
struct Scale {
  explicit Scale(const ValuesHeader& header)
      : lower(header.lower),
        mean_steps(has(header.arrays[0], kFine) ? kFineMeanSteps : kMeanSteps),
        mean_step((double{header.upper} - double{header.lower}) / mean_steps),
        slope_step(header.slope_step),
        deviation_step(header.deviation_step),
        scaled_means(has(header.arrays[0], kScaled)),
        scaled(has(header.arrays[1], kScaled)),
        spread{header.deviation_step, header.slope_step} {}

  // Converts from signed integers, which vectorises; conversion from unsigned ones does not.
  float mean(uint32_t code) const {
    return static_cast<float>(lower + static_cast<int32_t>(code) * mean_step);
  }
  float slope(uint32_t code) const { return bounded(static_cast<int32_t>(code) * slope_step); }
  float variance(uint32_t code) const {
    const double deviation = static_cast<int32_t>(code) * deviation_step;
    return bounded(deviation * deviation);
  }
  float scaledMean(uint32_t code) const {
    return bounded(spread.centre + scaledNumber(code, kMeanBits) * spread.scale);
  }
  /// `mean`: the splat's decoded one.
  float scaledSlope(uint32_t code, float mean) const {
    return bounded(scaledNumber(code, kSlopeBits) * spread.scaleAt(mean));
  }
  float scaledVariance(uint32_t code, float mean) const {
    const double deviation = scaledNumber(code, kSlopeBits) * spread.scaleAt(mean);
    return bounded(deviation * deviation);
  }
  /// Limits a value to the range of floats: variances of scalars above 1e19 exceed it.
  static float bounded(double value) {
    constexpr double kLargest = std::numeric_limits<float>::max();
    return static_cast<float>(std::clamp(value, -kLargest, kLargest));
  }

  double lower, mean_steps, mean_step, slope_step, deviation_step;
  bool scaled_means, scaled;  // means; slopes and deviation
  ValueSpread spread;         // if any is
};

/// The codes that the references have for an array, in the steps of the stream that they predict.
class TimePrediction {
 public:
  TimePrediction(const ValuesHeader& header, const TimeReferences& references)
      : scale_(header), references_(references) {
    const auto& back = references.steps_back;
    if (back[1] > back[0]) ratio_ = static_cast<double>(back[0]) / (back[1] - back[0]);
  }

  /// codes: [splat]. `means`: the decoded ones, for the arrays after them.
  void predict(size_t array, std::span<const float> means, std::span<uint32_t> codes) const {
    const double step = array == 0   ? scale_.mean_step
                        : array == 4 ? scale_.deviation_step
                                     : scale_.slope_step;
    const double least = array == 0 || array == 4 ? 0.0 : -kLargestCode;
    const double most = array == 0 ? scale_.mean_steps : kLargestCode;
    const double origin = array == 0 ? scale_.lower : 0.0;
    const float* const first = arrayOf(0, array);
    const float* const second = ratio_ > 0 ? arrayOf(1, array) : nullptr;
    const auto value = [array](float stored) {
      return array == 4 ? std::sqrt(double{stored}) : double{stored};
    };
    for (size_t n = 0; n < codes.size(); ++n) {
      double expected = value(first[n]);
      if (second) expected += (expected - value(second[n])) * ratio_;
      if (array == 0 ? scale_.scaled_means : scale_.scaled) {
        const double unit = array == 0 ? scale_.spread.scale : scale_.spread.scaleAt(means[n]);
        if (array == 0) expected -= scale_.spread.centre;
        codes[n] = static_cast<uint32_t>(scaledCode((array == 4 ? std::max(expected, 0.0) : expected) / unit,
                                                    array == 0 ? kMeanBits : kSlopeBits));
        continue;
      }
      const double code = step > 0 ? std::clamp((expected - origin) / step, least, most) : 0.0;
      codes[n] = static_cast<uint32_t>(static_cast<int32_t>(std::lrint(code)));
    }
  }

 private:
  static constexpr double kLargestCode = 1 << 30;

  const float* arrayOf(size_t reference, size_t array) const {
    const VariableArrays<const float>& from = references_.values[reference];
    const float* const arrays[] = {from.mean, from.slope0, from.slope1, from.slope2, from.variance};
    return arrays[array];
  }

  const Scale scale_;
  const TimeReferences& references_;
  double ratio_ = 0;  // how far the change between the references goes on; 0: one reference
};

/// An array is predicted in time only where that takes clearly fewer bits: the estimate is no exact one.
constexpr double kWorthwhile = 0.97;

class ValuesEncoder {
 public:
  ValuesEncoder(std::span<const Row> rows, std::span<SplatScalar> values, const TimeReferences& references,
                const ValueCoding& coding)
      : coding_(coding),
        fine_(coding.precision == ValuePrecision::kFine),
        rows_(rows),
        values_(values),
        references_(references),
        sample_(sampleOf(rows)),
        means_(values.size()),
        residuals_(values.size()) {
    for (auto& codes : codes_) codes.resize(values.size());
  }

  std::vector<std::byte> encode() {
    findScale();
    quantise();
    bool across_rows = false;
    std::array<Predictor, 5> predictors;
    std::array<bool, 5> in_time{};
    for (size_t a = 0; a < codes_.size(); ++a) {
      predictors[a] = choosePredictor(a, in_time[a]);
      across_rows |= predictors[a] >= Predictor::kAbove;
    }
    if (std::any_of(in_time.begin(), in_time.end(), [](bool used) { return used; }))
      header_.steps_back = references_.steps_back;
    const Row whole{0, static_cast<uint32_t>(values_.size()), kNoRow};
    const std::span<const Row> rows = across_rows ? rows_ : std::span(&whole, 1);
    PlaneWriter planes;
    if (across_rows) addRows(planes);
    for (size_t a = 0; a < codes_.size(); ++a) {
      const std::vector<uint32_t>& codes = codes_[a];
      residualsOf(predictors[a], rows, codes.data(), residuals_.data());
      header_.arrays[a] = {coded(predictors[a], in_time[a]), planes.add(residuals_)};
    }
    setFlags();
    return planes.compress(std::as_bytes(std::span(&header_, 1)));
  }

 private:
  void findScale() {
    double lower = std::numeric_limits<double>::infinity(), upper = -lower, span = 0;
    for (const SplatScalar& value : values_) {
      lower = std::min(lower, value.mean);
      upper = std::max(upper, value.mean);
      span = std::max({span, std::abs(value.slope.x), std::abs(value.slope.y), std::abs(value.slope.z),
                       std::sqrt(value.variance)});
    }
    span = std::max(span, upper - lower);
    header_.lower = static_cast<float>(lower);
    header_.upper = static_cast<float>(upper);
    header_.slope_step = span / (fine_ ? kFineSlopeSteps : kSlopeSteps);
    header_.deviation_step = span / kDeviationSteps;
    if (coding_.precision == ValuePrecision::kAuto && coding_.spread.scale > 0) {
      scaled_ = header_.slope_step > kWidestSlopeStep * coding_.spread.scale;
      scaled_means_ = (upper - lower) / kMeanSteps > kWidestMeanStep * coding_.spread.scale;
      if (scaled_) {
        header_.slope_step = coding_.spread.scale;
        header_.deviation_step = coding_.spread.centre;
      }
    }
    setFlags();  // for Scale; encode() overwrites the codes
  }

  void setFlags() {
    if (fine_) set(header_.arrays[0], kFine);
    if (scaled_means_) set(header_.arrays[0], kScaled);
    if (scaled_) set(header_.arrays[1], kScaled);
  }

  void quantiseByScale(const Scale& scale) {
    for (size_t n = 0; n < values_.size(); ++n) {
      SplatScalar& value = values_[n];
      const auto mean = static_cast<float>(value.mean);
      const double unit = scale.spread.scaleAt(mean);
      for (int c = 0; c < 3; ++c) {
        codes_[1 + c][n] = static_cast<uint32_t>(scaledCode(value.slope[c] / unit, kSlopeBits));
        value.slope[c] = scale.scaledSlope(codes_[1 + c][n], mean);
      }
      codes_[4][n] = static_cast<uint32_t>(scaledCode(std::sqrt(value.variance) / unit, kSlopeBits));
      value.variance = scale.scaledVariance(codes_[4][n], mean);
    }
  }

  void quantise() {
    const Scale scale(header_);
    const auto over = [](double step) { return step > 0 ? 1 / step : 0.0; };
    const double means = over(scale.mean_step), slopes = over(scale.slope_step),
                 deviations = over(scale.deviation_step);
    for (size_t n = 0; n < values_.size(); ++n) {
      SplatScalar& value = values_[n];
      if (scaled_means_) {
        codes_[0][n] = static_cast<uint32_t>(
            scaledCode((value.mean - scale.spread.centre) / scale.spread.scale, kMeanBits));
        value.mean = scale.scaledMean(codes_[0][n]);
      } else {
        codes_[0][n] = static_cast<uint32_t>(
            std::clamp((value.mean - scale.lower) * means + 0.5, 0.0, scale.mean_steps));
        value.mean = scale.mean(codes_[0][n]);
      }
      means_[n] = static_cast<float>(value.mean);
      if (scaled_) continue;
      for (int c = 0; c < 3; ++c) {
        codes_[1 + c][n] = static_cast<uint32_t>(static_cast<int32_t>(std::lrint(value.slope[c] * slopes)));
        value.slope[c] = scale.slope(codes_[1 + c][n]);
      }
      codes_[4][n] = static_cast<uint32_t>(std::sqrt(value.variance) * deviations + 0.5);
      value.variance = scale.variance(codes_[4][n]);
    }
    if (scaled_) quantiseByScale(scale);
  }

  /// The predictor of an array. If it is one of the differences in time, these replace the codes.
  Predictor choosePredictor(size_t array, bool& in_time) {
    const PredictorChoice alone = bestPredictor(sample_, codes_[array]);
    if (references_.steps_back[0] == 0) return alone.predictor;
    std::vector<uint32_t>& differences = differences_;
    differences.resize(values_.size());
    TimePrediction(header_, references_).predict(array, means_, differences);
    for (size_t n = 0; n < differences.size(); ++n) differences[n] = codes_[array][n] - differences[n];
    const PredictorChoice timed = bestPredictor(sample_, differences);
    in_time = static_cast<double>(timed.bits) < kWorthwhile * static_cast<double>(alone.bits);
    if (in_time) codes_[array].swap(differences);
    return in_time ? timed.predictor : alone.predictor;
  }

  void addRows(PlaneWriter& planes) {
    std::vector<std::byte> bytes;
    for (const Row& row : rows_) {
      appendVarint(bytes, row.count);
      appendVarint(bytes, row.above == kNoRow ? 0 : row.first - row.above);
    }
    header_.rows_bytes = static_cast<uint32_t>(bytes.size());
    planes.addBytes(bytes);
  }

  const ValueCoding coding_;
  const bool fine_;
  bool scaled_means_ = false, scaled_ = false;  // the latter wherever the former
  std::span<const Row> rows_;
  std::span<SplatScalar> values_;
  const TimeReferences& references_;
  std::vector<Row> sample_;
  ValuesHeader header_{};
  std::array<std::vector<uint32_t>, 5> codes_;
  std::vector<float> means_;  // decoded
  std::vector<uint32_t> residuals_, differences_;
};

ValuesHeader headerOf(std::span<const std::byte> bytes) {
  ValuesHeader header;
  if (bytes.size() < sizeof header)
    throw Error("it ends in its header (found {} bytes, expected at least {})", bytes.size(), sizeof header);
  std::memcpy(&header, bytes.data(), sizeof header);
  return header;
}

std::vector<Row> rowsFrom(std::span<const std::byte> bytes, uint32_t count) {
  if (bytes.empty()) return {{0, count, kNoRow}};
  std::vector<Row> rows;
  uint32_t first = 0;
  while (!bytes.empty()) {
    const uint64_t length = takeVarint(bytes);
    const uint64_t distance = takeVarint(bytes);
    if (length == 0 || length > count - first || distance > first)
      throw Error("row {} is invalid", rows.size());
    const uint32_t above = distance == 0 ? kNoRow : first - static_cast<uint32_t>(distance);
    rows.push_back({first, static_cast<uint32_t>(length), above});
    first += static_cast<uint32_t>(length);
  }
  if (first != count) throw Error("its rows hold {} values (expected {})", first, count);
  return rows;
}

/// One comparison per element and no branches.
bool allFinite(std::span<const float> values) {
  bool fine = true;
  for (float value : values) fine &= std::abs(value) <= std::numeric_limits<float>::max();
  return fine;
}

}  // namespace

std::array<uint8_t, 2> stepsBackOf(std::span<const std::byte> stream) {
  const std::array<uint8_t, 2> back = headerOf(stream).steps_back;
  if (back[1] != 0 && (back[0] == 0 || back[1] <= back[0])) throw Error("its header is invalid");
  return back;
}

const char* featureOf(std::span<const std::byte> stream) {
  const ValuesHeader header = headerOf(stream);
  if (has(header.arrays[0], kFine)) return kFineValues;
  return has(header.arrays[0], kScaled) || has(header.arrays[1], kScaled) ? kScaledValues : nullptr;
}

double largestMeanError(const ValueCoding& coding, double lower, double upper, double mean) {
  const double range = upper - lower;
  if (coding.precision == ValuePrecision::kFine) return 0.5 / kFineMeanSteps * range;
  const bool scaled = coding.precision == ValuePrecision::kAuto && coding.spread.scale > 0 &&
                      range / kMeanSteps > kWidestMeanStep * coding.spread.scale;
  return scaled ? kLargestErrorByScale * coding.spread.scaleAt(mean) : 0.5 / kMeanSteps * range;
}

StreamErrors errorsOf(std::span<const std::byte> header, double largest_slope) {
  const ValuesHeader stored = headerOf(header);
  const Scale scale(stored);
  constexpr double kDeviation = 0.28867513459481287;  // of rounding to whole numbers
  StreamErrors errors{{scale.mean_step / 2, scale.mean_step * kDeviation},
                      {scale.slope_step / 2, scale.slope_step * kDeviation}};
  const double widest = std::max(scale.spread.scaleAt(stored.lower), scale.spread.scaleAt(stored.upper));
  const double mean_step = std::ldexp(1.0, -kMeanBits), slope_step = std::ldexp(1.0, -kSlopeBits);
  if (scale.scaled_means)
    errors.means = {mean_step / 2 * widest, mean_step * kDeviation * scale.spread.scale};
  if (scale.scaled)
    errors.slopes = {slope_step / 2 * (widest + largest_slope), slope_step * kDeviation * scale.spread.scale};
  return errors;
}

std::vector<std::byte> encodeValuesStream(std::span<const Row> rows, std::span<SplatScalar> values,
                                          const TimeReferences& references, const ValueCoding& coding) {
  return ValuesEncoder(rows, values, references, coding).encode();
}

void decodeValuesStream(uint32_t count, std::span<const std::byte> bytes, const VariableArrays<float>& out,
                        const TimeReferences& references) {
  const ValuesHeader stored = headerOf(bytes);
  const ValuesHeader header = withoutFlags(stored);
  const TimePrediction in_time(stored, references);
  const Scale scale(stored);
  const bool valid_spread =
      scale.spread.scale > 0 && std::isfinite(scale.spread.scale) && std::isfinite(scale.spread.centre);
  if ((scale.scaled_means && !scale.scaled) ||
      (scale.scaled && (!valid_spread || has(stored.arrays[0], kFine))))
    throw Error("its header is invalid");
  if (header.rows_bytes > kMaxRowBytes * count) throw Error("its header is invalid");
  size_t unpacked = header.rows_bytes;
  for (const ArrayCode& array : header.arrays) {
    const bool has_reference = header.steps_back[0] > 0 && references.steps_back == header.steps_back;
    if (!isPossible(spatialPart(array)) || (isInTime(array) && !has_reference))
      throw Error("its header is invalid");
    unpacked += size_t{array.planes} * count;
  }
  PlaneReader planes(bytes.subspan(sizeof header), unpacked);
  const std::vector<Row> rows = rowsFrom(planes.bytes(header.rows_bytes), count);

  static const PerThread<std::vector<uint32_t>> stored_codes, expected_codes;
  std::vector<uint32_t>&scratch = stored_codes.own(), &expected = expected_codes.own();
  scratch.resize(count);
  uint32_t* codes = scratch.data();
  const auto decode = [&](size_t array, float* values, auto value) {
    planes.values(header.arrays[array].planes, scratch);
    for (size_t n = 0; n < count; ++n) codes[n] = unzigzag(codes[n]);
    const Predictor predictor = spatialPart(header.arrays[array]).predictor;
    if (predictor != Predictor::kNone)
      predictRows(predictor, rows, codes,
                  [codes](uint32_t n, uint32_t predicted) { return codes[n] += predicted; });
    if (isInTime(header.arrays[array])) {
      expected.resize(count);
      in_time.predict(array, {out.mean, count}, expected);
      for (size_t n = 0; n < count; ++n) codes[n] += expected[n];
    }
    for (size_t n = 0; n < count; ++n) values[n] = value(codes[n], n);
    if (!allFinite({values, count})) throw Error("a value is not finite");
  };
  if (scale.scaled_means)
    decode(0, out.mean, [&](uint32_t code, size_t) { return scale.scaledMean(code); });
  else
    decode(0, out.mean, [&](uint32_t code, size_t) { return scale.mean(code); });
  const auto decode_others = [&](auto slope, auto variance) {
    decode(1, out.slope0, slope);
    decode(2, out.slope1, slope);
    decode(3, out.slope2, slope);
    decode(4, out.variance, variance);
  };
  if (scale.scaled)
    decode_others([&](uint32_t code, size_t n) { return scale.scaledSlope(code, out.mean[n]); },
                  [&](uint32_t code, size_t n) { return scale.scaledVariance(code, out.mean[n]); });
  else
    decode_others([&](uint32_t code, size_t) { return scale.slope(code); },
                  [&](uint32_t code, size_t) { return scale.variance(code); });
}

}  // namespace curvisplat
