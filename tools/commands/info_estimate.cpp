#include "tools/commands/info_estimate.h"

#include <fmt/format.h>
#include <tbb/info.h>

#include <nlohmann/json.hpp>

namespace curvisplat {
namespace {

std::string sizeText(uint64_t bytes) {
  const auto mebibytes = static_cast<double>(bytes) / static_cast<double>(1 << 20);
  return mebibytes < 1024 ? fmt::format("{:.1f} MiB", mebibytes)
                          : fmt::format("{:.1f} GiB", mebibytes / 1024);
}

}  // namespace

InfoEstimate::InfoEstimate(uint64_t splats)
    : splats_(splats),
      threads_(static_cast<unsigned>(tbb::info::default_concurrency())),
      needs_(estimateConversion(splats, threads_)) {}

nlohmann::ordered_json InfoEstimate::toJson() const {
  return {{"splats", splats_},
          {"cache_bytes", needs_.cache_bytes},
          {"cache_bytes_per_further_scalar", needs_.bytes_per_further_scalar},
          {"seconds", needs_.seconds},
          {"threads", threads_}};
}

std::string InfoEstimate::toText() const {
  return fmt::format(
      "a cache of about {} with one scalar, {} more per additional scalar; about {:.1f} s on {} thread{}",
      sizeText(needs_.cache_bytes), sizeText(needs_.bytes_per_further_scalar), needs_.seconds, threads_,
      threads_ == 1 ? "" : "s");
}

}  // namespace curvisplat
