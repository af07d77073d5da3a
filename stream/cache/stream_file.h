// Appends streams and tables to payload files, for all code that writes one. cache_format.h has the layout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/manifest.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/brick_codec.h"
#include "stream/model/octree.h"

namespace curvisplat {

template <typename Record>
std::span<const std::byte> bytesOf(const std::vector<Record>& records) {
  return std::as_bytes(std::span(records));
}

template <typename Record>
std::span<const std::byte> bytesOf(const Record& record) {
  return std::as_bytes(std::span(&record, 1));
}

/// Appends zeros up to the next page boundary.
void padToPage(OutputFile& file);

/// Appends a stream, aligned as cache_format.h describes. Returns its offset.
uint64_t appendStream(OutputFile& file, std::span<const std::byte> stream);

/// Begins a var.<number>.bin: reserves space for the header, which finishVariableFile() writes.
void beginVariableFile(OutputFile& file);

/// Appends the values of a brick and fills its record in the table; once for each brick.
void appendValues(OutputFile& file, const EncodedValues& values, BrickVariable& record);

/// Appends the histogram, if there is one, and the table, writes the header and closes the file. `table` is in the
/// order of bricks.bin. `name`: the file's name in the manifest. Returns the manifest's entry.
FileInfo finishVariableFile(OutputFile& file, const std::string& name, std::span<const BrickVariable> table,
                            const std::optional<ValueHistogram>& histogram = std::nullopt);

}  // namespace curvisplat
