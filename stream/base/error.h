// The errors that the program reports: failures outside the program (a file, a disk, an argument). An Error
// is thrown where the failure is detected, with the place and what the user can do about it. The subcommand
// catches it once and prints it as one line. A broken invariant of the program is not an Error but a failed
// check: check.h.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace curvisplat {

/// Replaces each control character of `text` by a space: those of ASCII, and U+0080 to U+009F, of which a terminal
/// takes U+009B for the beginning of an escape sequence. Messages quote names and words from files and are printed on
/// a terminal.
std::string oneLine(const std::string& text);

/// The work failed: exit status 1. The text is one line: where, what is wrong, what was found and expected,
/// and what to do.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& text) : std::runtime_error(oneLine(text)) {}
  explicit Error(const char* text) : Error(std::string(text)) {}

  template <typename... Args>
  explicit Error(fmt::format_string<Args...> format, Args&&... args)
      : Error(fmt::format(format, std::forward<Args>(args)...)) {}
};

/// The command line names something that does not exist, or its options contradict each other: exit status 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// What is written has failed, whatever is read: a disk, a folder, another program that changes the same cache. More input
/// would fail in the same way.
class OutputError : public Error {
 public:
  using Error::Error;
};

}  // namespace curvisplat
