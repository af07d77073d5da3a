#include "tools/options/frame_part.h"

#include <charconv>
#include <system_error>

#include "stream/base/error.h"
#include "tools/options/camera_motion.h"

namespace curvisplat {
namespace {

/// 0 where the text is not a whole number.
uint64_t wholeNumber(const char* begin, const char* end) {
  uint64_t number = 0;
  const auto [stop, error] = std::from_chars(begin, end, number);
  return error == std::errc{} && stop == end ? number : 0;
}

}  // namespace

std::vector<uint64_t> FramePart::of(uint64_t frames) const {
  std::vector<uint64_t> numbers;
  for (uint64_t number = index; number < frames; number += count) numbers.push_back(number);
  return numbers;
}

FramePart parsePart(const std::string& text) {
  const size_t slash = text.find('/');
  uint64_t part = 0, parts = 0;
  if (slash != std::string::npos) {
    part = wholeNumber(text.data(), text.data() + slash);
    parts = wholeNumber(text.data() + slash + 1, text.data() + text.size());
  }
  if (part < 1 || part > parts || parts > kMaxFrames)
    throw UsageError("--part {}: expected i/n with i from 1 to n and n up to {}, such as 3/8", text,
                     kMaxFrames);
  return {part - 1, parts};
}

}  // namespace curvisplat
