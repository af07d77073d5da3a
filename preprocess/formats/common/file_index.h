// The parts of files that have been found: each time step of a file is opened anew, and would look through all of it again without
// them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "stream/base/mutex.h"

namespace curvisplat {

/// Numbers of a text that follow one another, or a time step.
struct FilePart {
  uint64_t begin = 0, end = 0;  // bytes
  uint64_t count = 0;           // of numbers
  int digits = 0;               // the most significant ones among the first numbers
};
using FileParts = std::vector<FilePart>;  // in the order of the file

/// A file as it is now. It is another version once the file has changed.
struct FileVersion {
  std::filesystem::path file;
  uint64_t size = 0;
  std::filesystem::file_time_type changed;
  bool operator==(const FileVersion&) const = default;

  static FileVersion of(const std::filesystem::path& file) {
    std::error_code ignored;  // whoever reads the file reports it
    return {file, std::filesystem::file_size(file, ignored), std::filesystem::last_write_time(file, ignored)};
  }
};

/// The parts of files, as far as they have been found. Any thread.
class FileIndex {
 public:
  /// Null if none is known of this version.
  std::shared_ptr<const FileParts> find(const FileVersion& version) {
    const MutexLock lock(mutex_);
    const auto known = files_.find(version.file);
    return known != files_.end() && known->second.first == version ? known->second.second : nullptr;
  }
  void keep(const FileVersion& version, FileParts parts) {
    const MutexLock lock(mutex_);
    files_[version.file] = {version, std::make_shared<const FileParts>(std::move(parts))};
  }

 private:
  Mutex mutex_;
  std::map<std::filesystem::path, std::pair<FileVersion, std::shared_ptr<const FileParts>>> files_
      GUARDED_BY(mutex_);
};

}  // namespace curvisplat
