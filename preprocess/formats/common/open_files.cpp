#include "preprocess/formats/common/open_files.h"

#include <algorithm>

namespace curvisplat {

std::shared_ptr<const InputFile> OpenFiles::at(const std::filesystem::path& path) {
  const MutexLock lock(mutex_);
  const auto found =
      std::find_if(files_.begin(), files_.end(), [&](const auto& file) { return file->path() == path; });
  if (found != files_.end()) {
    files_.splice(files_.begin(), files_, found);
  } else {
    if (files_.size() == most_) files_.pop_back();
    files_.push_front(std::make_shared<const InputFile>(path));
  }
  return files_.front();
}

PooledFile::PooledFile(std::shared_ptr<OpenFiles> pool, std::filesystem::path path)
    : pool_(std::move(pool)), path_(std::move(path)), size_(pool_->at(path_)->size()) {}

}  // namespace curvisplat
