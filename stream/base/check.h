// Checks of our own invariants, on in release too: a failed one prints both values and aborts. What goes wrong
// outside the program is an Error: error.h.
#pragma once

#include <fmt/format.h>

#include <string>

namespace curvisplat {

[[noreturn]] void checkFailed(const char* file, int line, const char* expression, const std::string& values);

}  // namespace curvisplat

/// Aborts, in release too, when `condition` is false: for our own bugs, never for bad input.
#define CURVISPLAT_CHECK(condition)                                                  \
  do {                                                                               \
    if (!(condition)) ::curvisplat::checkFailed(__FILE__, __LINE__, #condition, ""); \
  } while (false)

/// As CURVISPLAT_CHECK(a op b), and prints both values.
#define CURVISPLAT_CHECK_OP(a, op, b)                                        \
  do {                                                                       \
    const auto& check_a = (a);                                               \
    const auto& check_b = (b);                                               \
    if (!(check_a op check_b))                                               \
      ::curvisplat::checkFailed(__FILE__, __LINE__, #a " " #op " " #b,       \
                                fmt::format("{} and {}", check_a, check_b)); \
  } while (false)
