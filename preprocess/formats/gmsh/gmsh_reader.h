// Reads a file of Gmsh: lines of text, and numbers in text or binary. For one thread.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {

/// Reads the file from its beginning. Text and binary numbers alternate: lines are always text, next() reads
/// what setBinary() chose.
class GmshReader {
 public:
  explicit GmshReader(std::shared_ptr<const PooledFile> file)
      : file_(std::move(file)), text_(file_, 0, file_->size()) {}

  std::string name() const { return file_->name(); }
  uint64_t size() const { return file_->size(); }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: {} before byte {}; it is truncated or damaged: write it again", name(), what, offset());
  }

  void setBinary(bool swap) {
    binary_ = true;
    swap_ = swap;
  }
  bool isBinary() const { return binary_; }
  uint64_t offset() const { return bytes_at_ > 0 ? bytes_at_ : text_.offset(); }

  /// The next line that is not empty; nullopt at the end of the file.
  std::optional<std::string> line() {
    leaveBytes();
    while (const auto line = text_.line())
      if (const std::string_view words = trimmed(*line); !words.empty()) return std::string(words);
    return std::nullopt;
  }
  std::string requiredLine() {
    auto words = line();
    if (!words) fail("ends");
    return std::move(*words);
  }
  /// Reads a number as text, also in a binary file.
  double textNumber() {
    leaveBytes();
    return text_.number();
  }
  /// Skips the rest of a line of text in a binary file: binary numbers follow.
  void endLine() {
    leaveBytes();
    if (binary_) text_.line();
  }

  template <typename Stored>
  Stored next() {
    if (!binary_) {
      const double number = text_.number();
      if constexpr (std::is_integral_v<Stored>) {
        using Limits = std::numeric_limits<Stored>;
        if (!(number >= static_cast<double>(Limits::min()) &&
              number <= std::min(static_cast<double>(Limits::max()), 0x1p53)))
          fail(fmt::format("has {} as a number of something", number));
      }
      return static_cast<Stored>(number);
    }
    if (bytes_at_ == 0) {
      bytes_at_ = text_.offset();
      used_ = buffer_.size();
    }
    if (buffer_.size() - used_ < sizeof(Stored)) refill(sizeof(Stored));
    const auto value = loadStored<Stored>(&buffer_[used_], swap_);
    used_ += sizeof(Stored);
    bytes_at_ += sizeof(Stored);
    return value;
  }
  /// Reads a count. Binary integers have 8 bytes if `wide` (version 4), else 4 (version 2).
  uint64_t nextCount(bool wide) {
    const int64_t count = wide || !binary_ ? next<int64_t>() : next<int32_t>();
    if (count < 0 || static_cast<uint64_t>(count) > size()) fail(fmt::format("counts {} numbers", count));
    return static_cast<uint64_t>(count);
  }
  uint64_t nextTag(bool wide) {
    const int64_t tag = wide || !binary_ ? next<int64_t>() : next<int32_t>();
    if (tag < 0) fail(fmt::format("has the number {}", tag));
    return static_cast<uint64_t>(tag);
  }

  /// Skips everything up to the end of the line `end`, such as "$EndNodes".
  void skipTo(const std::string& end) {
    leaveBytes();
    uint64_t at = text_.offset();
    std::vector<char> some;
    uint64_t at_once = kFirstBytes;  // many sections are short
    while (at < size()) {
      at_once = std::min(2 * at_once, kBufferBytes);
      some.resize(static_cast<size_t>(std::min(at_once, size() - at)));
      file_->readAt(at, std::as_writable_bytes(std::span(some)));
      const size_t found = std::string_view(some.data(), some.size()).find(end);
      if (found != std::string_view::npos) {
        text_.seek(at + found + end.size());
        text_.line();
        return;
      }
      if (some.size() <= end.size()) break;
      at += some.size() - end.size();
    }
    fail("has no " + end);
  }
  /// Whether the file has the same bytes at two places.
  bool isSame(uint64_t a, uint64_t b, uint64_t bytes) const {
    std::vector<std::byte> of_a, of_b;
    for (uint64_t n = 0; n < bytes; n += of_a.size()) {
      of_a.resize(static_cast<size_t>(std::min(kBufferBytes, bytes - n)));
      of_b.resize(of_a.size());
      file_->readAt(a + n, std::span(of_a));
      file_->readAt(b + n, std::span(of_b));
      if (of_a != of_b) return false;
    }
    return true;
  }
  void seek(uint64_t offset) {
    bytes_at_ = 0;
    text_.seek(offset);
  }

 private:
  static constexpr uint64_t kBufferBytes = 1 << 20, kFirstBytes = 1 << 10;

  void leaveBytes() {
    if (bytes_at_ > 0) seek(bytes_at_);
  }
  void refill(size_t bytes) {
    if (bytes_at_ > size() || size() - bytes_at_ < bytes) fail("ends");
    buffer_.resize(static_cast<size_t>(std::min<uint64_t>(kBufferBytes, size() - bytes_at_)));
    file_->readAt(bytes_at_, std::span(buffer_));
    used_ = 0;
  }

  std::shared_ptr<const PooledFile> file_;
  TextReader text_;
  bool binary_ = false, swap_ = false;
  uint64_t bytes_at_ = 0;  // position of the next binary number; 0: text is read
  std::vector<std::byte> buffer_;
  size_t used_ = 0;
};

}  // namespace curvisplat
