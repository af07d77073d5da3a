#include "stream/cache/stream_file.h"

#include <array>
#include <utility>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_format.h"

namespace curvisplat {
namespace {

constexpr std::array<std::byte, kPageBytes> kZeros{};

/// Appends zeros up to `offset`.
void padTo(OutputFile& file, uint64_t offset) {
  CURVISPLAT_CHECK_OP(offset - file.size(), <=, kPageBytes);
  file.append(std::span(kZeros).first(offset - file.size()));
}

}  // namespace

void padToPage(OutputFile& file) {
  padTo(file, (file.size() + kPageBytes - 1) / kPageBytes * kPageBytes);
}

uint64_t appendStream(OutputFile& file, std::span<const std::byte> stream) {
  padTo(file, streamOffset(file.size(), stream.size()));
  const uint64_t offset = file.size();
  file.append(stream);
  return offset;
}

void beginVariableFile(OutputFile& file) {
  file.append(bytesOf(VariableHeader{}));
}

void appendValues(OutputFile& file, const EncodedValues& values, BrickVariable& record) {
  CURVISPLAT_CHECK_OP(record.values.length, ==, 0u);
  record = values.variable;
  record.values.offset = appendStream(file, values.bytes);
}

FileInfo finishVariableFile(OutputFile& file, const std::string& name, std::span<const BrickVariable> table,
                            const std::optional<ValueHistogram>& histogram) {
  std::vector<VariableRecord> records;
  records.reserve(table.size());
  for (const BrickVariable& variable : table) records.push_back(recordOf(variable));
  if (histogram) {
    // The histogram ends where the table begins.
    const HistogramRecord record = recordOf(*histogram);
    const bool has_percentiles = !histogram->percentiles.empty();
    const uint64_t bytes = sizeof record + (has_percentiles ? sizeof(PercentilesRecord) : 0);
    const uint64_t pages = (file.size() + bytes + kPageBytes - 1) / kPageBytes;
    padTo(file, pages * kPageBytes - bytes);
    if (has_percentiles) file.append(bytesOf(percentilesOf(*histogram)));
    file.append(bytesOf(record));
  }
  padToPage(file);
  VariableHeader header;
  header.record_bytes = sizeof(VariableRecord);
  header.bricks = records.size();
  header.table_offset = file.size();
  file.append(bytesOf(records));
  file.writeAt(0, bytesOf(header));
  Checksum checksum;
  checksum.add(bytesOf(header));
  checksum.add(bytesOf(records));
  FileInfo info{name, file.size(), checksum.value()};
  file.close();
  return info;
}

}  // namespace curvisplat
