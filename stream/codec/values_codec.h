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
// The stream contains the rows if a predictor uses them, so that it decodes without the geometry stream.
//
// In a series a stream may be predicted in time: the header says how many steps back its references are, and
// an array's code says whether its predictor applies to the codes or to their differences from what the
// references have there, in this stream's steps. What decodes is the same either way. stream/FORMAT.md has
// every formula.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/planes.h"
#include "stream/codec/prediction.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// How finely means are stored.
enum class ValuePrecision { kNormal, kFine };

/// The feature of caches (stream/cache/manifest.h) whose streams may have fine means, by a bit in the array
/// code of the means.
inline constexpr const char* kFineValues = "fine-values";

/// How far a decoded mean is from the encoded one at most, as a share of the range of the brick's means;
/// rounding to floats adds to it.
inline constexpr double kLargestMeanError = 0.5 / 65535, kLargestFineMeanError = 0.5 / 16777215;

struct ValuesHeader {
  float lower, upper;                 //  0: range of the means
  double slope_step, deviation_step;  //  8: in the scalar's unit
  uint32_t rows_bytes;                // 24: length of the varints, unpacked
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

/// Whether the stream has fine means, which only streams of a cache with the feature kFineValues may have.
/// Throws Error as stepsBackOf().
bool hasFineMeans(std::span<const std::byte> stream);

/// Encodes `values` and replaces them by the decoded values. `rows`: the rows of the brick's geometry
/// (rowsOf()). Predicts from `references` those arrays for which that takes fewer bits.
std::vector<std::byte> encodeValuesStream(std::span<const Row> rows, std::span<SplatScalar> values,
                                          const TimeReferences& references = {},
                                          ValuePrecision precision = ValuePrecision::kNormal);

/// Decodes untrusted bytes: throws Error unless they hold exactly `count` finite values. `out`: arrays of
/// `count`. `references`: those that stepsBackOf() names.
void decodeValuesStream(uint32_t count, std::span<const std::byte> bytes, const VariableArrays<float>& out,
                        const TimeReferences& references = {});

}  // namespace curvisplat
