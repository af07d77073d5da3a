#include "preprocess/formats/plot3d/plot3d_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/plot3d/plot3d_layout.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Size of the numbers before a block's values. Q file: Mach, alpha, Reynolds number and time. OVERFLOW file:
/// thirteen numbers, one integer, and a gas constant for each of at least two species.
uint64_t conditionBytes(const Plot3dLayout& layout, uint32_t species) {
  const auto precision = static_cast<uint64_t>(layout.precision_bytes);
  if (layout.kind == Plot3dKind::kOverflow) return (13 + std::max(2u, species)) * precision + 4;
  return layout.kind == Plot3dKind::kQ ? 4 * precision : 0;
}

bool hasConditions(const Plot3dLayout& layout) {
  return layout.kind == Plot3dKind::kQ || layout.kind == Plot3dKind::kOverflow;
}

uint64_t valueBytes(const Plot3dLayout& layout, uint64_t nodes, uint32_t components) {
  const auto precision = static_cast<uint64_t>(layout.precision_bytes);
  return nodes * (components * precision + (layout.blanking ? layout.integerBytes() : 0));
}

/// The layouts that differ only in properties the header does not determine: precision and iblank.
std::vector<Plot3dLayout> variants(const Plot3dLayout& base, const Plot3dForce& force) {
  std::vector<Plot3dLayout> all;
  for (const int precision : {4, 8}) {
    if (base.ascii ? precision != 8 : force.precision_bytes.value_or(precision) != precision) continue;
    for (const bool blanking : {false, true}) {
      if (base.kind == Plot3dKind::kGrid ? force.blanking.value_or(blanking) != blanking : blanking) continue;
      all.push_back(base);
      all.back().precision_bytes = precision;
      all.back().blanking = blanking;
    }
  }
  return all;
}

std::string sizeText(const Plot3dBlock& block) {
  return fmt::format("{}x{}x{}", block.ni, block.nj, block.nk);
}

/// "491520 (single precision, no iblank), ...": the sizes that would have fitted.
template <typename Bytes>
std::string expectations(const std::vector<Plot3dLayout>& layouts, const Bytes& bytes) {
  std::string words;
  for (const Plot3dLayout& layout : layouts) {
    words += fmt::format("{}{}", words.empty() ? "" : ", ", bytes(layout));
    if (layout.ascii) continue;
    words += layout.precision_bytes == 8 ? " (double precision" : " (single precision";
    words += layout.kind == Plot3dKind::kGrid ? layout.blanking ? ", iblank)" : ", no iblank)" : ")";
  }
  return words;
}

/// Skips the records of all blocks, and returns the sizes of each block's.
std::vector<std::vector<uint64_t>> hopRecords(PayloadFile& payload, const Plot3dLayout& layout,
                                              const std::vector<Plot3dBlock>& blocks) {
  std::vector<std::vector<uint64_t>> records(blocks.size());
  for (size_t b = 0; b < blocks.size(); ++b) {
    const size_t count = hasConditions(layout) ? 2 : 1;
    for (size_t r = 0; r < count; ++r) {
      try {
        records[b].push_back(payload.nextRecord());
      } catch (const RecordMismatch& mismatch) {
        throw LayoutMisfit{LayoutMisfit::kDimensions, fmt::format("block {} of {} nodes: {}", b + 1,
                                                                  sizeText(blocks[b]), mismatch.what())};
      }
    }
  }
  return records;
}

/// Whether the file is in the planes format, which has a record for each k-plane.
bool isPlanes(const std::vector<Plot3dLayout>& layouts, const Plot3dBlock& block, uint32_t components,
              uint64_t record_bytes) {
  if (block.nk < 2) return false;
  for (const Plot3dLayout& layout : layouts)
    if (record_bytes == valueBytes(layout, block.ni * block.nj, components)) return true;
  return false;
}

void fitRecords(const std::vector<Plot3dLayout>& layouts, PayloadFile payload, const Plot3dHeader& header,
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
      throw LayoutMisfit{
          LayoutMisfit::kKnownStructure,
          fmt::format("block {} of {} nodes has a record for each k-plane; expected the whole format (one "
                      "record per block)",
                      b + 1, sizeText(block))};
    throw LayoutMisfit{LayoutMisfit::kDimensions,
                       fmt::format("block {} of {} nodes has a record of {} bytes; expected {}", b + 1,
                                   sizeText(block), records[b].back(), expectations(layouts, expected))};
  }
  bool fits = false;
  for (const Plot3dLayout& layout : layouts) {
    Plot3dFit fit{layout, payload, header.blocks, header.components, payload.bytesBehind(), header.species};
    uint64_t offset = header.bytes;
    bool exact = true;
    for (size_t b = 0; b < header.blocks.size(); ++b) {
      exact &= records[b].back() == valueBytes(layout, header.blocks[b].nodes(), header.components);
      if (hasConditions(layout)) exact &= records[b].front() == conditionBytes(layout, header.species);
      offset += conditionBytes(layout, header.species);
      fit.blocks[b].values_offset = offset;
      offset += records[b].back();
    }
    if (exact) found.fits.push_back(std::move(fit));
    fits |= exact;
  }
  if (!fits)
    throw LayoutMisfit{LayoutMisfit::kDimensions, "the records of its blocks differ in precision or iblank"};
}

