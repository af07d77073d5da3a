#include "preprocess/formats/plot3d/plot3d_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {

std::string describe(Plot3dKind kind) {
  switch (kind) {
    case Plot3dKind::kGrid:
      return "grid";
    case Plot3dKind::kQ:
      return "Q solution";
    case Plot3dKind::kOverflow:
      return "OVERFLOW Q solution";
    case Plot3dKind::kFunction:
      break;
  }
  return "function file";
}

std::string describe(const Plot3dLayout& layout) {
  std::string words;
  if (layout.ascii) {
    words = "ASCII";
  } else {
    words = layout.byte_order == ByteOrder::kBig ? "big-endian" : "little-endian";
    switch (layout.records) {
      case RecordMarkers::kNone:
        words += ", C (no record markers)";
        break;
      case RecordMarkers::kBytes4:
        words += ", Fortran (4-byte record markers)";
        break;
      case RecordMarkers::kBytes8:
        words += ", Fortran (8-byte record markers)";
        break;
    }
    words += layout.precision_bytes == 8 ? ", double precision" : ", single precision";
  }
  words += layout.multi_block ? ", multi-block" : ", single-block";
  if (layout.two_dimensional) words += ", 2-D";
  if (layout.kind == Plot3dKind::kGrid) words += layout.blanking ? ", iblank" : ", no iblank";
  return words;
}

std::string describe(const std::vector<Plot3dBlock>& blocks) {
  constexpr size_t kNamed = 4;
  std::string words = blocks.size() == 1 ? "1 block of " : fmt::format("{} blocks (", blocks.size());
  for (size_t n = 0; n < blocks.size() && n < kNamed; ++n)
    words += fmt::format("{}{}x{}x{}", n ? ", " : "", blocks[n].ni, blocks[n].nj, blocks[n].nk);
  if (blocks.size() > kNamed) words += ", ...";
  if (blocks.size() > 1) words += ")";
  return words;
}

namespace {

// Genuine subrecords have 2 GiB each: a file of 2 TiB has about a thousand. The limit rejects nonsense and
// keeps the table below 16 MiB.
constexpr size_t kMaxSegments = size_t{1} << 20;

}  // namespace

PayloadFile::PayloadFile(std::shared_ptr<const InputFile> file, uint64_t size, RecordMarkers records,
                         ByteOrder order)
    : file_(std::move(file)), file_size_(size), records_(records), order_(order) {
  if (records_ == RecordMarkers::kNone) {
    segments_.push_back({0, 0});
    size_ = end_in_file_ = file_size_;
  }
}

int64_t PayloadFile::markerAt(uint64_t offset) const {
  const bool swap = order_ != kMachineByteOrder;
  std::array<std::byte, 8> bytes{};
  if (records_ == RecordMarkers::kBytes8) {
    file_->readAt(offset, std::span(bytes));
    return loadStored<int64_t>(bytes.data(), swap);
  }
  file_->readAt(offset, std::span(bytes).first(4));
  return loadStored<int32_t>(bytes.data(), swap);
}

uint64_t PayloadFile::nextRecord() {
  CURVISPLAT_CHECK(records_ != RecordMarkers::kNone);
  const uint64_t marker_bytes = records_ == RecordMarkers::kBytes8 ? 8 : 4;
  uint64_t record_bytes = 0;
  for (bool first = true, more = true; more; first = false) {
    const uint64_t begin = end_in_file_;
    if (file_size_ - begin < 2 * marker_bytes)
      throw RecordMismatch("the file ends at byte {}, inside the record at byte {}", file_size_, begin);
    const int64_t leading = markerAt(begin);
    more = leading < 0;
    if (more && records_ == RecordMarkers::kBytes8)
      throw RecordMismatch("the record marker at byte {} is {}", begin, leading);
    const uint64_t bytes =
        more ? uint64_t{0} - static_cast<uint64_t>(leading) : static_cast<uint64_t>(leading);
    if (bytes > file_size_ - begin - 2 * marker_bytes)
      throw RecordMismatch("the record at byte {} declares {} bytes, but only {} are left in the file", begin,
                           bytes, file_size_ - begin - 2 * marker_bytes);
    const uint64_t end = begin + marker_bytes + bytes;
    const int64_t trailing = markerAt(end);
    const int64_t expected = first ? static_cast<int64_t>(bytes) : -static_cast<int64_t>(bytes);
    if (trailing != expected)
      throw RecordMismatch("the markers of the record at byte {} differ: {} before, {} after it at byte {}",
                           begin, leading, trailing, end);
    if (segments_.size() == kMaxSegments)
      throw RecordMismatch("there are more than {} records before byte {}", kMaxSegments, begin);
    segments_.push_back({size_, begin + marker_bytes});
    size_ += bytes;
    record_bytes += bytes;
    end_in_file_ = end + marker_bytes;
  }
  return record_bytes;
}

uint64_t PayloadFile::offsetInFile(uint64_t offset) const {
  if (offset >= size_) return end_in_file_;
  const auto next = std::upper_bound(segments_.begin(), segments_.end(), offset,
                                     [](uint64_t at, const Segment& segment) { return at < segment.offset; });
  const Segment& segment = *std::prev(next);
  return segment.offset_in_file + (offset - segment.offset);
}

void PayloadFile::readAt(uint64_t offset, std::span<std::byte> to) const {
  if (offset > size_ || to.size() > size_ - offset)
    throw Error("{}: expected {} bytes at offset {} of its records, which have {} bytes",
                file_->path().string(), to.size(), offset, size_);
  if (to.empty()) return;
  auto segment = std::prev(
      std::upper_bound(segments_.begin(), segments_.end(), offset,
                       [](uint64_t at, const Segment& candidate) { return at < candidate.offset; }));
  while (!to.empty()) {
    const auto next = std::next(segment);
    const uint64_t end = next == segments_.end() ? size_ : next->offset;
    const size_t count = static_cast<size_t>(std::min<uint64_t>(to.size(), end - offset));
    file_->readAt(segment->offset_in_file + (offset - segment->offset), to.first(count));
    to = to.subspan(count);
    offset += count;
    segment = next;
  }
}

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
        possible ? fmt::format("block {} of {} nodes does not fit into it; the file may be truncated", b + 1,
                               words)
                 : fmt::format("dimensions of {} are impossible; it may be of another kind", words)};
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
