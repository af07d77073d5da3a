#include "preprocess/formats/vtk/xml_skeleton.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;
constexpr size_t kMaxMarkupBytes = size_t{16} << 20;
constexpr size_t kMaxTagBytes = size_t{64} << 10;
constexpr size_t kMaxDepth = 64;

bool isSpace(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

class Scanner {
 public:
  explicit Scanner(const PooledFile& file) : file_(file), buffer_(kBufferBytes) {}

  XmlSkeleton run() {
    for (std::string tag; skipText(); tag.clear()) {
      readTag(tag);
      if (tag.starts_with("<!--") || tag.starts_with("<?")) continue;
      if (tag.starts_with("<!"))
        throw Error("{}: byte {}: found {}, which is not allowed in a VTK file", file_.name(), at_,
                    tag.substr(0, std::min<size_t>(30, tag.find_first_of(" [>"))));
      if (!nest(tag)) break;
      if (skeleton_.text.size() > kMaxMarkupBytes)
        throw Error("{}: has more than {} bytes of XML tags; expected fewer pieces or arrays in one file",
                    file_.name(), kMaxMarkupBytes);
    }
    if (skeleton_.text.empty()) throw Error("{}: has no XML element", file_.name());
    return std::move(skeleton_);
  }

 private:
  /// Ensures that the byte at `at_` is in the buffer. False at the end of the file.
  bool fill() {
    if (at_ < buffer_begin_ + filled_ && at_ >= buffer_begin_) return true;
    if (at_ >= file_.size()) return false;
    buffer_begin_ = at_;
    filled_ = static_cast<size_t>(std::min<uint64_t>(buffer_.size(), file_.size() - at_));
    file_.readAt(at_, std::as_writable_bytes(std::span(buffer_).first(filled_)));
    return true;
  }
  std::string_view available() const {
    const auto used = static_cast<size_t>(at_ - buffer_begin_);
    return {&buffer_[used], filled_ - used};
  }

  /// A name in a message: in a damaged file, it may be any bytes.
  static std::string shown(std::string_view name) {
    constexpr size_t kLongest = 40;
    return printable(name.substr(0, kLongest)) + (name.size() > kLongest ? "..." : "");
  }
  [[noreturn]] void failTruncated() const {
    throw Error("{}: ends at byte {}, inside {}; the file is truncated", file_.name(), file_.size(),
                open_.empty() ? "its first tag" : "<" + shown(open_.back()) + ">");
  }

  /// Skips to the next tag and appends the range of the skipped text to the skeleton. False at the end of the
  /// file.
  bool skipText() {
    uint64_t begin = 0, end = 0;
    while (fill()) {
      const std::string_view piece = available();
      const std::string_view text = piece.substr(0, piece.find('<'));
      const auto first = std::find_if_not(text.begin(), text.end(), isSpace);
      if (first != text.end()) {
        if (end == 0) begin = at_ + static_cast<uint64_t>(first - text.begin());
        const auto last = std::find_if_not(text.rbegin(), text.rend(), isSpace);
        end = at_ + static_cast<uint64_t>(last.base() - text.begin());
      }
      at_ += text.size();
      if (text.size() < piece.size()) {
        if (end > 0 && !open_.empty()) skeleton_.text += fmt::format("{} {}", begin, end);
        return true;
      }
    }
    if (!open_.empty()) failTruncated();
    return false;
  }

  /// Reads a tag from '<' to the matching '>'.
  void readTag(std::string& tag) {
    char quote = 0;
    while (fill()) {
      const char c = available().front();
      ++at_;
      tag += c;
      if (tag.size() > kMaxTagBytes)
        throw Error("{}: byte {}: found a tag of more than {} characters", file_.name(), at_, kMaxTagBytes);
      const bool comment = tag.starts_with("<!--");
      if (c == '>' && quote == 0 && (!comment || (tag.size() >= 7 && tag.ends_with("-->")))) return;
      if (comment) continue;
      if (quote == 0 && (c == '"' || c == '\''))
        quote = c;
      else if (c == quote)
        quote = 0;
    }
    failTruncated();
  }

  /// Appends a tag to the skeleton. False if the skeleton is complete.
  bool nest(const std::string& tag) {
    const bool closes = tag[1] == '/';
    const size_t name_begin = closes ? 2 : 1;
    const std::string name = tag.substr(name_begin, tag.find_first_of(" \t\r\n/>", name_begin) - name_begin);
    if (closes) {
      if (open_.empty() || open_.back() != name)
        throw Error("{}: byte {}: </{}> without <{}>; the file is damaged", file_.name(), at_, shown(name),
                    shown(name));
      open_.pop_back();
      skeleton_.text += tag;
      return !open_.empty();
    }
    skeleton_.text += tag;
    if (tag[tag.size() - 2] == '/') return !open_.empty();
    open_.push_back(name);
    if (open_.size() > kMaxDepth)
      throw Error("{}: byte {}: elements are nested more than {} deep", file_.name(), at_, kMaxDepth);
    if (name != "AppendedData") return true;
    findAppendedData();
    for (; !open_.empty(); open_.pop_back()) skeleton_.text += "</" + open_.back() + ">";
    return false;
  }

  void findAppendedData() {
    while (fill() && isSpace(available().front())) ++at_;
    if (!fill()) failTruncated();
    if (available().front() != '_')
      throw Error("{}: byte {}: expected the underscore before the appended data", file_.name(), at_);
    skeleton_.appended_begin = at_ + 1;
  }

  const PooledFile& file_;
  XmlSkeleton skeleton_;
  std::vector<std::string> open_;  // names of the open elements
  std::vector<char> buffer_;
  uint64_t buffer_begin_ = 0, at_ = 0;  // in the file
  size_t filled_ = 0;
};

}  // namespace

XmlSkeleton xmlSkeleton(const PooledFile& file) {
  return Scanner(file).run();
}

}  // namespace curvisplat
