// An input of the PLOT3D targets:
//
//   flags u8: what the user says of the layout | bytes of the grid u16 | grid | solution; none if that is
//   empty
#pragma once

#include "preprocess/formats/plot3d/plot3d_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {

/// Whether a text has a repeat count ("1000000*0") above five digits. Those are bounded by the disk's free
/// space, which is too long a way for a fuzzer.
inline bool repeatsVeryOften(std::string_view text) {
  for (size_t star = text.find('*'); star != text.npos; star = text.find('*', star + 1)) {
    size_t digits = 0;
    while (digits < star && text[star - digits - 1] >= '0' && text[star - digits - 1] <= '9') ++digits;
    if (digits > 5) return true;
  }
  return false;
}

inline void readPlot3d(std::span<const std::byte> bytes, bool ascii) {
  if (repeatsVeryOften(textOf(bytes))) return;
  FuzzInput input(bytes);
  const auto flags = input.take<uint8_t>();
  OpenGridOptions options;
  options.temporary_folder = fuzzFolder();
  if (ascii) options.force.ascii = true;
  if (flags & 1) options.force.byte_order = flags & 2 ? ByteOrder::kBig : ByteOrder::kLittle;
  if (flags & 4) options.force.records = flags & 8 ? RecordMarkers::kBytes4 : RecordMarkers::kNone;
  if (flags & 16) options.force.precision_bytes = flags & 32 ? 8 : 4;
  if (flags & 64) options.force.multi_block = true;
  if (flags & 128) options.force.blanking = true;
  options.grid = fuzzFile("a.xyz", input.takeBytes(input.take<uint16_t>()));
  if (!input.rest().empty()) options.solutions = {fuzzFile("a.f", input.rest())};
  readGrid(Plot3dSource(options));
}

}  // namespace curvisplat
