// Expectations about a text, or an Error: expectSays() and expectError() expect parts of it, and report a
// failure at the caller's line; errorOf() is an Error's text.
#pragma once

#include <gtest/gtest.h>

#include <concepts>
#include <string>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {

/// Expects that `part` is in `text`.
inline void expectSays(const std::string& text, const std::string& part, const char* file = __builtin_FILE(),
                       int line = __builtin_LINE()) {
  if (text.find(part) == std::string::npos)
    ADD_FAILURE_AT(file, line) << "'" << part << "' is not in: " << text;
}

/// The text of the Error that `work` throws; empty, which no Error's text is, if it throws none.
template <std::invocable Work>
std::string errorOf(Work&& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// Expects that `work` throws an Error of one line that has each of `says` in it.
template <std::invocable Work>
void expectError(Work&& work, const std::vector<std::string>& says, const char* file = __builtin_FILE(),
                 int line = __builtin_LINE()) {
  const std::string error = errorOf(work);
  if (error.empty()) ADD_FAILURE_AT(file, line) << "no Error was thrown";
  if (error.find('\n') != std::string::npos) ADD_FAILURE_AT(file, line) << "more than one line: " << error;
  for (const std::string& part : says) expectSays(error, part, file, line);
}

}  // namespace curvisplat
