// Checks before a long conversion what would make it fail at its end: that the output may be written, that
// its folders are writable, and that their disks have space.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/splat_origin.h"
#include "stream/base/disk_space.h"

namespace curvisplat {

/// Bytes that conversion of a grid will need on disk: the temporary data for certain, the cache by
/// experience.
struct DiskNeeds {
  uint64_t temporary_bytes = 0;  // while the cache is written
  uint64_t cache_bytes = 0;
  uint64_t before_cache_bytes = 0;  // temporary, before the first byte of the cache

  uint64_t mostTemporary() const { return std::max(temporary_bytes, before_cache_bytes); }
};
DiskNeeds diskNeeds(uint64_t nodes, size_t variables);
/// Adds to `needs` what the grid's passes need beside its splats.
DiskNeeds with(const TemporaryNeeds& temporary, DiskNeeds needs);
/// The same for adding variables to a cache; `record_bytes`: what a splat takes in the temporary file.
DiskNeeds diskNeedsOfAdding(uint64_t splats, size_t variables, size_t record_bytes);

/// The costs of a conversion with one scalar, as a rule of thumb from grids that were measured: it differs
/// with the grid's shape, the scalar and the machine.
struct ConversionEstimate {
  uint64_t cache_bytes = 0, bytes_per_further_scalar = 0;
  double seconds = 0;
};
enum class SplatsOf { kGrid, kMeshPoints, kMeshCells };
/// `blocks`: of a structured grid; many small ones take longer.
ConversionEstimate estimateConversion(uint64_t splats, unsigned threads, SplatsOf what,
                                      std::span<const GridBlock> blocks = {});

/// Throws Error if something stands at `output` that may not be replaced, or if its folder or
/// `temporary_folder` is missing or not writable. Changes nothing.
void checkOutput(const std::filesystem::path& output, bool overwrite,
                 const std::filesystem::path& temporary_folder);

/// Throws Error if `folder` is missing or cannot be written; `hint` says what to do about it.
void checkWritable(const std::filesystem::path& folder, const char* hint);

inline constexpr const char* kFullDiskHint = "make room, or name a folder on another disk with --tmp";
inline constexpr const char* kSmallDiskHint =
    "make room, name a folder on another disk with --tmp, or skip this check with --no-preflight";

/// Throws Error if the disks of `output` and `temporary_folder` have too little space; the second function returns false.
/// `hint` says what to do if both are one disk.
void checkDiskSpace(const DiskNeeds& needs, const std::filesystem::path& output,
                    const std::filesystem::path& temporary_folder, const std::string& hint = kSmallDiskHint);
bool hasDiskSpace(const DiskNeeds& needs, const std::filesystem::path& output,
                  const std::filesystem::path& temporary_folder);

/// The report about a disk that fills up during a conversion.
RoomNeeded roomNeeded(const ConvertOptions& options);

}  // namespace curvisplat
