// Reads a part of a text file word by word, or line by line, through a buffer.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/open_files.h"

namespace curvisplat {

/// Replaces each character that a terminal would not print by a question mark: for quoting the contents of a
/// damaged file.
std::string printable(std::string_view text);

/// For one thread. Each result is valid until the next call.
class TextReader {
 public:
  /// Reads the bytes [begin, end) of `file`, cut off at its end.
  TextReader(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  const PooledFile& file() const { return *file_; }
  /// Position of the next character in the file.
  uint64_t offset() const { return buffer_offset_ + at_; }
  /// Continues at another position.
  void seek(uint64_t offset);

  /// The next characters up to white space; empty at the end. Throws Error if they exceed any sane length.
  std::string_view word();
  /// The rest of the line without the line break; nullopt at the end of the text. Throws Error if it exceeds
  /// any sane length.
  std::optional<std::string_view> line();
  /// As word(), but without advancing.
  std::string_view peekWord();
  /// The next number. Throws Error at the end, or if the next word is not a number.
  double number();

 private:
  bool skipSpace();
  void refill();

  std::shared_ptr<const PooledFile> file_;
  uint64_t end_ = 0;
  uint64_t buffer_offset_ = 0;  // position of the buffer's first character in the file
  size_t at_ = 0, filled_ = 0;
  std::vector<char> buffer_;
};

}  // namespace curvisplat
