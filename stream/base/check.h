// Checks of the program's own invariants, in release builds too. A failed check prints both values and
// aborts. Failures from outside the program (files, disks, arguments) are Errors instead: error.h.
#pragma once

#include <fmt/format.h>

#include <string>

namespace curvisplat {

[[noreturn]] void checkFailed(const char* file, int line, const char* expression, const std::string& values);

}  // namespace curvisplat

/// Aborts if `condition` is false, in release builds too. For the program's own bugs, never for bad input.
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
