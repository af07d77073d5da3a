#include "stream/base/nameless_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>

namespace curvisplat {
namespace {

/// A name that no other file of this kind in this folder has while it is visible.
std::filesystem::path uniqueName(const std::filesystem::path& folder) {
  static std::atomic<unsigned> files = 0;
  return folder / fmt::format("curvisplat.{}.{}.tmp", ::getpid(), files++);
}

InputFile openWithoutName(const std::filesystem::path& path) {
  try {
    InputFile in(path);
    removeFile(path);
    return in;
  } catch (...) {
    removeAll(path);
    throw;
  }
}

}  // namespace

NamelessFile::NamelessFile(const std::filesystem::path& folder)
    : out_(uniqueName(folder)), in_(openWithoutName(out_.path())) {}

}  // namespace curvisplat
