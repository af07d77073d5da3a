// PLOT3D files, binary and text, and .p3d files, which name others.
#include <bit>
#include <span>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {
namespace {

/// Whether a text has a repeat count ("1000000*0") above five digits. Those are bounded by the disk's free
/// space, which is too long a way for a fuzzer.
bool repeatsVeryOften(std::string_view text) {
  for (size_t star = text.find('*'); star != text.npos; star = text.find('*', star + 1)) {
    size_t digits = 0;
    while (digits < star && text[star - digits - 1] >= '0' && text[star - digits - 1] <= '9') ++digits;
    if (digits > 5) return true;
  }
  return false;
}

// An input of plot3d and plot3d_ascii:
//
//   flags u8: what the user says of the layout | bytes of the grid u16 | grid | solution; none if that is
//   empty
void readPlot3d(std::span<const std::byte> bytes, bool ascii) {
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

// Binary PLOT3D files, whose layout is found out from what is in them.
const RegisteredFuzzTarget plot3d_target("plot3d",
                                         [](std::span<const std::byte> bytes) { readPlot3d(bytes, false); });

// PLOT3D files of text.
const RegisteredFuzzTarget plot3d_ascii_target("plot3d_ascii", [](std::span<const std::byte> bytes) {
  readPlot3d(bytes, true);
});

/// Single precision without record markers: `head`, then `values` values.
void writeFile(const char* name, const std::vector<int32_t>& head, size_t values) {
  std::vector<float> words(head.size() + values);
  for (size_t n = 0; n < words.size(); ++n)
    words[n] = n < head.size() ? std::bit_cast<float>(head[n]) : static_cast<float>(n);
  fuzzFile(name, std::as_bytes(std::span(words)));
}

bool writePlot3dFiles() {
  constexpr size_t kNodes = 4 * 3 * 2;
  writeFile("a.xyz", {4, 3, 2}, 3 * kNodes);
  writeFile("a.q", {4, 3, 2}, 4 + 5 * kNodes);
  writeFile("a.f", {4, 3, 2, 2}, 2 * kNodes);
  return true;
}

// .p3d files, beside a grid and two solutions that are as they should be: a.xyz, a.q, a.f.
void fuzzPlot3dMeta(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool written = writePlot3dFiles();
  OpenGridOptions options;
  options.grid = fuzzFile("a.p3d", bytes);
  options.temporary_folder = fuzzFolder();
  if (!isPlot3dMeta(InputFile(options.grid))) return;
  readData(openPlot3dMeta(options));
}

const RegisteredFuzzTarget plot3d_meta_target("plot3d_meta", fuzzPlot3dMeta);

}  // namespace
}  // namespace curvisplat
