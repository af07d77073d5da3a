#include "stream/base/error.h"

#include <algorithm>

namespace curvisplat {

std::string oneLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; }, ' ');
  return text;
}

}  // namespace curvisplat
