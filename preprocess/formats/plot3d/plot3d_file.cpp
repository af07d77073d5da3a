#include "preprocess/formats/plot3d/plot3d_file.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

// Half of a second-level cache, so that bytes are converted while they are cached.
constexpr size_t kBufferBytes = size_t{256} << 10;

// OVERFLOW's parameters, in order:
//
//   7 numbers      Mach, alpha, Reynolds number, time; gamma, beta and temperature of the freestream
//   1 integer
//   6 + n numbers  three total enthalpies, gas constants of the n species, freestream Mach number, and two
//                  numbers of turbulence
constexpr size_t kBeforeInteger = 7, kBehindInteger = 6;

std::span<std::byte> threadBuffer() {
  static const PerThread<std::vector<std::byte>> buffers;
  std::vector<std::byte>& buffer = buffers.own();
  buffer.resize(kBufferBytes);
  return buffer;
}

}  // namespace

/// Calls convert(bytes, count, first) for consecutive pieces of an array's box. The array begins
/// `array_offset` bytes after the block's first value and has `width` bytes per node; `first` is the index of
/// the piece's first node in the box.
template <typename Convert>
void Plot3dFile::readRanges(uint32_t block, const NodeBox& box, uint64_t array_offset, uint64_t width,
                            const Convert& convert) const {
  const Plot3dBlock& dims = fit_.blocks[block];
  CURVISPLAT_CHECK_OP(box.j0, <=, box.j1);
  CURVISPLAT_CHECK_OP(box.k0, <=, box.k1);
  CURVISPLAT_CHECK_OP(box.j1, <=, dims.nj);
  CURVISPLAT_CHECK_OP(box.k1, <=, dims.nk);
  CURVISPLAT_CHECK_OP(box.i0, <=, box.endOfRow(dims.ni));
  const uint64_t row_nodes = box.rowNodes(dims.ni), rows = box.j1 - box.j0, planes = box.k1 - box.k0;
  const bool whole_rows = row_nodes == dims.ni;
  const bool whole_planes = whole_rows && box.j0 == 0 && box.j1 == dims.nj;
  const uint64_t ranges_of_plane = whole_rows ? 1 : rows;
  const uint64_t ranges = whole_planes ? std::min<uint64_t>(1, planes) : planes * ranges_of_plane;
  const uint64_t range_nodes = row_nodes * (whole_rows ? rows : 1) * (whole_planes ? planes : 1);
  const std::span<std::byte> buffer = threadBuffer();
  uint64_t first = 0;
  for (uint64_t range = 0; range < ranges; ++range) {
    const uint64_t k = box.k0 + range / ranges_of_plane, j = box.j0 + range % ranges_of_plane;
    const uint64_t node = (k * dims.nj + j) * dims.ni + box.i0;
    uint64_t offset = dims.values_offset + array_offset + node * width;
    for (uint64_t left = range_nodes; left > 0;) {
      const uint64_t count = std::min<uint64_t>(left, buffer.size() / width);
      const auto bytes = buffer.first(static_cast<size_t>(count * width));
      fit_.payload.readAt(offset, bytes);
      convert(bytes.data(), static_cast<size_t>(count), static_cast<size_t>(first));
      offset += bytes.size();
      first += count;
      left -= count;
    }
  }
}

template <typename Value>
void Plot3dFile::readValues(uint32_t block, uint32_t component, const NodeBox& box,
                            std::span<Value> out) const {
  const auto width = static_cast<uint64_t>(fit_.layout.precision_bytes);
  const bool swap = fit_.layout.byte_order != kMachineByteOrder;
  const uint64_t array_offset = component * fit_.blocks[block].nodes() * width;
  readRanges(block, box, array_offset, width, [&](const std::byte* bytes, size_t count, size_t first) {
    if (width == 8)
      convertStored<double>(bytes, count, swap, &out[first]);
    else
      convertStored<float>(bytes, count, swap, &out[first]);
  });
}

