#include "preprocess/plot3d_fit.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <utility>

#include "preprocess/stored_values.h"
#include "stream/error.h"

namespace curvisplat {
namespace {

// Random bytes may promise billions of blocks; real files have some ten thousand at most.
constexpr int64_t kMaxBlocks = 1'000'000;

/// Ends the attempt at one layout; never leaves this file.
struct Misfit {
  Plot3dMisfit::Reached reached;
  std::string reason;
};

/// Reads the numbers of a header, record by record.
class HeaderReader {
 public:
  HeaderReader(PayloadFile& payload, const Plot3dLayout& layout) : payload_(payload), layout_(layout) {}

  /// The bytes of the next record; nothing in a file without records.
  std::optional<uint64_t> record() {
    if (layout_.records == RecordMarkers::none) return std::nullopt;
    return payload_.nextRecord();
  }

  std::vector<int64_t> integers(uint64_t count) {
    const uint64_t width = layout_.integerBytes();
    if (offset_ > payload_.size() || count > (payload_.size() - offset_) / width)
      throw Misfit{Plot3dMisfit::first_record,
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
      throw Misfit{Plot3dMisfit::first_record, fmt::format("{} stands where a dimension should", number)};
    return static_cast<int64_t>(number);
  }

  PayloadFile& payload_;
  const Plot3dLayout& layout_;
  uint64_t offset_ = 0;
};

/// What the dimension record holds besides what the kind of file asks for, if that is known.
std::string explainDimensionRecord(const Plot3dLayout& layout, uint64_t blocks, uint64_t bytes) {
  if (layout.kind == Plot3dKind::function && bytes == 12 * blocks)
    return "; the number of variables is missing";
  if (bytes == 8 * blocks || (layout.kind == Plot3dKind::function && bytes == 12 * blocks))
    return "; that is a 2-D file, and only 3-D ones are read";
  if (layout.kind == Plot3dKind::q && bytes == 12 * blocks + 8)
    return "; that is a Q file as OVERFLOW writes it, which is not read: convert it to a plain Q or function "
           "file";
  return "";
}

struct Header {
  std::vector<Plot3dBlock> blocks;
  uint32_t components = 3;
  uint64_t bytes = 0;
};

uint64_t readBlockCount(HeaderReader& reader, const Plot3dLayout& layout, uint64_t file_size) {
  if (!layout.multi_block) return 1;
  if (const auto bytes = reader.record(); bytes && *bytes != 4)
    throw Misfit{Plot3dMisfit::nothing,
                 fmt::format("the first record has {} bytes, not the 4 of a block count", *bytes)};
  const int64_t count = reader.integers(1).front();
  if (count < 1 || count > kMaxBlocks ||
      static_cast<uint64_t>(count) > file_size / (3 * layout.integerBytes()))
    throw Misfit{Plot3dMisfit::nothing, fmt::format("a block count of {} is impossible", count)};
  return static_cast<uint64_t>(count);
}

Header readHeader(HeaderReader& reader, const Plot3dLayout& layout, uint64_t file_size) {
  const uint64_t count = readBlockCount(reader, layout, file_size);
  const uint64_t numbers = layout.kind == Plot3dKind::function ? 4 : 3;
  if (const auto bytes = reader.record(); bytes && *bytes != 4 * numbers * count) {
    const std::string explanation = explainDimensionRecord(layout, count, *bytes);
    throw Misfit{
        explanation.empty() ? Plot3dMisfit::first_record : Plot3dMisfit::known_structure,
        fmt::format("the dimension record has {} bytes where {} block{} of a {} need {}{}", *bytes, count,
                    count == 1 ? "" : "s", inWords(layout.kind), 4 * numbers * count, explanation)};
  }
  const std::vector<int64_t> dimensions = reader.integers(numbers * count);

  Header header;
  header.components = layout.kind == Plot3dKind::q ? 5 : 3;
  header.blocks.reserve(count);
  uint64_t nodes_left = file_size;  // a node takes more than a byte; sums of sizes stay far from overflow
  for (uint64_t b = 0; b < count; ++b) {
    const int64_t* at = &dimensions[b * numbers];
    Plot3dBlock block{static_cast<uint64_t>(at[0]), static_cast<uint64_t>(at[1]),
                      static_cast<uint64_t>(at[2])};
    uint64_t nodes = 0;
    const bool possible = at[0] > 0 && at[1] > 0 && at[2] > 0 &&
                          !__builtin_mul_overflow(block.ni, block.nj, &nodes) &&
                          !__builtin_mul_overflow(nodes, block.nk, &nodes) && nodes <= nodes_left;
    if (!possible)
      throw Misfit{Plot3dMisfit::first_record,
                   fmt::format("block {} of {}x{}x{} nodes does not go into {} bytes", b + 1, at[0], at[1],
                               at[2], file_size)};
    nodes_left -= nodes;
    if (layout.kind == Plot3dKind::function) {
      if (at[3] < 1 || static_cast<uint64_t>(at[3]) > file_size / nodes)
        throw Misfit{Plot3dMisfit::first_record, fmt::format("block {} has {} variables", b + 1, at[3])};
      if (b > 0 && static_cast<uint64_t>(at[3]) != header.components)
        throw Misfit{Plot3dMisfit::dimensions, fmt::format("block {} has {} variables and block 1 has {}",
                                                           b + 1, at[3], header.components)};
      header.components = static_cast<uint32_t>(at[3]);
    }
    header.blocks.push_back(block);
  }
  header.bytes = reader.offset();
  return header;
}

/// Mach, alpha, Reynolds number and time come before the values of a Q file's block.
uint64_t conditionBytes(const Plot3dLayout& layout) {
  return layout.kind == Plot3dKind::q ? 4u * static_cast<uint64_t>(layout.precision_bytes) : 0;
}

uint64_t valueBytes(const Plot3dLayout& layout, uint64_t nodes, uint32_t components) {
  const auto precision = static_cast<uint64_t>(layout.precision_bytes);
  return nodes * (components * precision + (layout.blanking ? layout.integerBytes() : 0));
}

/// The layouts that differ in what the header does not tell: precision and iblank.
std::vector<Plot3dLayout> variants(const Plot3dLayout& base, const Plot3dForce& force) {
  std::vector<Plot3dLayout> all;
  for (const int precision : {4, 8}) {
    if (base.ascii ? precision != 8 : force.precision_bytes.value_or(precision) != precision) continue;
    for (const bool blanking : {false, true}) {
      if (base.kind == Plot3dKind::grid ? force.blanking.value_or(blanking) != blanking : blanking) continue;
      all.push_back(base);
      all.back().precision_bytes = precision;
      all.back().blanking = blanking;
    }
  }
  return all;
}

std::string inWords(const Plot3dBlock& block) {
  return fmt::format("{}x{}x{}", block.ni, block.nj, block.nk);
}

/// "491520 (single precision, no iblank), ...": what would have been right.
template <typename Bytes>
std::string expectations(const std::vector<Plot3dLayout>& layouts, const Bytes& bytes) {
  std::string words;
  for (const Plot3dLayout& layout : layouts) {
    words += fmt::format("{}{}", words.empty() ? "" : ", ", bytes(layout));
    if (layout.ascii) continue;
    words += layout.precision_bytes == 8 ? " (double precision" : " (single precision";
    words += layout.kind == Plot3dKind::grid ? layout.blanking ? ", iblank)" : ", no iblank)" : ")";
  }
  return words;
}

/// The bytes of each block's records, hopped over.
std::vector<std::vector<uint64_t>> hopRecords(PayloadFile& payload, const Plot3dLayout& layout,
                                              const std::vector<Plot3dBlock>& blocks) {
  std::vector<std::vector<uint64_t>> records(blocks.size());
  for (size_t b = 0; b < blocks.size(); ++b) {
    const size_t count = layout.kind == Plot3dKind::q ? 2 : 1;
    for (size_t r = 0; r < count; ++r) {
      try {
        records[b].push_back(payload.nextRecord());
      } catch (const RecordMismatch& mismatch) {
        throw Misfit{Plot3dMisfit::dimensions,
                     fmt::format("block {} of {} nodes: {}", b + 1, inWords(blocks[b]), mismatch.what())};
      }
    }
  }
  return records;
}

/// A file in the planes format has a record of each k-plane.
bool isPlanes(const std::vector<Plot3dLayout>& layouts, const Plot3dBlock& block, uint32_t components,
              uint64_t record_bytes) {
  if (block.nk < 2) return false;
  for (const Plot3dLayout& layout : layouts)
    if (record_bytes == valueBytes(layout, block.ni * block.nj, components)) return true;
  return false;
}

void fitRecords(const std::vector<Plot3dLayout>& layouts, PayloadFile payload, const Header& header,
                Plot3dFits& found) {
  const auto records = hopRecords(payload, layouts.front(), header.blocks);
  for (size_t b = 0; b < header.blocks.size(); ++b) {
    const Plot3dBlock& block = header.blocks[b];
    const auto expected = [&](const Plot3dLayout& layout) {
      return valueBytes(layout, block.nodes(), header.components);
    };
    bool matches = false;
    for (const Plot3dLayout& layout : layouts) matches |= records[b].back() == expected(layout);
    if (matches) continue;
    if (isPlanes(layouts, block, header.components, records[b].back()))
      throw Misfit{
          Plot3dMisfit::known_structure,
          fmt::format("block {} of {} nodes has a record for each k-plane; only the whole format, one "
                      "record a block, is read",
                      b + 1, inWords(block))};
    throw Misfit{Plot3dMisfit::dimensions,
                 fmt::format("block {} of {} nodes has a record of {} bytes, expected: {}", b + 1,
                             inWords(block), records[b].back(), expectations(layouts, expected))};
  }
  bool fits = false;
  for (const Plot3dLayout& layout : layouts) {
    Plot3dFit fit{layout, payload, header.blocks, header.components, payload.bytesBehind()};
    uint64_t offset = header.bytes;
    bool exact = true;
    for (size_t b = 0; b < header.blocks.size(); ++b) {
      exact &= records[b].back() == valueBytes(layout, header.blocks[b].nodes(), header.components);
      if (layout.kind == Plot3dKind::q) exact &= records[b].front() == conditionBytes(layout);
      offset += conditionBytes(layout);
      fit.blocks[b].values_offset = offset;
      offset += records[b].back();
    }
    if (exact) found.fits.push_back(std::move(fit));
    fits |= exact;
  }
  if (!fits)
    throw Misfit{Plot3dMisfit::dimensions, "the records of its blocks do not agree in precision and iblank"};
}

void fitSize(const std::vector<Plot3dLayout>& layouts, const PayloadFile& payload, const Header& header,
             Plot3dFits& found) {
  const auto expected = [&](const Plot3dLayout& layout) {
    uint64_t bytes = header.bytes;
    for (const Plot3dBlock& block : header.blocks)
      bytes += conditionBytes(layout) + valueBytes(layout, block.nodes(), header.components);
    return bytes;
  };
  bool fits = false;
  for (const Plot3dLayout& layout : layouts) {
    const uint64_t bytes = expected(layout);
    if (payload.size() < bytes || payload.size() - bytes > bytes / 8) continue;
    Plot3dFit fit{layout, payload, header.blocks, header.components, payload.size() - bytes};
    uint64_t offset = header.bytes;
    for (Plot3dBlock& block : fit.blocks) {
      block.values_offset = offset + conditionBytes(layout);
      offset = block.values_offset + valueBytes(layout, block.nodes(), header.components);
    }
    found.fits.push_back(std::move(fit));
    fits = true;
  }
  if (fits) return;
  // Random bytes often make dimensions that "go into" the file somehow; a truncated file misses less.
  const bool near = expected(layouts.front()) / 4 <= payload.size();
  const uint64_t unit = layouts.front().ascii ? sizeof(double) : 1;
  throw Misfit{near ? Plot3dMisfit::dimensions : Plot3dMisfit::first_record,
               fmt::format("{} should have {} {}, it has {}", curvisplat::inWords(header.blocks),
                           unit == 1 ? "bytes:" : "numbers:",
                           expectations(layouts, [&](const Plot3dLayout& l) { return expected(l) / unit; }),
                           payload.size() / unit)};
}

void fitHeader(const Plot3dCandidates& candidates, const Plot3dLayout& base, Plot3dFits& found) {
  std::vector<Plot3dBlock> blocks;
  try {
    PayloadFile payload(candidates.file, candidates.size, base.records, base.byte_order);
    HeaderReader reader(payload, base);
    const Header header = readHeader(reader, base, candidates.size);
    blocks = header.blocks;
    const auto layouts = variants(base, candidates.force);
    if (base.records == RecordMarkers::none)
      fitSize(layouts, payload, header, found);
    else
      fitRecords(layouts, std::move(payload), header, found);
  } catch (const Misfit& misfit) {
    found.misfits.push_back({misfit.reached, base, misfit.reason, std::move(blocks)});
  } catch (const RecordMismatch& mismatch) {
    found.misfits.push_back({Plot3dMisfit::nothing, base, mismatch.what(), {}});
  }
}

}  // namespace

Plot3dFits fitPlot3d(const Plot3dCandidates& candidates) {
  Plot3dFits found;
  const Plot3dForce& force = candidates.force;
  for (const Plot3dKind kind : candidates.kinds)
    for (const bool multi_block : {false, true}) {
      if (force.multi_block.value_or(multi_block) != multi_block) continue;
      if (candidates.ascii) {
        const Plot3dLayout layout{kind, true, kMachineByteOrder, RecordMarkers::none, 8, multi_block, false};
        fitHeader(candidates, layout, found);
        continue;
      }
      for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
        if (force.byte_order.value_or(order) != order) continue;
        for (const RecordMarkers records :
             {RecordMarkers::none, RecordMarkers::bytes4, RecordMarkers::bytes8}) {
          if (force.records.value_or(records) != records) continue;
          fitHeader(candidates, {kind, false, order, records, 4, multi_block, false}, found);
        }
      }
    }
  return found;
}

}  // namespace curvisplat