void fitSize(const std::vector<Plot3dLayout>& layouts, const PayloadFile& payload, const Plot3dHeader& header,
             Plot3dFits& found) {
  const auto expected = [&](const Plot3dLayout& layout) {
    uint64_t bytes = header.bytes;
    for (const Plot3dBlock& block : header.blocks)
      bytes += conditionBytes(layout, header.species) + valueBytes(layout, block.nodes(), header.components);
    return bytes;
  };
  bool fits = false;
  for (const Plot3dLayout& layout : layouts) {
    const uint64_t bytes = expected(layout);
    const uint64_t most_trailing = layout.two_dimensional ? 0 : bytes / 8;
    if (payload.size() < bytes || payload.size() - bytes > most_trailing) continue;
    Plot3dFit fit{layout, payload, header.blocks, header.components, payload.size() - bytes, header.species};
    uint64_t offset = header.bytes;
    for (Plot3dBlock& block : fit.blocks) {
      block.values_offset = offset + conditionBytes(layout, header.species);
      offset = block.values_offset + valueBytes(layout, block.nodes(), header.components);
    }
    found.fits.push_back(std::move(fit));
    fits = true;
  }
  if (fits) return;
  // Random bytes often give dimensions that seem to fit the file; a truncated file lacks less than that.
  const bool near = expected(layouts.front()) / 4 <= payload.size();
  const uint64_t unit = layouts.front().ascii ? sizeof(double) : 1;
  const bool cut_off = near && std::all_of(layouts.begin(), layouts.end(), [&](const Plot3dLayout& layout) {
                         return payload.size() < expected(layout);
                       });
  throw LayoutMisfit{
      near ? LayoutMisfit::kDimensions : LayoutMisfit::kFirstRecord,
      fmt::format("{}{}: found {} {}; expected {}", cut_off ? "the file seems to be truncated: " : "",
                  curvisplat::describe(header.blocks), payload.size() / unit, unit == 1 ? "bytes" : "numbers",
                  expectations(layouts, [&](const Plot3dLayout& l) { return expected(l) / unit; }))};
}

void fitHeader(const Plot3dCandidates& candidates, const Plot3dLayout& base, Plot3dFits& found) {
  std::vector<Plot3dBlock> blocks;
  try {
    PayloadFile payload(candidates.file, candidates.size, base.records, base.byte_order);
    const Plot3dHeader header = readPlot3dHeader(payload, base, candidates.size);
    blocks = header.blocks;
    const auto layouts = variants(base, candidates.force);
    if (base.records == RecordMarkers::kNone)
      fitSize(layouts, payload, header, found);
    else
      fitRecords(layouts, std::move(payload), header, found);
  } catch (const LayoutMisfit& misfit) {
    if (!base.two_dimensional)
      found.misfits.push_back({misfit.reached, base, misfit.reason, std::move(blocks)});
  } catch (const RecordMismatch& mismatch) {
    if (!base.two_dimensional) found.misfits.push_back({LayoutMisfit::kNothing, base, mismatch.what(), {}});
  }
}

}  // namespace

Plot3dFits fitPlot3d(const Plot3dCandidates& candidates) {
  Plot3dFits found;
  const Plot3dForce& force = candidates.force;
  for (const Plot3dKind kind : candidates.kinds)
    for (const bool two_dimensional : {false, true})
      for (const bool multi_block : {false, true}) {
        if (force.multi_block.value_or(multi_block) != multi_block) continue;
        Plot3dLayout layout;
        layout.kind = kind;
        layout.multi_block = multi_block;
        layout.two_dimensional = two_dimensional;
        if (candidates.ascii) {
          if (kind == Plot3dKind::kOverflow) continue;
          layout.ascii = true;
          layout.byte_order = kMachineByteOrder;
          layout.precision_bytes = 8;
          fitHeader(candidates, layout, found);
          continue;
        }
        for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
          if (force.byte_order.value_or(order) != order) continue;
          for (const auto records : {RecordMarkers::kNone, RecordMarkers::kBytes4, RecordMarkers::kBytes8}) {
            if (force.records.value_or(records) != records) continue;
            // OVERFLOW is a Fortran program.
            if (kind == Plot3dKind::kOverflow && records == RecordMarkers::kNone) continue;
            layout.byte_order = order;
            layout.records = records;
            fitHeader(candidates, layout, found);
          }
        }
      }
  return found;
}

}  // namespace curvisplat
