// What a disk would hold if the power went: calls are recorded as they are made, and replayed on a model of a
// disk that keeps for certain only what was synced.
//
//   a file's bytes      as they were at its last fsync, or later ones, or zeros in their place, or half of
//   them the names in a      as they were at the last fsync of the folder, or as they are; each folder on its
//   own folder              (a file system's journal is kinder, and promises no more than this)
//
// Renaming and exchanging within a folder is one step.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "tests/support/folder_files.h"

namespace curvisplat::faults {

/// One call that changes the disk.
struct DiskCall {
  enum class Kind { kOpen, kWrite, kTruncate, kSync, kRename, kExchange, kMakeFolder, kRemove } kind;
  std::string path, other;  // as given
  int fd = -1;
  int flags = 0;
  int64_t offset = 0;  // or size
  std::string bytes;
};

/// Does the calls, but for syncing, and writes them down. Put in place with ScopedSystemCalls; any thread.
class RecordingSystemCalls : public SystemCalls {
 public:
  /// In their order, when no more are made.
  const std::vector<DiskCall>& calls() const { return calls_; }

  int open(const char* path, int flags, unsigned mode) override;
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override;
  int truncate(int fd, int64_t size) override;
  int fsync(int fd) override;
  int rename(const char* from, const char* to) override;
  int exchange(const char* a, const char* b) override;
  int mkdir(const char* path, unsigned mode) override;
  int remove(const char* path) override;

 private:
  std::mutex mutex_;  // the order of calls is that of their effects
  std::vector<DiskCall> calls_;
};

/// Folders below the root, and their files.
using DiskState = std::map<std::string, Files>;

/// Calls `check` with every state that a loss of power could leave of what is below `root` (folders, and
/// files in them; files in the root itself are in the folder ""), and with the number of calls made until
/// then. `before`: what was there for certain before the first of `calls`. A state that has been checked is
/// not checked again.
void forEachPowerLoss(const std::filesystem::path& root, const DiskState& before,
                      const std::vector<DiskCall>& calls,
                      const std::function<void(const DiskState&, size_t call)>& check);

}  // namespace curvisplat::faults
