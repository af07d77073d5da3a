// What `info` says of a conversion to come.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "preprocess/convert/preflight.h"

namespace curvisplat {

/// A conversion with all cores.
class InfoEstimate {
 public:
  InfoEstimate() = default;
  explicit InfoEstimate(uint64_t splats, SplatsOf what);

  nlohmann::ordered_json toJson() const;
  /// "a cache of about 2.1 MiB with one scalar, ..."
  std::string toText() const;

 private:
  uint64_t splats_ = 0;
  unsigned threads_ = 1;
  ConversionEstimate needs_;
};

}  // namespace curvisplat
