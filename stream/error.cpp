#include "stream/error.h"

#include <cstdio>
#include <cstdlib>

namespace curvisplat {

void checkFailed(const char* file, int line, const char* expression, const std::string& values) {
  fmt::print(stderr, "curvisplat: internal error at {}:{}: {} does not hold{}{}\n", file, line, expression,
             values.empty() ? "" : ": ", values);
  std::abort();
}

}  // namespace curvisplat
