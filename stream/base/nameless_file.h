// A temporary file without a name: it is removed from its folder as soon as it is open, and the system frees its space
// when it is closed, however the process ends. For data that does not fit in memory and that nobody else reads.
#pragma once

#include <filesystem>

#include "stream/base/file.h"

namespace curvisplat {

class NamelessFile {
 public:
  /// In `folder`. Throws Error if no file can be made there.
  explicit NamelessFile(const std::filesystem::path& folder);

  OutputFile& out() { return out_; }
  /// Reads what has been written; size() says nothing.
  const InputFile& in() const { return in_; }

 private:
  OutputFile out_;
  InputFile in_;
};

}  // namespace curvisplat
