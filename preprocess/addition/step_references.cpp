#include "preprocess/addition/step_references.h"

#include <utility>

namespace curvisplat {
namespace {

constexpr uint64_t kGroup = 3;
constexpr uint64_t kMaxStepsBack = 255;

}  // namespace

StepReferences::StepReferences(const CacheReader& cache) {
  const Series& series = cache.series();
  const uint32_t geometry = series.steps[cache.step()].geometry;
  std::vector<uint64_t> of_geometry;
  for (uint64_t step = 0; step < series.steps.size(); ++step)
    if (series.steps[step].geometry == geometry) of_geometry.push_back(step);
  const uint64_t in_group = of_geometry.size() % kGroup;
  for (uint64_t n = 0; n < in_group; ++n) {
    const uint64_t step = of_geometry[of_geometry.size() - 1 - n], back = series.steps.size() - step;
    if (back > kMaxStepsBack) break;
    steps_back_[n] = static_cast<uint8_t>(back);
    readers_.push_back(cache.atStep(step));
  }
}

TimeReferences StepReferences::of(uint32_t brick, size_t variable, Scratch& scratch) const {
  TimeReferences references;
  references.steps_back = steps_back_;
  // The nearer one may be predicted from the one further back, which comes first.
  KeptValues kept(readers_.size() > 1 ? KeptValues::charge(kMaxBrickSplats) : 0);
  for (size_t n = readers_.size(); n-- > 0;) {
    readers_[n].readVariable(brick, variable, scratch.values[n], nullptr, &kept);
    references.values[n] = arraysOf(std::as_const(scratch.values[n]));
  }
  return references;
}

}  // namespace curvisplat
