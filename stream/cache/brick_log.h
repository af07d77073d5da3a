// What a CacheWriter has appended, brick by brick: from it a conversion that was interrupted goes on. It lies
// in the partial folder beside the streams and never comes into a cache. Nothing is synced: an entry whose
// checksum is wrong is where the log ends.
//
//   entry:  BrickRecord 144 | weight 8 | VariableRecord 40 x variables | checksum of these bytes 8
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "stream/base/file.h"
#include "stream/model/brick.h"

namespace curvisplat {

inline constexpr const char* kBrickLogName = "bricks.log";

/// A brick without parent and children, and where its streams are.
struct AppendedBrick {
  Brick brick;
  double weight = 0;  // EncodedBrick::weight
  std::vector<BrickVariable> variables;
};

/// The entries of the log in `folder`, up to the first that is damaged; none if there is no log. Throws Error
/// if the disk fails.
std::vector<AppendedBrick> readBrickLog(const std::filesystem::path& folder, size_t variables);

/// For one thread.
class BrickLog {
 public:
  /// Opens the log in `folder`, or makes it.
  BrickLog(const std::filesystem::path& folder, size_t variables);

  void append(const AppendedBrick& brick);
  /// Forgets all entries but the first `count`.
  void keep(uint64_t count);

 private:
  size_t variables_;
  OutputFile file_;
  std::vector<std::byte> entry_;
};

}  // namespace curvisplat
