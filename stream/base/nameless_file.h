// Temporary files without a name: each is removed from its folder as soon as it is open, and the system frees its space
// when it is closed, however the process ends. For data that does not fit in memory and that nobody else reads. Errors name
// the folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

#include "stream/base/file.h"

namespace curvisplat {

/// A folder for such files, and the bytes that they take together. Copies share their files. Any thread.
class ScratchFiles {
 public:
  ScratchFiles(std::filesystem::path folder);  // NOLINT(google-explicit-constructor): a folder will do

  const std::filesystem::path& folder() const { return folder_; }
  /// Counts files of other kinds too, while the returned object lives. `bytes` must not use these ScratchFiles.
  [[nodiscard]] std::shared_ptr<void> countBeside(std::function<uint64_t()> bytes) const;
  /// Bytes of all files together, at the moment when they were the most. A file has all of its bytes up to its end.
  uint64_t mostBytes() const;

 private:
  friend class NamelessFile;
  struct State;
  std::filesystem::path folder_;
  std::shared_ptr<State> state_;
};

class NamelessFile {
 public:
  /// Throws Error if no file can be made there.
  explicit NamelessFile(const ScratchFiles& scratch);
  NamelessFile(const NamelessFile&) = delete;
  NamelessFile& operator=(const NamelessFile&) = delete;

  OutputFile& out() { return out_; }
  /// Reads what has been written; size() says nothing.
  const InputFile& in() const { return in_; }

 private:
  OutputFile out_;
  InputFile in_;
  std::shared_ptr<void> counted_;  // last: it uses the file
};

}  // namespace curvisplat
