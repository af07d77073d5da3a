// Where the values streams of new variables or steps go.
#pragma once

#include <cstdint>
#include <span>

#include "stream/codec/brick_codec.h"

namespace curvisplat {

class ValuesWriter {
 public:
  virtual ~ValuesWriter() = default;
  /// Appends a brick's streams, one per variable. Each brick comes once, in the order of conversion.
  virtual void append(uint32_t brick, std::span<const EncodedValues> values) = 0;
};

}  // namespace curvisplat
