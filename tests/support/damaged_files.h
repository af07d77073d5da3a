// Opens damaged copies of a file in processes of their own, so that a crash, a hang or a wish for too much
// memory is counted and ends nothing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// How many of the copies ended how.
struct DamageReport {
  int same = 0, changed = 0;  // read; as the whole file, or with other values
  int refused = 0;            // an Error of one line that names the file
  /// Faults, none of which must be: which copy, and how it ended.
  std::vector<std::string> failures;
  /// Crashes inside of a library that reads the format.
  std::vector<std::string> library_crashes;
};

/// Opens a copy as a grid.
using OpenDamaged = std::function<std::unique_ptr<GridSource>(const std::filesystem::path& file)>;

/// The first bytes of `file`, cut at `count` places all over it.
DamageReport openTruncated(const std::filesystem::path& file, int count, const OpenDamaged& open);

/// `count` copies of `file` with one byte changed, seeded.
DamageReport openCorrupted(const std::filesystem::path& file, int count, uint64_t seed,
                           const OpenDamaged& open);

/// The failures, a line each. Prints the counts, and the crashes of libraries, which are no failures of ours.
std::string harm(const char* what, const DamageReport& report);

}  // namespace curvisplat
