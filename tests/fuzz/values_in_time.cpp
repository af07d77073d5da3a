// Values that are predicted from those of one or two earlier steps, before the compression of the streams (see values_stream.cpp).
//
//   splats u16 | length u16 | length u16 | first reference | second reference | stream
//
// A stream is its header of 40 bytes, then rows and planes. A reference of no bytes has zeros. References are not predicted in
// time here, since a stream sees nothing but their values.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "stream/base/check.h"
#include "stream/codec/brick_codec.h"
#include "stream/codec/values_codec.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

std::vector<std::byte> packed(FuzzInput input) {
  const auto header = input.takeBytes(sizeof(ValuesHeader));
  PlaneWriter planes;
  planes.addBytes(input.rest());
  return planes.compress(header);
}

void checkFinite(const SplatVariable& values) {
  for (const auto* array : {&values.mean, &values.slope0, &values.slope1, &values.slope2})
    for (const float value : *array) CURVISPLAT_CHECK(std::isfinite(value));
  for (const float value : values.variance) CURVISPLAT_CHECK(value >= 0 && std::isfinite(value));
}

void fuzzValuesInTime(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  Brick brick;
  brick.splats = input.take<uint16_t>() + 1u;
  const std::array<uint16_t, 2> lengths{input.take<uint16_t>(), input.take<uint16_t>()};
  std::array<SplatVariable, 2> earlier;
  TimeReferences references;
  for (size_t n = 0; n < earlier.size(); ++n) {
    earlier[n].resize(brick.splats);
    const auto reference = input.takeBytes(lengths[n]);
    if (reference.size() >= sizeof(ValuesHeader))
      decodeVariable(brick, {}, packed(FuzzInput(reference)), earlier[n]);
    references.values[n] = arraysOf(std::as_const(earlier[n]));
  }
  if (input.rest().size() < sizeof(ValuesHeader)) return;
  const std::vector<std::byte> stream = packed(input);
  references.steps_back = stepsBackOf(stream);

  SplatVariable values;
  values.resize(brick.splats);
  decodeVariable(brick, stream, arraysOf(values), references);
  checkFinite(values);

  std::vector<SplatScalar> doubles;
  for (size_t n = 0; n < values.size(); ++n)
    doubles.push_back(
        {values.mean[n], {values.slope0[n], values.slope1[n], values.slope2[n]}, values.variance[n]});
  const EncodedValues again = encodeValues({}, {}, doubles, references);
  const auto back = stepsBackOf(again.bytes);
  CURVISPLAT_CHECK(back == references.steps_back || back[0] == 0);
  references.steps_back = back;
  decodeVariable(brick, again.bytes, arraysOf(values), references);
  for (size_t n = 0; n < values.size(); ++n)
    CURVISPLAT_CHECK_OP(values.mean[n], ==, static_cast<float>(doubles[n].mean));
}

const RegisteredFuzzTarget values_in_time_target("values_in_time", fuzzValuesInTime);

}  // namespace
}  // namespace curvisplat
