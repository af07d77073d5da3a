// What goes wrong outside the program (a file, a disk, an argument) is thrown as an Error, where it is known,
// with the place and what to do; the subcommand catches it once and prints it as one line. A broken invariant
// of ours is not an Error but a failed check: check.h.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace curvisplat {

/// `text` with a space for each control character: texts quote names and words of files, and go to a
/// terminal.
std::string oneLine(std::string text);

/// The work failed: exit status 1. The text is one line: what, where, what was expected and found, what to
/// do.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& text) : std::runtime_error(oneLine(text)) {}
  explicit Error(const char* text) : Error(std::string(text)) {}

  template <typename... Args>
  explicit Error(fmt::format_string<Args...> format, Args&&... args)
      : Error(fmt::format(format, std::forward<Args>(args)...)) {}
};

/// The command line asks for something that does not exist or does not fit together: exit status 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

}  // namespace curvisplat
