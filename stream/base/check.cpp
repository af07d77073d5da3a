#include "stream/base/check.h"

#include <cstdlib>

#include "stream/base/message.h"

namespace curvisplat {

void checkFailed(const char* file, int line, const char* expression, const std::string& values) {
  printMessage("internal error at {}:{}: check failed: {}{}{}", file, line, expression,
               values.empty() ? "" : ": ", values);
  std::abort();
}

}  // namespace curvisplat
