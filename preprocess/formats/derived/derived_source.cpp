#include "preprocess/formats/derived/derived_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kNoInput = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kPieceNodes = 48 << 10;
/// Inputs that a sample's own values give, without its neighbours.
constexpr unsigned kOwn = kNeedsDensity | kNeedsVelocity | kNeedsPressure;

/// Cuts `box` into pieces: whole planes if several fit, else strips of equal length along j and k.
/// `cuts_rows`: long rows are cut, too.
std::vector<NodeBox> piecesOf(const GridBlock& block, const NodeBox& box, bool cuts_rows) {
  const uint64_t row_nodes = box.rowNodes(block.ni), end = box.endOfRow(block.ni);
  const uint64_t part = cuts_rows ? std::min(row_nodes, kPieceNodes) : row_nodes;
  const uint64_t rows = std::max<uint64_t>(1, kPieceNodes / part);
  const uint64_t width = box.j1 - box.j0;
  const auto side = static_cast<uint64_t>(std::sqrt(static_cast<double>(rows)));
  const uint64_t planes = std::max<uint64_t>(1, rows / width >= 4 ? rows / width : side);
  const uint64_t strip = std::min(width, std::max<uint64_t>(1, rows / planes));
  std::vector<NodeBox> pieces;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += strip)
      for (uint64_t i = box.i0; i < end; i += part)
        pieces.push_back(
            {j, std::min(j + strip, box.j1), k, std::min(k + planes, box.k1), i, std::min(i + part, end)});
  return pieces;
}

}  // namespace

DerivedSource::DerivedSource(std::unique_ptr<GridSource> source, const DerivedOptions& options)
    : ForwardingGrid(std::move(source)) {
  gas_ = gasOf(options, description_);
  if (options.blank_value) blank_value_ = static_cast<float>(*options.blank_value);
  inputs_ = findFlowInputs(description_);
  describe();
}

bool DerivedSource::offers(const QuantityInfo& quantity) const {
  if (!curvisplat::offers(inputs_, quantity)) return false;
  if (quantity.needs & kNeedsFreestream)
    return std::all_of(freestream_mach_.begin(), freestream_mach_.end(), [](double m) { return m > 0; });
  return true;
}

void DerivedSource::describe() {
  freestream_mach_.assign(description_.blocks.size(), 0.0);
  for (const FlowConditions& flow : description_.flow)
    if (flow.block < freestream_mach_.size() && freestream_mach_[flow.block] == 0)
      freestream_mach_[flow.block] = flow.mach;
  const size_t of_source = description_.scalars.size();
  if (inputs_.density) description_.scalars[*inputs_.density].function = 100;
  for (const QuantityInfo& quantity : flowQuantities()) {
    if (!offers(quantity)) continue;
    const unsigned of_grid = kNeedsJacobian | kNeedsVolume;
    const Centring centring = (quantity.needs & ~of_grid) ? inputs_.centring : Centring::kNode;
    if (addQuantity(quantity, centring, of_source, description_)) quantities_.push_back(quantity);
  }
}

std::vector<uint32_t> DerivedSource::sourceScalars(std::span<const uint32_t> scalars) const {
  const size_t of_source = source().description().scalars.size();
  std::vector<uint32_t> inputs;
  unsigned needs = 0;
  for (const uint32_t scalar : scalars) {
    if (scalar < of_source)
      inputs.push_back(scalar);
    else
      needs |= quantities_.at(scalar - of_source).needs;
  }
  const std::vector<uint32_t> needed = inputs_.neededFor(needs);
  inputs.insert(inputs.end(), needed.begin(), needed.end());
  return inputs;
}

void DerivedSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                         NodeArrays& out) const {
  const size_t of_source = source().description().scalars.size();
  std::vector<uint32_t> stored;
  std::vector<size_t> stored_to;
  unsigned needs = 0;
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, description_.scalars.size());
    if (scalars[n] < of_source) {
      stored.push_back(scalars[n]);
      stored_to.push_back(n);
    } else {
      needs |= quantities_[scalars[n] - of_source].needs;
    }
  }
  if (stored.size() == scalars.size()) {
    ForwardingGrid::read(block, box, scalars, out);
    return;
  }

  const uint64_t ni = description_.blocks[block].ni;
  const auto nodes = static_cast<size_t>(box.rowNodes(ni) * rowsOf(box));
  for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  out.blank.resize(nodes);
  out.scalars.resize(scalars.size());
  for (auto& values : out.scalars) values.resize(nodes);
  FlowWindow window(source(), inputs_, gas_, blank_value_, needs);
  // Each part of a row takes some whole ones of a source that reads nothing else.
  const bool cuts_rows = !box.hasWholeRows(ni) || rowsInMemory(scalars) == 0;
  for (const NodeBox& piece : piecesOf(description_.blocks[block], box, cuts_rows)) {
    window.read(block, piece, stored);
    window.copyStored(box, stored_to, out);
    window.computeFlow();
    for (size_t n = 0; n < scalars.size(); ++n)
      if (scalars[n] >= of_source)
        window.compute(quantities_[scalars[n] - of_source].quantity, freestream_mach_[block], box,
                       out.scalars[n]);
  }
}

DerivedMeshSource::DerivedMeshSource(std::unique_ptr<MeshSource> source, const DerivedOptions& options)
    : ForwardingMesh(std::move(source)) {
  gas_ = gasOf(options, description_);
  if (options.blank_value) blank_value_ = static_cast<float>(*options.blank_value);
  inputs_ = findFlowInputs(description_);
  const size_t stored = description_.scalars.size();
  for (const QuantityInfo& quantity : flowQuantities())
    if (quantity.needs != 0 && (quantity.needs & ~kOwn) == 0 && offers(inputs_, quantity) &&
        addQuantity(quantity, inputs_.centring, stored, description_))
      quantities_.push_back(quantity);
  constant_ = description_.scalars.empty();
  if (!constant_) return;
  GridScalar scalar;
  scalar.name = "constant";
  scalar.centring = Centring::kCell;
  description_.scalars.push_back(std::move(scalar));
  description_.warnings.push_back(fmt::format(
      "the files contain no scalar; a constant, 1 in all cells, takes its place{}",
      description_.format.starts_with("SU2") ? "; SU2's scalars are in its restart file: give it as well"
                                             : ""));
}

std::vector<uint32_t> DerivedMeshSource::sourceScalars(std::span<const uint32_t> scalars) const {
  if (constant_) return {};
  const size_t stored = source().description().scalars.size();
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
  const size_t stored = source().description().scalars.size();
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
        if (place == read.size()) return kNoInput;
        const float value = values[place][n];
        return blank_value_ && value == *blank_value_ ? kNoInput : double{value};
      };
      derived[s][n] =
          static_cast<float>(flowQuantity(quantity.quantity, flowFrom(inputs_, gas_, input), {}, gas_, 0));
    }
  }
  values = std::move(derived);
}

void DerivedMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                   std::span<const uint32_t> scalars, MeshPoints& out) const {
  const std::vector<uint32_t> needed = sourceScalars(scalars);
  source().readPoints(piece, first, count, needed, out);
  derive(scalars, needed, out.scalars);
}

void DerivedMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                                  std::span<const uint32_t> scalars, MeshCells& out) const {
  const std::vector<uint32_t> needed = sourceScalars(scalars);
  source().readCells(piece, first, count, needed, out);
  if (constant_)
    out.scalars.assign(scalars.size(), std::vector<float>(out.size(), 1));
  else
    derive(scalars, needed, out.scalars);
}

}  // namespace curvisplat
