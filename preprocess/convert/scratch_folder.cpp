#include "preprocess/convert/scratch_folder.h"

#include <unistd.h>

#include <atomic>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

std::filesystem::path ScratchFolder::newPath(const std::filesystem::path& parent, const std::string& name) {
  static std::atomic<unsigned> made = 0;  // several conversions in one process, as in tests
  return parent / fmt::format("{}.{}.{}", name, ::getpid(), made++);
}

ScratchFolder::ScratchFolder(std::filesystem::path path, Folder folder) : path_(std::move(path)) {
  if (folder == Folder::kTakeOver) return;
  try {
    makeFolder(path_);
  } catch (const Error& error) {
    throw Error("{}; temporary files go there: choose another directory with --tmp", error.what());
  }
}

ScratchFolder::~ScratchFolder() {
  if (!leave_) removeAll(path_);
}

}  // namespace curvisplat
