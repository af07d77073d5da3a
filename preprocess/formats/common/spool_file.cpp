#include "preprocess/formats/common/spool_file.h"

#include "stream/base/error.h"

namespace curvisplat {

uint64_t SpoolFile::append(const std::function<void(const Sink&)>& write) {
  const MutexLock lock(mutex_);
  if (!file_) file_ = std::make_unique<NamelessFile>(folder_);
  OutputFile& out = file_->out();
  const uint64_t begin = out.size();
  write([&out](std::span<const std::byte> bytes) { out.append(bytes); });
  return begin;
}

uint64_t SpooledBytes::fill() const {
  const MutexLock lock(mutex_);
  if (begin_) return *begin_;
  uint64_t written = 0;
  const auto make = make_;  // a copy: Clang's analysis does not look into lambdas
  begin_ = spool_->append([&](const SpoolFile::Sink& sink) {
    make([&](std::span<const std::byte> bytes) {
      written += bytes.size();
      sink(bytes);
    });
  });
  CURVISPLAT_CHECK_OP(written, ==, size_);
  make_ = nullptr;
  return *begin_;
}

void SpooledBytes::readAt(uint64_t offset, std::span<std::byte> to) const {
  const uint64_t begin = fill();
  CURVISPLAT_CHECK(offset <= size_ && to.size() <= size_ - offset);
  spool_->readAt(begin + offset, to);
}

}  // namespace curvisplat
