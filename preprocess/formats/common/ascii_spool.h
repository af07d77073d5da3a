// Turns a text of numbers into a temporary file of doubles, once, so that everything else reads by position.
//
// Numbers are separated by white space and commas, as Fortran's list-directed output writes them: exponents
// with E or D, or without a letter (1.5-101); `3*1.5` is 1.5 three times. Streams through a few megabytes of
// memory, whatever the size of the text.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "stream/base/file.h"

namespace curvisplat {

struct AsciiSpool {
  std::shared_ptr<const InputFile> doubles;  // in the machine's byte order
  uint64_t count = 0;          // of doubles. InputFile::size() was taken before they were written
  int significant_digits = 0;  // most that a number among the first ones was written with
};

/// A number as C, C++ or Fortran writes it. False if `text` is none, or not only one.
bool parseNumber(std::string_view text, double& value);

/// The temporary file has no name any more when this returns: it goes when its last user does, however the
/// program ends. Throws Error naming the line that is no number, or if `folder` is too small.
AsciiSpool spoolAscii(const InputFile& text, const std::filesystem::path& folder);

}  // namespace curvisplat
