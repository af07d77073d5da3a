// One number a pixel, beside an image's colours.
#pragma once

#include <string>
#include <vector>

namespace curvisplat {

struct ImageChannel {
  std::string name;           // unique, and not that of a colour; at most 255 bytes
  std::vector<float> values;  // [pixels]
};

}  // namespace curvisplat
