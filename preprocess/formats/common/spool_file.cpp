#include "preprocess/formats/common/spool_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>

#include "stream/base/check.h"

namespace curvisplat {

void SpoolFile::create() {
  static std::atomic<unsigned> spools = 0;
  const std::filesystem::path path = folder_ / fmt::format("curvisplat.{}.{}.spool", ::getpid(), spools++);
  out_ = std::make_unique<OutputFile>(path);
  try {
    in_ = std::make_unique<InputFile>(path);
    removeFile(path);
  } catch (...) {
    removeAll(path);
    throw;
  }
}

uint64_t SpoolFile::append(const std::function<void(const Sink&)>& write) {
  const std::lock_guard lock(mutex_);
  if (!in_) create();
  const uint64_t begin = out_->size();
  write([this](std::span<const std::byte> bytes) { out_->append(bytes); });
  return begin;
}

void SpooledBytes::fill() const {
  const std::lock_guard lock(mutex_);
  if (begin_) return;
  uint64_t written = 0;
  begin_ = spool_->append([&](const SpoolFile::Sink& sink) {
    make_([&](std::span<const std::byte> bytes) {
      written += bytes.size();
      sink(bytes);
    });
  });
  CURVISPLAT_CHECK_OP(written, ==, size_);
  make_ = nullptr;
}

void SpooledBytes::readAt(uint64_t offset, std::span<std::byte> to) const {
  fill();
  CURVISPLAT_CHECK(offset <= size_ && to.size() <= size_ - offset);
  spool_->readAt(*begin_ + offset, to);
}

}  // namespace curvisplat
