#include "preprocess/convert/scratch_folder.h"

#include <unistd.h>

#include <atomic>
#include <utility>

#include "stream/base/disk_full.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

std::string ScratchFolder::beginOfName(const std::filesystem::path& cache) {
  constexpr size_t kMaxBytes =
      200;  // of the 255 of most file systems; others append 36, process and number included
  return cache.filename().string().substr(0, kMaxBytes);
}

std::filesystem::path ScratchFolder::newPath(const std::filesystem::path& parent, const std::string& name) {
  static std::atomic<unsigned> made = 0;  // several conversions in one process, as in tests
  return parent / fmt::format("{}.{}.{}", name, ::getpid(), made++);
}

ScratchFolder::ScratchFolder(std::filesystem::path path, Folder folder) : path_(std::move(path)) {
  if (folder == Folder::kTakeOver) return;
  try {
    makeFolder(path_);
  } catch (const DiskFull&) {
    throw;
  } catch (const Error& error) {
    throw Error("{}; temporary files go there: choose another directory with --tmp", error.what());
  }
}

ScratchFolder::~ScratchFolder() {
  if (!leave_) removeAll(path_);
}

}  // namespace curvisplat
