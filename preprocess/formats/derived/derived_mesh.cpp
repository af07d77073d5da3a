#include "preprocess/formats/derived/derived_mesh.h"

#include <algorithm>
#include <limits>

namespace curvisplat {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr unsigned kOwn = kNeedsDensity | kNeedsVelocity | kNeedsPressure;

}  // namespace

DerivedMeshSource::DerivedMeshSource(std::unique_ptr<MeshSource> source, const DerivedOptions& options)
    : source_(std::move(source)), description_(source_->description()) {
  gas_ = gasOf(options, description_);
  if (options.blank_value) blank_value_ = static_cast<float>(*options.blank_value);
  inputs_ = findFlowInputs(description_);
  const size_t stored = description_.scalars.size();
  for (const QuantityInfo& quantity : flowQuantities())
    if (quantity.needs != 0 && (quantity.needs & ~kOwn) == 0 && offers(inputs_, quantity) &&
        addQuantity(quantity, inputs_.centring, stored, description_))
      quantities_.push_back(quantity);
}

std::vector<uint32_t> DerivedMeshSource::neededFor(std::span<const uint32_t> scalars) const {
  const size_t stored = source_->description().scalars.size();
  std::vector<uint32_t> needed;
  const auto add = [&](uint32_t scalar) {
    if (std::find(needed.begin(), needed.end(), scalar) == needed.end()) needed.push_back(scalar);
  };
  for (const uint32_t scalar : scalars) {
    if (scalar < stored)
      add(scalar);
    else
      for (const uint32_t input : inputs_.neededFor(quantities_.at(scalar - stored).needs)) add(input);
  }
  return needed;
}

void DerivedMeshSource::derive(std::span<const uint32_t> scalars, const std::vector<uint32_t>& read,
                               std::vector<std::vector<float>>& values) const {
  if (values.empty()) return;
  const size_t stored = source_->description().scalars.size();
  const auto placeOf = [&](uint32_t scalar) {
    return static_cast<size_t>(std::find(read.begin(), read.end(), scalar) - read.begin());
  };
  std::vector<std::vector<float>> derived(scalars.size());
  for (size_t s = 0; s < scalars.size(); ++s) {
    if (scalars[s] < stored) {
      derived[s] = values[placeOf(scalars[s])];
      continue;
    }
    const QuantityInfo& quantity = quantities_[scalars[s] - stored];
    derived[s].resize(values[0].size());
    for (size_t n = 0; n < derived[s].size(); ++n) {
      const auto input = [&](const std::optional<uint32_t>& scalar) {
        const size_t place = scalar ? placeOf(*scalar) : read.size();
        if (place == read.size()) return kNone;
        const float value = values[place][n];
        return blank_value_ && value == *blank_value_ ? kNone : double{value};
      };
      derived[s][n] =
          static_cast<float>(flowQuantity(quantity.quantity, flowFrom(inputs_, gas_, input), {}, gas_, 0));
    }
  }
  values = std::move(derived);
}

void DerivedMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                   std::span<const uint32_t> scalars, MeshPoints& out) const {
  const std::vector<uint32_t> needed = neededFor(scalars);
  source_->readPoints(piece, first, count, needed, out);
  derive(scalars, needed, out.scalars);
}

void DerivedMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                                  std::span<const uint32_t> scalars, MeshCells& out) const {
  const std::vector<uint32_t> needed = neededFor(scalars);
  source_->readCells(piece, first, count, needed, out);
  derive(scalars, needed, out.scalars);
}

}  // namespace curvisplat
