// Reads a part of a text file word by word, or line by line, through a buffer.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/open_files.h"

namespace curvisplat {

/// With a question mark for each character that would not show on a terminal: what a file has where words are
/// expected may be anything.
std::string printable(std::string_view text);

/// For one thread. What it returns is valid until the next call.
class TextReader {
 public:
  /// From byte `begin` of `file` up to `end`, or its end.
  TextReader(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  const PooledFile& file() const { return *file_; }
  /// Where the next character is read.
  uint64_t offset() const { return buffer_offset_ + at_; }
  /// Goes to another place.
  void seek(uint64_t offset);

  /// The next characters between white space; empty at the end. Throws Error if they are more than any word
  /// has.
  std::string_view word();
  /// The rest of the line, without its end; nothing at the end of the text. Throws Error if it is longer than
  /// any line should be.
  std::optional<std::string_view> line();
  /// As word(), but is read again by the next call.
  std::string_view peekWord();
  /// The next number. Throws Error if there is none, or if the next word is none.
  double number();

 private:
  bool skipSpace();
  void refill();

  std::shared_ptr<const PooledFile> file_;
  uint64_t end_ = 0;
  uint64_t buffer_offset_ = 0;  // of the buffer's first character in the file
  size_t at_ = 0, filled_ = 0;
  std::vector<char> buffer_;
};

}  // namespace curvisplat
