#include "preprocess/plot3d_file.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "preprocess/stored_values.h"
#include "stream/error.h"

namespace curvisplat {
namespace {

// Half of a second-level cache: bytes are converted before they leave it.
constexpr size_t kBufferBytes = size_t{256} << 10;

std::span<std::byte> threadBuffer() {
  thread_local std::vector<std::byte> buffer(kBufferBytes);
  return buffer;
}

}  // namespace

/// Calls convert(bytes, count, first) for pieces of the array that begins `array_offset` bytes behind the
/// block's first value and has `width` bytes a node; `first` counts the nodes of the box.
template <typename Convert>
void Plot3dFile::readRanges(uint32_t block, const NodeBox& box, uint64_t array_offset, uint64_t width,
                            const Convert& convert) const {
  const Plot3dBlock& dims = fit_.blocks[block];
  CURVISPLAT_CHECK_OP(box.j0, <=, box.j1);
  CURVISPLAT_CHECK_OP(box.k0, <=, box.k1);
  CURVISPLAT_CHECK_OP(box.j1, <=, dims.nj);
  CURVISPLAT_CHECK_OP(box.k1, <=, dims.nk);
  const bool whole_planes = box.j0 == 0 && box.j1 == dims.nj;
  const uint64_t ranges = whole_planes ? std::min<uint64_t>(1, box.k1 - box.k0) : box.k1 - box.k0;
  const uint64_t range_nodes = dims.ni * (box.j1 - box.j0) * (whole_planes ? box.k1 - box.k0 : 1);
  const std::span<std::byte> buffer = threadBuffer();
  uint64_t first = 0;
  for (uint64_t range = 0; range < ranges; ++range) {
    const uint64_t node = ((box.k0 + range) * dims.nj + box.j0) * dims.ni;
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
      else if constexpr (std::is_same_v<Stored, double>)  // NaN, too, becomes the largest
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

FlowConditions Plot3dFile::conditions(uint32_t block) const {
  CURVISPLAT_CHECK(fit_.layout.kind == Plot3dKind::q);
  const auto width = static_cast<size_t>(fit_.layout.precision_bytes);
  std::array<std::byte, 32> bytes;
  fit_.payload.readAt(fit_.blocks[block].values_offset - 4 * width, std::span(bytes).first(4 * width));
  std::array<double, 4> values;
  const bool swap = fit_.layout.byte_order != kMachineByteOrder;
  if (width == 8)
    convertStored<double>(bytes.data(), 4, swap, values.data());
  else
    convertStored<float>(bytes.data(), 4, swap, values.data());
  return {"", block, values[0], values[1], values[2], values[3]};
}

}  // namespace curvisplat
