// The values stream of a brick: one scalar of its splats. All functions are pure, with scratch memory of
// each thread: any thread may call them.
//
//   ValuesHeader | zstd frame: rows (varints) | planes of mean, slope0, slope1, slope2, deviation
//
//   span        the range of the brick's means, or its largest |slope component| or deviation if larger
//   mean        16 bits over the range of the brick's means; with ValuePrecision::kFine 24, as floats have
//   slope       in steps of 2^-10 of the span, with kFine 2^-13: at the edge of a splat's support, 1.556 from
//               its centre, the scalar is wrong by at most 1.3e-3 of the span, or 1.7e-4. Errors of the splats
//               along a ray even out: DESIGN.md, "The codec", says how much of them is seen
//   deviation   √variance in steps of 2^-12 of the span; 0 stays 0
//
// With ValuePrecision::kAuto that is so where these steps are fine by the spread of all the scalar's values: means within
// 1/2000 of it, and slopes so that their error at the kernel's standard deviation, 0.447 from a splat's centre, is. In
// other bricks slopes and deviations, and means if theirs are not either, have codes by their own scale (ValueSpread): for
// a number x in units of it, the leading bits of 1 + |x| as a floating-point number, so that x is within (1 + |x|) / 2048, of
// slopes 1024. So a long tail costs the values in it precision, and no others.
//
// The stream contains the rows if a predictor uses them, so that it decodes without the geometry stream.
//
// In a series a stream may be predicted in time: the header says how many steps back its references are, and
// an array's code says whether its predictor applies to the codes or to their differences from what the
// references have there, in this stream's steps. What decodes is the same either way. stream/FORMAT.md has
// every formula.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/planes.h"
#include "stream/codec/prediction.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// How finely means are stored.
enum class ValuePrecision { kNormal, kFine, kAuto };

/// "normal", "fine" or "auto".
inline const char* wordOf(ValuePrecision precision) {
  constexpr const char* kWords[] = {"normal", "fine", "auto"};
  return kWords[static_cast<size_t>(precision)];
}

/// The centre and the spread of a scalar's values, by volume: half of it is below `centre`, and from 5
/// to 95 % they differ by `scale`. A value's own scale is that, plus its distance from the centre.
struct ValueSpread {
  double centre = 0, scale = 0;  // scale 0: not known, or there is one value

  double scaleAt(double value) const { return scale + std::abs(value - centre); }
};

/// How far a mean that is coded by its own scale is from the encoded one at most, in units of that.
inline constexpr double kLargestErrorByScale = 1.0 / 2048;

/// How a scalar's values are coded.
struct ValueCoding {
  ValuePrecision precision = ValuePrecision::kNormal;
  ValueSpread spread{};  // for kAuto
};

/// How far a mean is from the encoded one at most, in a stream of means from `lower` to `upper`.
double largestMeanError(const ValueCoding& coding, double lower, double upper, double mean);

/// The feature of caches (stream/cache/manifest.h) whose streams may have fine means, by a bit in the array
/// code of the means.
inline constexpr const char* kFineValues = "fine-values";

/// The feature of caches whose streams may have codes by the values' own scale, by bits in the array codes of the means
/// and the first slope.
inline constexpr const char* kScaledValues = "scaled-values";

struct ValuesHeader {
  float lower, upper;  //  0: range of the means
  double slope_step,
      deviation_step;   //  8: in the scalar's unit; of scaled slopes, scale and centre of the spread
  uint32_t rows_bytes;  // 24: length of the varints, unpacked
  std::array<ArrayCode, 5> arrays;    // 28: mean, three slopes, deviation
  std::array<uint8_t, 2> steps_back;  // 38: of the first and the second reference in time; 0: none
};                                    // 40
static_assert(sizeof(ValuesHeader) == 40);

/// The same brick's values at one or two earlier steps, to predict from: borrowed.
struct TimeReferences {
  std::array<uint8_t, 2> steps_back{};                  // 0: none; the second is further back
  std::array<VariableArrays<const float>, 2> values{};  // of as many splats as the stream
};

/// How many steps back the references of a stream are; zero for those that it does not have. The bytes are
/// untrusted: throws Error if they hold no header, or a second reference that is not further back than the
/// first.
std::array<uint8_t, 2> stepsBackOf(std::span<const std::byte> stream);

/// The feature that a cache with this stream must have: kFineValues, kScaledValues, or null. Throws Error as
/// stepsBackOf().
const char* featureOf(std::span<const std::byte> stream);

/// How far decoded values are from the encoded ones; rounding to floats adds to it. `typical`: the root mean square for a
/// value near the centre of the scalar's spread.
struct ValueErrors {
  double largest = 0, typical = 0;
};
/// The errors of the means, and of the slopes' components, that the header of a stream of values in this
/// range allows. Throws Error as stepsBackOf().
struct StreamErrors {
  ValueErrors means, slopes;
};
StreamErrors errorsOf(std::span<const std::byte> header, double largest_slope);

/// Encodes `values` and replaces them by the decoded values. `rows`: the rows of the brick's geometry
/// (rowsOf()). Predicts from `references` those arrays for which that takes fewer bits.
std::vector<std::byte> encodeValuesStream(std::span<const Row> rows, std::span<SplatScalar> values,
                                          const TimeReferences& references = {},
                                          const ValueCoding& coding = {});

/// Decodes untrusted bytes: throws Error unless they hold exactly `count` finite values. `out`: arrays of
/// `count`. `references`: those that stepsBackOf() names.
void decodeValuesStream(uint32_t count, std::span<const std::byte> bytes, const VariableArrays<float>& out,
                        const TimeReferences& references = {});

}  // namespace curvisplat
