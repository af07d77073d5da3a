// A temporary folder whose files come from Python, as they are read (stream/base/mirror.h): a cache on a server.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <filesystem>

#include "stream/base/mirror.h"
#include "stream/base/temporary_files.h"

namespace curvisplat::python {

/// `fetch(name, offset, count)` returns (errno or 0, size of the file, bytes). Threads without the interpreter's lock call it, so
/// nobody may wait for their reads with it.
class RemoteFolder {
 public:
  /// Makes the folder in `parent`. Throws Error.
  RemoteFolder(const std::filesystem::path& parent, pybind11::object fetch);

  const std::filesystem::path& path() const { return mirror_.folder(); }
  uint64_t fetchedBytes() const { return mirror_.fetchedBytes(); }

 private:
  TemporarySubfolder folder_;
  Mirror mirror_;
};

}  // namespace curvisplat::python
