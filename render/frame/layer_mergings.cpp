#include "render/frame/layer_mergings.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec4.hpp>
#include <utility>
#include <vector>

namespace curvisplat {
namespace {

constexpr double kStepsADoubling = 4;
constexpr size_t kMaxSteps = 64;
// The length of a voxel, in lengths that may be lost: merging a stack moves what is in it by less than half of that.
constexpr double kVoxel = 1.5;

uint32_t nextNumber() {
  static std::atomic<uint32_t> last = 0;
  return ++last;
}

/// Colour times extinction and extinction: below the table, in each cell, above it.
std::vector<glm::dvec4> valuesOf(const ClassificationTable& table) {
  std::vector<glm::dvec4> values{glm::dvec4(table.below())};
  const auto cumulative = table.exactCumulative();
  for (size_t n = 1; n < cumulative.size(); ++n) values.push_back(cumulative[n] - cumulative[n - 1]);
  values.emplace_back(table.above());
  return values;
}

/// Begins a bin wherever the function has changed by a step since the last: a voxel's colour times its opacity, or its opacity.
ScalarBins binsOf(const ClassificationTable& table, double length, double most_opacity) {
  constexpr double kStep = 0.05;
  constexpr double kMaxBin = 4095;
  ScalarBins bins{table.logScale(), table.scale(), table.bias(), {}};
  glm::dvec4 before(0.0);
  double change = 0;
  for (const glm::dvec4& value : valuesOf(table)) {
    const double opacity = std::min(-std::expm1(-value.w * length), most_opacity);
    const glm::dvec4 shown = value.w > 0 ? opacity / value.w * value : glm::dvec4(0.0);
    const glm::dvec4 changed = glm::abs(shown - before);
    if (!bins.bins.empty()) change += std::max({changed.x, changed.y, changed.z, changed.w});
    bins.bins.push_back(static_cast<uint16_t>(std::min(change / kStep, kMaxBin)));
    before = shown;
  }
  return bins;
}

double mostOpacity(const ClassificationTable& table, double length) {
  double most = 0;
  for (const glm::dvec4& value : valuesOf(table)) most = std::max(most, value.w);
  return -std::expm1(-most * length);
}

}  // namespace

std::shared_ptr<const LayerMerging> LayerMergings::of(double length, const Functions& functions) {
  if (!(length > 0 && std::isfinite(length))) return nullptr;
  if (functions.scale != scale_ || steps_.size() >= kMaxSteps) steps_.clear();
  scale_ = functions.scale;
  const double step = std::round(kStepsADoubling * std::log2(kVoxel * length));
  std::shared_ptr<const LayerMerging>& known = steps_[static_cast<int>(step)];
  if (known) return known;
  auto merging = std::make_shared<LayerMerging>();
  const double voxel = std::exp2(step / kStepsADoubling);
  merging->number = nextNumber();
  merging->voxel = voxel / functions.scale;
  merging->bins = binsOf(functions.table, voxel, 1);
  if (functions.colours)
    merging->second_bins = binsOf(*functions.colours, HUGE_VAL, mostOpacity(functions.table, voxel));
  known = std::move(merging);
  return known;
}

}  // namespace curvisplat
