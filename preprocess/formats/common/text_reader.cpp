#include "preprocess/formats/common/text_reader.h"

#include <algorithm>
#include <cstring>

#include "preprocess/formats/common/ascii_spool.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;
constexpr size_t kMaxLineBytes = size_t{64} << 10;  // also limits a word

bool isSpace(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

}  // namespace

std::string printable(std::string_view text) {
  std::string shown(text);
  std::replace_if(
      shown.begin(), shown.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return shown;
}

TextReader::TextReader(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end)
    : file_(std::move(file)), end_(std::min(end, file_->size())), buffer_(kBufferBytes) {
  seek(begin);
}

void TextReader::seek(uint64_t offset) {
  buffer_offset_ = std::min(offset, end_);
  at_ = filled_ = 0;
}

/// Moves the unread characters to the front of the buffer and fills up the rest.
void TextReader::refill() {
  std::memmove(buffer_.data(), buffer_.data() + at_, filled_ - at_);
  buffer_offset_ += at_;
  filled_ -= at_;
  at_ = 0;
  const auto count =
      static_cast<size_t>(std::min<uint64_t>(buffer_.size() - filled_, end_ - buffer_offset_ - filled_));
  file_->readAt(buffer_offset_ + filled_, std::as_writable_bytes(std::span(buffer_).subspan(filled_, count)));
  filled_ += count;
}

bool TextReader::skipSpace() {
  for (;;) {
    while (at_ < filled_ && isSpace(buffer_[at_])) ++at_;
    if (at_ < filled_) return true;
    if (offset() >= end_) return false;
    refill();
  }
}

std::string_view TextReader::peekWord() {
  if (!skipSpace()) return {};
  if (filled_ - at_ <= kMaxLineBytes && buffer_offset_ + filled_ < end_) refill();
  size_t stop = at_;
  while (stop < filled_ && stop - at_ <= kMaxLineBytes && !isSpace(buffer_[stop])) ++stop;
  if (stop - at_ > kMaxLineBytes)
    throw Error("{}: byte {}: found {} characters without a space; expected a word or a number",
                file_->name(), offset(), stop - at_);
  return {&buffer_[at_], stop - at_};
}

std::string_view TextReader::word() {
  const std::string_view found = peekWord();
  at_ += found.size();
  return found;
}

std::optional<std::string_view> TextReader::line() {
  if (offset() >= end_) return std::nullopt;
  if (filled_ - at_ <= kMaxLineBytes && buffer_offset_ + filled_ < end_) refill();
  const auto* const begin = buffer_.data() + at_;
  const size_t most = std::min(filled_ - at_, kMaxLineBytes);
  const auto* const found = static_cast<const char*>(std::memchr(begin, '\n', most));
  if (!found && most == kMaxLineBytes)
    throw Error("{}: byte {}: found no end of line within {} characters", file_->name(), offset(), most);
  size_t length = found ? static_cast<size_t>(found - begin) : most;
  at_ += length + (found ? 1 : 0);
  if (length > 0 && begin[length - 1] == '\r') --length;
  return std::string_view(begin, length);
}

double TextReader::number() {
  constexpr size_t kShown = 30;
  const std::string_view text = word();
  double value = 0;
  if (text.empty())
    throw Error("{}: byte {}: ends where a number was expected; the file is truncated", file_->name(),
                offset());
  if (!parseNumber(text, value))
    throw Error("{}: byte {}: found \"{}\"; expected a number", file_->name(), offset() - text.size(),
                printable(text.substr(0, kShown)));
  return value;
}

}  // namespace curvisplat
