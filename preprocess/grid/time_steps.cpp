#include "preprocess/grid/time_steps.h"

#include <fmt/format.h>

#include <algorithm>

#include "stream/base/error.h"

namespace curvisplat {

uint32_t chosenTimeStep(const std::string& file, std::span<const double> times,
                        std::optional<uint32_t> asked) {
  const size_t steps = std::max<size_t>(1, times.size());
  if (asked && *asked >= steps)
    throw Error("{}: has {}; --time-step {} is out of range; {}", file,
                steps == 1 ? "one time step" : fmt::format("{} time steps", steps), *asked,
                steps == 1 ? "leave it out" : fmt::format("expected 0 to {}", steps - 1));
  return asked.value_or(0);
}

std::optional<std::string> timeStepNote(const GridDescription& description, std::optional<uint32_t> asked) {
  const std::vector<double>& times = description.times;
  if (asked || times.size() < 2) return std::nullopt;
  return fmt::format("{} time steps from {:g} to {:g}; using the first: choose with --time-step 0..{}",
                     times.size(), times.front(), times.back(), times.size() - 1);
}

std::optional<double> statedTime(const GridDescription& description) {
  if (!description.times.empty()) return description.times[description.time_step];
  if (!description.flow.empty() && description.flow.front().time != 0) return description.flow.front().time;
  return std::nullopt;
}

}  // namespace curvisplat
