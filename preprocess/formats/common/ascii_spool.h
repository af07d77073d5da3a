// Converts a text of numbers into a temporary file of doubles, once, so that all later reads go by position.
//
// Numbers are separated by white space and commas, as Fortran's list-directed output writes them: exponents
// with E or D, or without a letter (1.5-101); `3*1.5` is 1.5 three times. Needs a few megabytes of memory,
// whatever the size of the text.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "stream/base/file.h"

namespace curvisplat {

struct AsciiSpool {
  std::shared_ptr<const InputFile> doubles;  // in the machine's byte order
  uint64_t count = 0;          // of doubles; doubles->size() predates the writing and must not be used
  int significant_digits = 0;  // the largest number of digits among the first numbers
};

/// A float has at most this number of significant digits in text.
constexpr int kDigitsOfFloat = 9;
/// How many numbers of a text are asked for their digits.
constexpr size_t kDigitSamples = 100'000;
/// Significant digits of the mantissa, which show the precision that the number was written with.
int significantDigits(std::string_view token);

/// Parses a number in the notation of C, C++ or Fortran. False unless `text` is exactly one number.
bool parseNumber(std::string_view text, double& value);

/// The file is a NamelessFile in `folder`. Throws Error with the line that is not a number, or if
/// `folder` has too little space.
AsciiSpool spoolAscii(const InputFile& text, const std::filesystem::path& folder);

}  // namespace curvisplat
