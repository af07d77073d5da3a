// How streams and tables go into a cache's payload files; cache_format.h has the layout. Shared by all that
// write one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/manifest.h"
#include "stream/model/brick.h"

namespace curvisplat {

template <typename Record>
std::span<const std::byte> bytesOf(const std::vector<Record>& records) {
  return std::as_bytes(std::span(records));
}

template <typename Record>
std::span<const std::byte> bytesOf(const Record& record) {
  return std::as_bytes(std::span(&record, 1));
}

/// Appends zeros up to the next page.
void padToPage(OutputFile& file);

/// Appends a stream where cache_format.h wants it. Returns its offset.
uint64_t appendStream(OutputFile& file, std::span<const std::byte> stream);

/// Makes a new file a var.<number>.bin: with the header's place, which finishVariableFile fills in.
void beginVariableFile(OutputFile& file);

/// Appends the table, in the order of bricks.bin, writes the header, and closes the file. `name` is what the
/// manifest will call it.
FileInfo finishVariableFile(OutputFile& file, const std::string& name, std::span<const BrickVariable> table);

}  // namespace curvisplat
