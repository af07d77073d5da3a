#include "preprocess/formats/common/byte_source.h"

#include <algorithm>

#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {

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
