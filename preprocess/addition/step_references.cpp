#include "preprocess/addition/step_references.h"

#include <utility>

namespace curvisplat {
namespace {

constexpr uint64_t kMaxStepsBack = 255;

}  // namespace

std::vector<uint64_t> referenceSteps(const Series& series, uint32_t geometry, uint64_t next,
                                     bool leaves_out_first) {
  std::vector<uint64_t> of_geometry;
  for (uint64_t step = leaves_out_first ? 1 : 0; step < next; ++step)
    if (series.steps[step].geometry == geometry) of_geometry.push_back(step);
  const uint64_t in_group = of_geometry.size() % kStepGroup;
  std::vector<uint64_t> references;
  for (uint64_t n = 0; n < in_group; ++n) {
    const uint64_t step = of_geometry[of_geometry.size() - 1 - n];
    if (next - step > kMaxStepsBack) break;
    references.push_back(step);
  }
  return references;
}

StepReferences::StepReferences(const CacheReader& cache, bool leaves_out_first) {
  const Series& series = cache.series();
  const uint64_t next = series.steps.size();
  const std::vector<uint64_t> steps =
      referenceSteps(series, series.steps[cache.step()].geometry, next, leaves_out_first);
  for (size_t n = 0; n < steps.size(); ++n) {
    steps_back_[n] = static_cast<uint8_t>(next - steps[n]);
    readers_.push_back(cache.atStep(steps[n]));
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
