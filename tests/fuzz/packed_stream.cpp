// Both streams of a brick as they are in a file: what zstd is given.
//
//   splats u16 | level u8 | stream
#include <vector>

#include "stream/base/error.h"
#include "stream/codec/brick_codec.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

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
