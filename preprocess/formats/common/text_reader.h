// Reads numbers in text. TextReader goes through a part of a file word by word, or line by line, in a buffer
// of 256 KiB. spoolAscii() converts a whole file of numbers into a temporary file of doubles, once, so that
// all later reads go by position.
//
// In both, a number is what C, C++ or Fortran write: with an exponent of E or D, or without a letter
// (1.5-101). Words and lines of a damaged file are limited in length, so that memory does not grow with the
// file. A TextReader is for one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Replaces each character that a terminal would not print by a question mark: for quoting the contents of a
/// damaged file.
std::string printable(std::string_view text);

/// Parses a number in the notation of C, C++ or Fortran. False unless `text` is exactly one number.
bool parseNumber(std::string_view text, double& value);

/// Reads a text file by words and lines. One thread at a time; each result is valid until the next call.
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
  /// Returns what word() would, without advancing.
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

/// The numbers of a text as doubles in a temporary file.
struct AsciiSpool {
  std::shared_ptr<const InputFile> doubles;  // in the machine's byte order
  uint64_t count = 0;          // of doubles; doubles->size() predates the writing and must not be used
  int significant_digits = 0;  // the largest number of digits among the first numbers
};

/// A float has at most this number of significant digits in text.
constexpr int kDigitsOfFloat = 9;
/// The number of numbers in a text whose digits are counted.
constexpr size_t kDigitSamples = 100'000;
/// Significant digits of the mantissa, which show the precision that the number was written with.
int significantDigits(std::string_view token);

/// Converts a text of numbers that white space or commas separate, as Fortran's list-directed output does;
/// `3*1.5` is 1.5 three times. The temporary file is a NamelessFile in `folder`. Needs a few megabytes of
/// memory, whatever the size of the text. Throws Error with the line that is not a number, or if `folder`
/// has too little space.
AsciiSpool spoolAscii(const InputFile& text, const std::filesystem::path& folder);

}  // namespace curvisplat
