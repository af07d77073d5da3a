#include "preprocess/formats/common/text_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>

#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/temporary_files.h"

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

namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;
// Repeat counts beyond this are checked against the free space first: a wrong one would fill the disk.
constexpr uint64_t kMaxUncheckedRepeats = 1'000'000;

bool isSeparator(char c) {
  return isSpace(c) || c == ',';
}

/// Parses notations that Fortran writes and std::from_chars rejects: "+1.5", "1.5D+00", "1.5-101", and
/// numbers that overflow or underflow. So are what Microsoft's library ("-1.#IND") and IBM's ("NaNQ") write.
bool parseFortranNumber(std::string_view token, double& value) {
  std::string spelling(token);
  if (const size_t sign = spelling.find("1.#"); sign <= 1) {
    value = spelling.substr(sign).starts_with("1.#INF") ? HUGE_VAL : std::nan("");
    if (spelling[0] == '-') value = -value;
    return true;
  }
  if (spelling == "NaNQ" || spelling == "NaNS") spelling.pop_back();
  std::replace_if(
      spelling.begin(), spelling.end(), [](char c) { return c == 'D' || c == 'd'; }, 'e');
  const size_t sign = spelling.find_last_of("+-");
  if (sign != std::string::npos && sign > 0 &&
      ((spelling[sign - 1] >= '0' && spelling[sign - 1] <= '9') || spelling[sign - 1] == '.'))
    spelling.insert(sign, 1, 'e');
  char* end = nullptr;
  value = std::strtod(spelling.c_str(), &end);
  const bool hexadecimal = spelling.find_first_of("xXpP") != std::string::npos;
  return end == spelling.c_str() + spelling.size() && !hexadecimal;
}

class Spooler {
 public:
  Spooler(const InputFile& text, const std::filesystem::path& folder)
      : text_(text), folder_(folder), file_(std::make_shared<NamelessFile>(folder)) {
    pending_.reserve(kChunkBytes / sizeof(double));
  }

  AsciiSpool run() {
    std::vector<char> chunk(kChunkBytes);
    size_t kept = 0;  // bytes of a number that the end of the previous chunk cut
    for (uint64_t offset = 0; offset < text_.size();) {
      const size_t count =
          static_cast<size_t>(std::min<uint64_t>(chunk.size() - kept, text_.size() - offset));
      text_.readAt(offset, std::span(chunk.data() + kept, count));
      offset += count;
      const char* const end = chunk.data() + kept + count;
      const char* stop = end;
      if (offset < text_.size()) {
        while (stop != chunk.data() && !isSeparator(stop[-1])) --stop;
        if (stop == chunk.data())
          throw Error("{}: line {} has {} bytes without a space; expected numbers in text", name(),
                      lines_ + 1, end - stop);
      }
      parse(chunk.data(), stop);
      lines_ += static_cast<uint64_t>(std::count<const char*>(chunk.data(), stop, '\n'));
      kept = static_cast<size_t>(end - stop);
      std::copy(stop, end, chunk.data());
    }
    flush();
    file_->out().close();
    return {std::shared_ptr<const InputFile>(file_, &file_->in()), written_, significant_digits_};
  }

 private:
  std::string name() const { return text_.path().string(); }

  void parse(const char* const begin, const char* const end) {
    for (const char* at = begin;;) {
      for (; at != end && isSeparator(*at); ++at) {
        if (*at != ',') continue;
        if (comma_) throw Error("{}: line {} has no value between two commas", name(), lineOf(begin, at));
        comma_ = true;
      }
      if (at == end) return;
      comma_ = false;
      const char* stop = at;
      const char* star = nullptr;
      for (; stop != end && !isSeparator(*stop); ++stop)
        if (*stop == '*' && !star) star = stop;
      const char* const number = star ? star + 1 : at;
      uint64_t repeats = 1;
      double value = 0;
      if (star) {
        const auto [count_end, error] = std::from_chars(at, star, repeats);
        if (error != std::errc{} || count_end != star || repeats == 0) fail(begin, at, stop);
      }
      if (!parseNumber({number, static_cast<size_t>(stop - number)}, value)) fail(begin, at, stop);
      if (sampled_ < kDigitSamples) {
        ++sampled_;
        significant_digits_ =
            std::max(significant_digits_, significantDigits({number, static_cast<size_t>(stop - number)}));
      }
      if (repeats > kMaxUncheckedRepeats) checkSpaceFor(repeats, lineOf(begin, at));
      for (; repeats > 0; --repeats) put(value);
      at = stop;
    }
  }

  uint64_t lineOf(const char* begin, const char* at) const {
    return lines_ + 1 + static_cast<uint64_t>(std::count(begin, at, '\n'));
  }

  [[noreturn]] void fail(const char* begin, const char* at, const char* stop) const {
    constexpr ptrdiff_t kShown = 30;
    throw Error("{}: line {} has \"{}\"; expected a number: is it a PLOT3D file?", name(), lineOf(begin, at),
                std::string_view(at, static_cast<size_t>(std::min(kShown, stop - at))));
  }

  void checkSpaceFor(uint64_t values, uint64_t line) const {
    const std::optional<uint64_t> available = freeBytes(folder_);
    if (available && values > *available / sizeof(double))
      throw Error("{}: line {} repeats a number {} times, too many for the {} bytes free in {}", name(), line,
                  values, *available, folder_.string());
  }

  void put(double value) {
    pending_.push_back(value);
    if (pending_.size() == pending_.capacity()) flush();
  }

  void flush() {
    file_->out().append(std::span<const double>(pending_));
    written_ += pending_.size();
    pending_.clear();
  }

  const InputFile& text_;
  const std::filesystem::path folder_;
  const std::shared_ptr<NamelessFile> file_;
  std::vector<double> pending_;
  uint64_t written_ = 0;
  uint64_t lines_ = 0;  // that ended before the current chunk
  bool comma_ = false;  // whether a comma has followed the last number
  size_t sampled_ = 0;
  int significant_digits_ = 0;
};

}  // namespace

int significantDigits(std::string_view token) {
  int digits = 0;
  for (const char c : token) {
    if (c >= '0' && c <= '9')
      digits += digits > 0 || c != '0';
    else if (c != '.' && c != '-' && c != '+')
      break;
  }
  return digits;
}

bool parseNumber(std::string_view text, double& value) {
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc{} && stop == text.data() + text.size()) return true;
  return !text.empty() && parseFortranNumber(text, value);
}

AsciiSpool spoolAscii(const InputFile& text, const std::filesystem::path& folder) {
  return Spooler(text, folder).run();
}

}  // namespace curvisplat
