// Streams of a brick. zstd would refuse nearly every changed byte; so the input is a stream before its
// compression, and is packed here (but packed_stream's).
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/codec/brick_codec.h"
#include "stream/codec/geometry_codec.h"
#include "stream/codec/values_codec.h"
#include "stream/model/growth_code.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void checkFinite(const SplatGeometry& splats, float size) {
  for (const auto* array : {&splats.x, &splats.y, &splats.z})
    for (const float value : *array) CURVISPLAT_CHECK(value >= 0 && value <= size);
  for (const auto* array : {&splats.axis0, &splats.axis1, &splats.axis2})
    for (const float value : *array) CURVISPLAT_CHECK(value > 0 && std::isfinite(value));
  for (const auto* array : {&splats.shear10, &splats.shear20, &splats.shear21, &splats.weight})
    for (const float value : *array) CURVISPLAT_CHECK(std::isfinite(value));
  for (const uint32_t code : splats.growth_code) CURVISPLAT_CHECK(isPossibleGrowthCode(code));
}

// The geometry stream of a brick.
//
//   splats u16 | level u8 | header 80 | runs and planes
void fuzzGeometryStream(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  Brick brick;
  brick.splats = input.take<uint16_t>() + 1u;
  brick.cell.level = input.take<uint8_t>() % (kMaxLevel + 1);
  const auto header = input.takeBytes(sizeof(GeometryHeader));
  if (header.size() < sizeof(GeometryHeader)) return;
  PlaneWriter planes;
  planes.addBytes(input.rest());
  const std::vector<std::byte> stream = planes.compress(header);

  const RootCube root{{-1, 2, 3}, 4};
  SplatGeometry splats;
  std::vector<NodeRun> runs;
  decodeGeometry(root, brick, stream, splats, &runs);
  checkFinite(splats, static_cast<float>(root.cellSize(brick.cell.level)));
  uint64_t nodes = 0;
  for (const NodeRun& one : runs) nodes += one.count;
  CURVISPLAT_CHECK(runs.empty() || nodes == brick.splats);

  // As a conversion that is resumed reads it back, and merges it.
  BrickSplats doubles = decodeForMerging(root, brick, stream, {}, {});
  const EncodedBrick again = encodeBrick(root, doubles);
  decodeGeometry(root, brick, again.geometry, splats);
  checkFinite(splats, static_cast<float>(root.cellSize(brick.cell.level)));
}

const RegisteredFuzzTarget geometry_stream_target("geometry_stream", fuzzGeometryStream);

void checkFinite(const SplatVariable& values) {
  for (const auto* array : {&values.mean, &values.slope0, &values.slope1, &values.slope2})
    for (const float value : *array) CURVISPLAT_CHECK(std::isfinite(value));
  for (const float value : values.variance) CURVISPLAT_CHECK(value >= 0 && std::isfinite(value));
}

// The values stream of a brick.
//
//   splats u16 | header 40 | rows and planes
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
  checkFinite(values);

  std::vector<SplatScalar> doubles;
  for (size_t n = 0; n < values.size(); ++n)
    doubles.push_back(
        {values.mean[n], {values.slope0[n], values.slope1[n], values.slope2[n]}, values.variance[n]});
  const EncodedValues again = encodeValues({}, {}, doubles);
  decodeVariable(brick, again.variable, again.bytes, values);
}

const RegisteredFuzzTarget values_stream_target("values_stream", fuzzValuesStream);

std::vector<std::byte> packed(FuzzInput input) {
  const auto header = input.takeBytes(sizeof(ValuesHeader));
  PlaneWriter planes;
  planes.addBytes(input.rest());
  return planes.compress(header);
}

// Values that are predicted from those of one or two earlier steps.
//
//   splats u16 | length u16 | length u16 | first reference | second reference | stream
//
// A stream is its header of 40 bytes, then rows and planes. A reference of no bytes has zeros. References
// are not predicted in time here, since a stream sees nothing but their values.
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

// Both streams of a brick as they are in a file: what zstd is given.
//
//   splats u16 | level u8 | stream
void fuzzPackedStream(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  Brick brick;
  brick.splats = input.take<uint16_t>() + 1u;
  const auto level = input.take<uint8_t>();
  brick.cell.level = level % (kMaxLevel + 1);
  if (level & 0x80) {
    SplatVariable values;
    decodeVariable(brick, {}, input.rest(), values);
  } else {
    SplatGeometry splats;
    decodeGeometry({}, brick, input.rest(), splats);
  }
}

const RegisteredFuzzTarget packed_stream_target("packed_stream", fuzzPackedStream);

}  // namespace
}  // namespace curvisplat
