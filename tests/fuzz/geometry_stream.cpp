// The geometry stream of a brick. zstd would refuse nearly every changed byte; so the input is the stream
// before its compression, and is packed here.
//
//   splats u16 | level u8 | header 80 | runs and planes
#include <algorithm>
#include <cmath>
#include <vector>

#include "stream/base/check.h"
#include "stream/codec/brick_codec.h"
#include "stream/codec/geometry_codec.h"
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

}  // namespace
}  // namespace curvisplat