template <typename Value>
void Plot3dFile::readIntegers(uint32_t block, const NodeBox& box, std::span<Value> out) const {
  CURVISPLAT_CHECK(fit_.layout.blanking);
  const auto precision = static_cast<uint64_t>(fit_.layout.precision_bytes);
  const bool swap = fit_.layout.byte_order != kMachineByteOrder;
  const uint64_t array_offset = fit_.components * fit_.blocks[block].nodes() * precision;
  const auto convert = [&](auto stored, const std::byte* bytes, size_t count, size_t first) {
    using Stored = decltype(stored);
    for (size_t n = 0; n < count; ++n) {
      const Stored value = loadStored<Stored>(bytes + n * sizeof(Stored), swap);
      if constexpr (std::is_same_v<Value, uint8_t>)
        out[first + n] = value == 0;
      else if constexpr (std::is_same_v<Stored, double>)  // NaN, too, becomes INT32_MAX
        out[first + n] = std::abs(value) < 2147483647.0 ? static_cast<Value>(value) : INT32_MAX;
      else
        out[first + n] = value;
    }
  };
  readRanges(block, box, array_offset, fit_.layout.integerBytes(),
             [&](const std::byte* bytes, size_t count, size_t first) {
               if (fit_.layout.ascii)
                 convert(double{}, bytes, count, first);
               else
                 convert(int32_t{}, bytes, count, first);
             });
}

void Plot3dFile::read(uint32_t block, uint32_t component, const NodeBox& box, std::span<double> out) const {
  readValues(block, component, box, out);
}

void Plot3dFile::read(uint32_t block, uint32_t component, const NodeBox& box, std::span<float> out) const {
  readValues(block, component, box, out);
}

void Plot3dFile::readBlank(uint32_t block, const NodeBox& box, std::span<uint8_t> out) const {
  readIntegers(block, box, out);
}

void Plot3dFile::readIblank(uint32_t block, const NodeBox& box, std::span<int32_t> out) const {
  readIntegers(block, box, out);
}

/// The numbers before a block's values; OVERFLOW's integer is left out.
std::vector<double> Plot3dFile::parameters(uint32_t block) const {
  const Plot3dLayout& layout = fit_.layout;
  CURVISPLAT_CHECK(layout.kind == Plot3dKind::kQ || layout.kind == Plot3dKind::kOverflow);
  const bool overflow = layout.kind == Plot3dKind::kOverflow;
  const auto width = static_cast<size_t>(layout.precision_bytes);
  const size_t before = overflow ? kBeforeInteger : 4;
  const size_t behind = overflow ? kBehindInteger + std::max(2u, fit_.species) : 0;
  const size_t integer = overflow ? 4 : 0;
  const uint64_t begin = fit_.blocks[block].values_offset - ((before + behind) * width + integer);
  std::vector<double> values(before + behind);
  const auto read = [&](uint64_t offset, std::span<double> to) {
    const bool swap = layout.byte_order != kMachineByteOrder;
    if (width == 8)
      readStored<double>(fit_.payload, offset, to.size(), swap, to.data());
    else
      readStored<float>(fit_.payload, offset, to.size(), swap, to.data());
  };
  read(begin, std::span(values).first(before));
  read(begin + before * width + integer, std::span(values).subspan(before));
  return values;
}

FlowConditions Plot3dFile::conditions(uint32_t block) const {
  const std::vector<double> values = parameters(block);
  // OVERFLOW's first Mach number is the one that normalises the solution; the freestream's is the third last.
  const double freestream = fit_.layout.kind == Plot3dKind::kOverflow ? values[values.size() - 3] : 0;
  return {"", block, freestream > 0 ? freestream : values[0], values[1], values[2], values[3]};
}

double Plot3dFile::freestreamGamma() const {
  CURVISPLAT_CHECK(fit_.layout.kind == Plot3dKind::kOverflow);
  return parameters(0)[4];
}

}  // namespace curvisplat
