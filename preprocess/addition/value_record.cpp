#include "preprocess/addition/value_record.h"

#include <algorithm>

#include "stream/base/check.h"

namespace curvisplat {

void packValueRecord(uint64_t node, uint32_t brick, const std::array<uint32_t, 3>& place,
                     std::span<const SplatScalar> values, std::vector<std::byte>& out) {
  CURVISPLAT_CHECK_OP(node, <, kMaxNodes);
  const bool varied = std::any_of(values.begin(), values.end(),
                                  [](const SplatScalar& value) { return recordFloat(value.variance) != 0; });
  const size_t begin = out.size();
  out.resize(begin + (varied ? maxValueRecordBytes(values.size()) : minValueRecordBytes(values.size())));
  std::byte* to = out.data() + begin;
  const auto put = [&to](const auto& number, size_t bytes) {
    std::memcpy(to, &number, bytes);
    to += bytes;
  };
  put(node | uint64_t{varied} << 47, 6);
  put(brick, sizeof brick);
  const uint32_t bits = place[0] | place[1] << kPlaceBits | place[2] << (2 * kPlaceBits);
  put(bits, sizeof bits);
  for (const SplatScalar& value : values) {
    const float numbers[] = {recordFloat(value.mean), recordFloat(value.slope.x), recordFloat(value.slope.y),
                             recordFloat(value.slope.z)};
    put(numbers, sizeof numbers);
  }
  if (!varied) return;
  for (const SplatScalar& value : values) {
    const float variance = recordFloat(value.variance);
    put(variance, sizeof variance);
  }
}

void unpackValueRecord(const std::byte* record, std::span<SplatScalar> values) {
  const std::byte* at = record + 14;
  const auto take = [&at] {
    float single;
    std::memcpy(&single, at, sizeof single);
    at += sizeof single;
    return static_cast<double>(single);
  };
  for (SplatScalar& value : values) {
    value.mean = take();
    for (int axis = 0; axis < 3; ++axis) value.slope[axis] = take();
    value.variance = 0;
  }
  if (!recordIsIrregular(record)) return;
  for (SplatScalar& value : values) value.variance = take();
}

}  // namespace curvisplat
