// The ways in which the program says that something is wrong.
//
// An Error is a failure outside the program (a file, a disk, an argument). It is thrown where the failure is
// detected, and says where that is and what the user can do. The subcommand catches it once and prints it as
// one line by printMessage(), which also prints notes and warnings. A broken invariant of the program itself
// is not an Error but a failed CURVISPLAT_CHECK, which aborts, in release builds too.
//
// Any thread may throw, print or check. Nearly all sources include this header, so it includes <fmt/core.h>
// alone, which declares fmt::format(); whoever needs fmt::join() or more includes <fmt/format.h>.
#pragma once

#include <fmt/core.h>

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace curvisplat {

/// `text` with a space for each control character, of ASCII or from U+0080 to U+009F (a terminal takes
/// U+009B for the beginning of an escape sequence). Messages quote names from files that anyone may have
/// made, and are printed on a terminal.
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

/// The command line names something that does not exist, or its options contradict each other: exit status
/// 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// Writing failed, whatever the input is: a disk or a folder is at fault, or another program that changes
/// the same cache. Further input would fail in the same way.
class OutputError : public Error {
 public:
  using Error::Error;
};

/// Prints `text` to standard error, as one line that begins with "curvisplat: ". If standard error cannot be
/// written (a full disk, a closed pipe), the message is lost: that is no reason to fail.
void printMessage(std::string_view text) noexcept;
/// Makes printMessage() print nothing, in processes for which another one prints the messages.
void muteMessages(bool mute = true) noexcept;

template <typename First, typename... Rest>
void printMessage(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  printMessage(fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...));
}

/// Prints the failed check with its `values` (may be empty), and aborts. For the macros below.
[[noreturn]] void checkFailed(const char* file, int line, const char* expression, const std::string& values);

}  // namespace curvisplat

/// Aborts if `condition` is false, in release builds too. It is for the program's own bugs, never for bad
/// input.
#define CURVISPLAT_CHECK(condition)                                                  \
  do {                                                                               \
    if (!(condition)) ::curvisplat::checkFailed(__FILE__, __LINE__, #condition, ""); \
  } while (false)

/// CURVISPLAT_CHECK(a op b) that also prints both values.
#define CURVISPLAT_CHECK_OP(a, op, b)                                        \
  do {                                                                       \
    const auto& check_a = (a);                                               \
    const auto& check_b = (b);                                               \
    if (!(check_a op check_b))                                               \
      ::curvisplat::checkFailed(__FILE__, __LINE__, #a " " #op " " #b,       \
                                fmt::format("{} and {}", check_a, check_b)); \
  } while (false)
