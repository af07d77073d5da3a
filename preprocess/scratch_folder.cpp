#include "preprocess/scratch_folder.h"

#include <unistd.h>

#include <atomic>
#include <utility>

#include "stream/error.h"

namespace curvisplat {

std::filesystem::path ScratchFolder::newPath(const std::filesystem::path& parent, const std::string& name) {
  static std::atomic<unsigned> made = 0;  // several conversions in one process, as in tests
  return parent / fmt::format("{}.{}.{}", name, ::getpid(), made++);
}

ScratchFolder::ScratchFolder(std::filesystem::path path, Folder folder) : path_(std::move(path)) {
  if (folder == Folder::kTakeOver) return;
  std::error_code error;
  if (!std::filesystem::create_directories(path_, error) || error)
    throw Error("{}: the folder for temporary files cannot be made: {}; name another place with --tmp",
                path_.string(), error ? error.message() : "it exists");
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!leave_) std::filesystem::remove_all(path_, ignored);
}

}  // namespace curvisplat
