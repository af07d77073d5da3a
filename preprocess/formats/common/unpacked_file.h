// Files compressed as a whole by gzip, xz or zstd: decompressed once, into a temporary file, since grids are
// read by position. Needs some megabytes of memory; xz and zstd files say how much, up to kUnpackingMemory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "stream/base/file.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

inline constexpr uint64_t kUnpackingMemory = uint64_t{128} << 20;

class UnpackedFile {
 public:
  /// Whether the file begins like one of the three formats.
  static bool recognises(const InputFile& file);

  /// Decompresses `path` into `folder`. Throws Error with `path` if it is damaged, truncated or needs more
  /// memory, and with `folder` if there is no space. What killed processes have left in `folder` is removed.
  UnpackedFile(const std::filesystem::path& path, const std::filesystem::path& folder);

  /// The compressed file.
  const std::filesystem::path& original() const { return original_; }
  /// The decompressed file, until removeName(): in a folder of its own, called as the original without its
  /// ending.
  const std::filesystem::path& path() const { return path_; }
  /// To be called once a reader has opened the file: it then vanishes with the process, however that ends.
  void removeName() { folder_.remove(); }

 private:
  std::filesystem::path original_;
  TemporarySubfolder folder_;
  std::filesystem::path path_;
};

}  // namespace curvisplat
