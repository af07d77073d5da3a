// The log of the bricks that a CacheWriter has appended. An interrupted conversion continues from it. The log
// is in the partial folder beside the streams and never becomes part of a cache. Nothing is synced: the log
// ends at the first entry whose checksum is wrong.
//
//   entry:  BrickRecord 144 | weight 8 | VariableRecord 40 x variables | checksum of the bytes before it 8
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "stream/base/file.h"
#include "stream/model/brick.h"

namespace curvisplat {

inline constexpr const char* kBrickLogName = "bricks.log";

/// A brick, without links to parent and children, and the extents of its streams.
struct AppendedBrick {
  Brick brick;
  double weight = 0;  // EncodedBrick::weight
  std::vector<BrickVariable> variables;
};

/// Calls `use` for each entry of the log in `folder`, until it returns false or an entry is damaged; never without a log.
/// Throws Error if the disk fails.
void forEachLogged(const std::filesystem::path& folder, size_t variables,
                   const std::function<bool(AppendedBrick&&)>& use);

/// The entries of the log in `folder`, up to the first damaged one; empty if there is no log. Throws Error if
/// the disk fails.
std::vector<AppendedBrick> readBrickLog(const std::filesystem::path& folder, size_t variables);

/// For one thread at a time.
class BrickLog {
 public:
  /// Opens the log in `folder`; creates it if it does not exist. Throws Error.
  BrickLog(const std::filesystem::path& folder, size_t variables);

  void append(const AppendedBrick& brick);
  void sync() { file_.sync(); }
  /// Syncs and closes it, so that another machine may read it. Nothing may follow.
  void close() { file_.close(); }
  /// Truncates the log to its first `count` entries.
  void keep(uint64_t count);

 private:
  size_t variables_;
  OutputFile file_;
  std::vector<std::byte> entry_;
};

}  // namespace curvisplat
