// An input of the PLOT3D targets:
//
//   flags u8: what the user says of the layout | bytes of the grid u16 | grid | solution; none if that is
//   empty
#pragma once

#include "preprocess/plot3d_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {

inline void readPlot3d(std::span<const std::byte> bytes, bool ascii) {
  FuzzInput input(bytes);
  const auto flags = input.take<uint8_t>();
  OpenGridOptions options;
  options.temporary_folder = fuzzFolder();
  if (ascii) options.force.ascii = true;
  if (flags & 1) options.force.byte_order = flags & 2 ? ByteOrder::big : ByteOrder::little;
  if (flags & 4) options.force.records = flags & 8 ? RecordMarkers::bytes4 : RecordMarkers::none;
  if (flags & 16) options.force.precision_bytes = flags & 32 ? 8 : 4;
  if (flags & 64) options.force.multi_block = true;
  if (flags & 128) options.force.blanking = true;
  options.grid = fuzzFile("a.xyz", input.takeBytes(input.take<uint16_t>()));
  if (!input.rest().empty()) options.solutions = {fuzzFile("a.f", input.rest())};
  readGrid(Plot3dSource(options));
}

}  // namespace curvisplat
