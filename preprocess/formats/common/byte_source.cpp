#include "preprocess/formats/common/byte_source.h"

#include <sys/resource.h>

#include <algorithm>
#include <string>
#include <system_error>

#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

namespace {

size_t mostOpenFiles() {
  constexpr rlim_t kMaxOpen = 64;
  rlimit may{};
  if (getrlimit(RLIMIT_NOFILE, &may) != 0) return kMaxOpen;
  return static_cast<size_t>(std::clamp<rlim_t>(may.rlim_cur / 4, 1, kMaxOpen));
}

}  // namespace

OpenFiles::OpenFiles() : most_(mostOpenFiles()) {}

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

bool leadsOut(const std::filesystem::path& folder, const std::filesystem::path& named) {
  std::error_code no_folder;
  const std::filesystem::path from =
      (named.is_absolute() ? std::filesystem::absolute(folder / "", no_folder) : folder).lexically_normal();
  const std::filesystem::path way = (from / named).lexically_normal().lexically_relative(from);
  return way.empty() || *way.begin() == "..";
}

std::filesystem::path namedFile(std::string_view who, const std::filesystem::path& folder,
                                const std::filesystem::path& named) {
  if (leadsOut(folder, named))
    throw Error("{} names {}, which lies outside its folder; put both into one folder and correct the name",
                who, named.string());
  return folder / named;
}

std::filesystem::path existingFile(std::string_view who, const std::filesystem::path& folder,
                                   const std::filesystem::path& named) {
  std::filesystem::path path = namedFile(who, folder, named);
  if (isRegularFile(path)) return path;
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored))
    throw Error("{} names {}, which is not a regular file", who, path.string());
  for (const char* const ending : {".gz", ".xz", ".zst"})
    if (const std::filesystem::path packed = path.string() + ending; isRegularFile(packed))
      throw Error("{} names {}, which does not exist; decompress {}", who, path.string(),
                  packed.filename().string());
  throw Error("{} names {}, which does not exist", who, path.string());
}

std::string beginningOf(const InputFile& file, size_t most) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), most)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  return begin;
}

FileBytes::FileBytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end)
    : file_(std::move(file)),
      begin_(std::min(begin, file_->size())),
      size_(std::max(std::min(end, file_->size()), begin_) - begin_) {}

void FileBytes::readAt(uint64_t offset, std::span<std::byte> to) const {
  if (offset > size_ || to.size() > size_ - offset)
    throw Error("{}: byte {}: expected {} more bytes, found {}; the file is truncated or damaged",
                file_->name(), begin_ + std::min(offset, size_), to.size(), size_ - std::min(offset, size_));
  file_->readAt(begin_ + offset, to);
}

BytesBehind::BytesBehind(std::shared_ptr<const ByteSource> all, uint64_t begin)
    : all_(std::move(all)), begin_(begin) {
  CURVISPLAT_CHECK_OP(begin_, <=, all_->size());
}

}  // namespace curvisplat
