// The texts of a picture, --title and --label, whose fields stand for what it shows: "t = {time:.2f} s". Pure; any
// thread.
#pragma once

#include <cstdint>
#include <string>

namespace curvisplat {

/// The values of the fields {time}, {step}, {frame}, {scalar} and {units}.
struct TextFields {
  double time = 0;
  uint64_t step = 0, frame = 0;  // counted from 0
  std::string scalar, units;
};

/// `text` with its fields filled in. A number may have a format of C's printf without its %, {time:.2f} or {frame:04d}; {{ and
/// }} are braces. Without a unit, {units} takes brackets around it with it, and blanks and "in" before it. `option` begins the
/// message of a UsageError: an unknown field, or a format that is none.
std::string filledText(const std::string& option, const std::string& text, const TextFields& fields);

}  // namespace curvisplat
