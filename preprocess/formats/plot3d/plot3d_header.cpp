#include "preprocess/formats/plot3d/plot3d_header.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "preprocess/formats/common/stored_values.h"
#include "stream/base/count_text.h"

namespace curvisplat {
namespace {

// Random bytes may declare billions of blocks; real files have some ten thousand at most.
constexpr int64_t kMaxBlocks = 1'000'000;

/// Reads the integers of a header, record by record.
class HeaderReader {
 public:
  HeaderReader(PayloadFile& payload, const Plot3dLayout& layout) : payload_(payload), layout_(layout) {}

  /// The size of the next record; nullopt in a file without records.
  std::optional<uint64_t> record() {
    if (layout_.records == RecordMarkers::kNone) return std::nullopt;
    return payload_.nextRecord();
  }

  std::vector<int64_t> integers(uint64_t count) {
    const uint64_t width = layout_.integerBytes();
    if (offset_ > payload_.size() || count > (payload_.size() - offset_) / width)
      throw LayoutMisfit{LayoutMisfit::kFirstRecord,
                         fmt::format("the file ends within a header of {} numbers", count)};
    std::vector<std::byte> bytes(count * width);
    payload_.readAt(offset_, bytes);
    offset_ += bytes.size();
    const bool swap = layout_.byte_order != kMachineByteOrder;
    std::vector<int64_t> numbers(count);
    for (uint64_t n = 0; n < count; ++n)
      numbers[n] = layout_.ascii ? integerOf(loadStored<double>(&bytes[n * width], swap))
                                 : loadStored<int32_t>(&bytes[n * width], swap);
    return numbers;
  }

  uint64_t offset() const { return offset_; }

 private:
  static int64_t integerOf(double number) {
    if (!(std::abs(number) < 1e15) || number != std::trunc(number))
      throw LayoutMisfit{LayoutMisfit::kFirstRecord, fmt::format("found {} instead of a dimension", number)};
    return static_cast<int64_t>(number);
  }

  PayloadFile& payload_;
  const Plot3dLayout& layout_;
  uint64_t offset_ = 0;
};

uint64_t readBlockCount(HeaderReader& reader, const Plot3dLayout& layout, uint64_t file_size) {
  if (!layout.multi_block) return 1;
  if (const auto bytes = reader.record(); bytes && *bytes != 4)
    throw LayoutMisfit{LayoutMisfit::kNothing,
                       fmt::format("the first record has {} bytes; expected 4, a block count", *bytes)};
  const int64_t count = reader.integers(1).front();
  if (count < 1 || count > kMaxBlocks || static_cast<uint64_t>(count) > file_size / layout.integerBytes())
    throw LayoutMisfit{LayoutMisfit::kNothing, fmt::format("a block count of {} is impossible", count)};
  return static_cast<uint64_t>(count);
}

/// A known explanation for a dimension record of `bytes`; else empty.
std::string explainDimensionRecord(const Plot3dLayout& layout, uint64_t blocks, uint64_t bytes) {
  if (layout.two_dimensional) return "";
  if (layout.kind == Plot3dKind::kFunction && bytes == 12 * blocks)
    return "; the number of variables is missing";
  return "";
}

/// The number of nodes of block `b`; at most `limit`.
uint64_t checkedNodes(const Plot3dLayout& layout, const int64_t* dimensions, uint64_t b, uint64_t limit) {
  uint64_t nodes = 1;
  bool possible = true;
  std::string words;
  for (int axis = 0; axis < (layout.two_dimensional ? 2 : 3); ++axis) {
    words += fmt::format("{}{}", axis ? "x" : "", dimensions[axis]);
    possible = possible && dimensions[axis] > 0 &&
               !__builtin_mul_overflow(nodes, static_cast<uint64_t>(dimensions[axis]), &nodes);
  }
  if (!possible || nodes > limit)
    throw LayoutMisfit{
        LayoutMisfit::kFirstRecord,
        fmt::format("block {} of {} nodes is impossible in a file of this size", b + 1, words)};
  return nodes;
}

/// Reads the numbers of quantities and of species of an OVERFLOW file.
void readQuantities(const std::vector<int64_t>& numbers, uint64_t nodes_left, uint64_t file_size,
                    Plot3dHeader& header) {
  const int64_t quantities = numbers[0], species = numbers[1];
  const uint64_t nodes = file_size - nodes_left;
  if (quantities < 5 || static_cast<uint64_t>(quantities) > file_size / nodes || species < 0 ||
      species > quantities)
    throw LayoutMisfit{LayoutMisfit::kFirstRecord,
                       fmt::format("{} quantities of {} species are impossible", quantities, species)};
  header.components = static_cast<uint32_t>(quantities);
  header.species = static_cast<uint32_t>(species);
}

}  // namespace

Plot3dHeader readPlot3dHeader(PayloadFile& payload, const Plot3dLayout& layout, uint64_t file_size) {
  HeaderReader reader(payload, layout);
  const uint64_t count = readBlockCount(reader, layout, file_size);
  const uint64_t axes = layout.two_dimensional ? 2 : 3;
  const uint64_t numbers = axes + (layout.kind == Plot3dKind::kFunction ? 1 : 0);
  const uint64_t overall = layout.kind == Plot3dKind::kOverflow ? 2 : 0;  // nq and nqc
  if (const auto bytes = reader.record(); bytes && *bytes != 4 * (numbers * count + overall)) {
    const std::string explanation = explainDimensionRecord(layout, count, *bytes);
    throw LayoutMisfit{explanation.empty() ? LayoutMisfit::kFirstRecord : LayoutMisfit::kKnownStructure,
                       fmt::format("the dimension record has {} bytes, but {} of a {} need {}{}", *bytes,
                                   countText(count, "block"), describe(layout.kind),
                                   4 * (numbers * count + overall), explanation)};
  }
  const std::vector<int64_t> dimensions = reader.integers(numbers * count);
  const std::vector<int64_t> quantities = reader.integers(overall);

  Plot3dHeader header;
  header.components = static_cast<uint32_t>(layout.kind == Plot3dKind::kQ ? axes + 2 : axes);
  header.blocks.reserve(count);
  uint64_t nodes_left = file_size;  // a node needs more than a byte; so no sum of sizes overflows
  for (uint64_t b = 0; b < count; ++b) {
    const int64_t* at = &dimensions[b * numbers];
    const uint64_t nodes = checkedNodes(layout, at, b, nodes_left);
    nodes_left -= nodes;
    header.blocks.push_back({static_cast<uint64_t>(at[0]), static_cast<uint64_t>(at[1]),
                             layout.two_dimensional ? 1 : static_cast<uint64_t>(at[2])});
    if (layout.kind != Plot3dKind::kFunction) continue;
    const int64_t variables = at[axes];
    if (variables < 1 || static_cast<uint64_t>(variables) > file_size / nodes)
      throw LayoutMisfit{LayoutMisfit::kFirstRecord,
                         fmt::format("block {} has {} variables", b + 1, variables)};
    if (b > 0 && variables != header.components)
      throw LayoutMisfit{
          LayoutMisfit::kDimensions,
          fmt::format("block {} has {} variables and block 1 has {}", b + 1, variables, header.components)};
    header.components = static_cast<uint32_t>(variables);
  }
  if (layout.kind == Plot3dKind::kOverflow) readQuantities(quantities, nodes_left, file_size, header);
  header.bytes = reader.offset();
  return header;
}

}  // namespace curvisplat
