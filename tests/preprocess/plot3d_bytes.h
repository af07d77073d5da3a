// Writes small PLOT3D files of any layout, as bytes: what the reader must find again.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_layout.h"
#include "stream/base/file.h"

namespace curvisplat::test {

struct TestBlock {
  uint64_t ni = 0, nj = 0, nk = 0;
  std::array<std::vector<double>, 3> coordinates;
  std::vector<int32_t> iblank;
  std::vector<std::vector<double>> components;
  std::array<double, 4> conditions{};

  uint64_t nodes() const { return ni * nj * nk; }
};

/// A curved block with smooth fields; every value is a float, so that both precisions hold it.
inline TestBlock testBlock(uint64_t ni, uint64_t nj, uint64_t nk, uint32_t components, double shift = 0) {
  TestBlock block{ni, nj, nk, {}, {}, std::vector<std::vector<double>>(components), {0.5, 2, 1e5, 7}};
  for (uint64_t k = 0; k < nk; ++k)
    for (uint64_t j = 0; j < nj; ++j)
      for (uint64_t i = 0; i < ni; ++i) {
        const double u = 0.1 * static_cast<double>(i), v = 1 + 0.17 * static_cast<double>(j),
                     w = 0.3 * static_cast<double>(k) + shift;
        block.coordinates[0].push_back(static_cast<float>(-v * std::sin(u)));
        block.coordinates[1].push_back(static_cast<float>(v * std::cos(u)));
        block.coordinates[2].push_back(static_cast<float>(w + 0.01 * u * v));
        block.iblank.push_back((i + 2 * j + 3 * k) % 5 == 0 ? 0 : (i + j) % 3 == 0 ? -2 : 1);
        for (uint32_t c = 0; c < components; ++c)
          block.components[c].push_back(static_cast<float>(std::sin(u + c) + v + 0.5 * w));
      }
  return block;
}

using Bytes = std::vector<std::byte>;

template <typename Value>
void appendNumber(Bytes& to, Value value, ByteOrder order) {
  const auto bytes = std::bit_cast<std::array<std::byte, sizeof(Value)>>(value);
  const bool reverse = (order == ByteOrder::kBig) == (std::endian::native == std::endian::little);
  if (reverse)
    to.insert(to.end(), bytes.rbegin(), bytes.rend());
  else
    to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Puts a record's payload into the file, with its markers; with `subrecord_bytes` > 0 cut as gfortran cuts
/// records over 2 GiB.
inline void appendRecord(Bytes& to, const Bytes& payload, const Plot3dLayout& layout,
                         uint64_t subrecord_bytes = 0) {
  const auto marker = [&](int64_t value) {
    if (layout.records == RecordMarkers::kBytes4)
      appendNumber(to, static_cast<int32_t>(value), layout.byte_order);
    if (layout.records == RecordMarkers::kBytes8) appendNumber(to, value, layout.byte_order);
  };
  const uint64_t part = subrecord_bytes > 0 ? subrecord_bytes : std::max<uint64_t>(1, payload.size());
  uint64_t begin = 0;
  do {
    const uint64_t end = std::min<uint64_t>(payload.size(), begin + part);
    const auto bytes = static_cast<int64_t>(end - begin);
    marker(end < payload.size() ? -bytes : bytes);
    to.insert(to.end(), payload.begin() + static_cast<ptrdiff_t>(begin),
              payload.begin() + static_cast<ptrdiff_t>(end));
    marker(begin > 0 ? -bytes : bytes);
    begin = end;
  } while (begin < payload.size());
}

/// The numbers of a file in their order, for each of its records.
struct Numbers {
  std::vector<int32_t> integers;  // come first, or last (iblank)
  std::vector<double> values;
  bool integers_last = false;
};

inline std::vector<Numbers> recordsOf(const Plot3dLayout& layout, const std::vector<TestBlock>& blocks) {
  std::vector<Numbers> records;
  if (layout.multi_block) records.push_back({{static_cast<int32_t>(blocks.size())}, {}, false});
  Numbers dimensions;
  for (const TestBlock& block : blocks) {
    for (const uint64_t n : {block.ni, block.nj, block.nk})
      dimensions.integers.push_back(static_cast<int32_t>(n));
    if (layout.kind == Plot3dKind::kFunction)
      dimensions.integers.push_back(static_cast<int32_t>(block.components.size()));
  }
  records.push_back(dimensions);
  for (const TestBlock& block : blocks) {
    if (layout.kind == Plot3dKind::kQ)
      records.push_back({{}, {block.conditions.begin(), block.conditions.end()}, false});
    Numbers values;
    if (layout.kind == Plot3dKind::kGrid)
      for (const auto& axis : block.coordinates)
        values.values.insert(values.values.end(), axis.begin(), axis.end());
    else
      for (const auto& component : block.components)
        values.values.insert(values.values.end(), component.begin(), component.end());
    if (layout.blanking) values.integers = block.iblank;
    values.integers_last = true;
    records.push_back(std::move(values));
  }
  return records;
}

inline Bytes plot3dBytes(const Plot3dLayout& layout, const std::vector<TestBlock>& blocks,
                         uint64_t subrecord_bytes = 0) {
  Bytes file;
  for (const Numbers& record : recordsOf(layout, blocks)) {
    Bytes payload;
    const auto integers = [&] {
      for (const int32_t value : record.integers) appendNumber(payload, value, layout.byte_order);
    };
    if (!record.integers_last) integers();
    for (const double value : record.values) {
      if (layout.precision_bytes == 8)
        appendNumber(payload, value, layout.byte_order);
      else
        appendNumber(payload, static_cast<float>(value), layout.byte_order);
    }
    if (record.integers_last) integers();
    appendRecord(file, payload, layout, subrecord_bytes);
  }
  return file;
}

/// The file as text, equal neighbours written with repeat counts.
inline Bytes plot3dText(const Plot3dLayout& layout, const std::vector<TestBlock>& blocks) {
  std::string text;
  const auto append = [&](const auto& numbers) {
    for (size_t n = 0; n < numbers.size();) {
      size_t end = n + 1;
      while (end < numbers.size() && numbers[end] == numbers[n]) ++end;
      if (end - n > 1) text += fmt::format("{}*", end - n);
      text += fmt::format("{}{}", numbers[n], end % 5 == 0 ? "\n" : ", ");
      n = end;
    }
    text += "\n";
  };
  for (const Numbers& record : recordsOf(layout, blocks)) {
    if (!record.integers_last) append(record.integers);
    append(record.values);
    if (record.integers_last) append(record.integers);
  }
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// A folder of its own for one test, removed at the end.
class TestFolder {
 public:
  explicit TestFolder(const std::string& name)
      : path_(std::filesystem::temp_directory_path() / fmt::format("curvisplat-{}-{}", name, ::getpid())) {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, std::span<const std::byte> bytes) const {
    const std::filesystem::path file = path_ / name;
    std::filesystem::remove(file);  // some file systems flush a file that is emptied and written again
    OutputFile(file).append(bytes);
    return file;
  }
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    return write(name, std::as_bytes(std::span(text)));
  }

 private:
  std::filesystem::path path_;
};

}  // namespace curvisplat::test
