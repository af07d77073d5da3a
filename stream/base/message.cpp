#include "stream/base/message.h"

#include <cstdio>
#include <exception>
#include <string>

#include "stream/base/error.h"

namespace curvisplat {

void printMessage(std::string_view text) noexcept {
  try {
    const std::string line = "curvisplat: " + oneLine(std::string(text)) + "\n";
    std::fwrite(line.data(), 1, line.size(), stderr);  // in one call, so that threads' lines do not mix
  } catch (const std::exception&) {
    std::fputs("curvisplat: out of memory\n", stderr);
  }
}

}  // namespace curvisplat
