// The values stream of a brick, before its compression (see geometry_stream.cpp).
//
//   splats u16 | header 40 | rows and planes
#include "stream/base/check.h"
#include "stream/codec/values_codec.h"

#include <cmath>
#include <vector>

#include "stream/codec/brick_codec.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzValuesStream(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  Brick brick;
  brick.splats = input.take<uint16_t>() + 1u;
  const auto header = input.takeBytes(sizeof(ValuesHeader));
  if (header.size() < sizeof(ValuesHeader)) return;
  PlaneWriter planes;
  planes.addBytes(input.rest());
  const std::vector<std::byte> stream = planes.compress(header);

  SplatVariable values;
  decodeVariable(brick, {}, stream, values);
  for (const auto* array : {&values.mean, &values.slope0, &values.slope1, &values.slope2})
    for (const float value : *array) CURVISPLAT_CHECK(std::isfinite(value));
  for (const float value : values.variance) CURVISPLAT_CHECK(value >= 0 && std::isfinite(value));

  std::vector<SplatScalar> doubles;
  for (size_t n = 0; n < values.size(); ++n)
    doubles.push_back(
        {values.mean[n], {values.slope0[n], values.slope1[n], values.slope2[n]}, values.variance[n]});
  const EncodedValues again = encodeValues({}, {}, doubles);
  decodeVariable(brick, again.variable, again.bytes, values);
}

const RegisteredFuzzTarget values_stream_target("values_stream", fuzzValuesStream);

}  // namespace
}  // namespace curvisplat
