#include "tools/commands/info_estimate.h"

#include <fmt/format.h>
#include <tbb/info.h>

#include <nlohmann/json.hpp>

#include "stream/base/byte_text.h"
#include "stream/base/count_text.h"

namespace curvisplat {

InfoEstimate::InfoEstimate(uint64_t splats, SplatsOf what)
    : splats_(splats),
      threads_(static_cast<unsigned>(tbb::info::default_concurrency())),
      needs_(estimateConversion(splats, threads_, what)) {}

nlohmann::ordered_json InfoEstimate::toJson() const {
  return {{"splats", splats_},
          {"cache_bytes", needs_.cache_bytes},
          {"cache_bytes_per_further_scalar", needs_.bytes_per_further_scalar},
          {"seconds", needs_.seconds},
          {"threads", threads_}};
}

std::string InfoEstimate::toText() const {
  return fmt::format(
      "a cache of about {} with one scalar, {} more per additional scalar; about {:.1f} s on {}",
      byteText(needs_.cache_bytes), byteText(needs_.bytes_per_further_scalar), needs_.seconds,
      countText(threads_, "thread"));
}

}  // namespace curvisplat
