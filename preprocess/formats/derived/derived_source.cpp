#include "preprocess/formats/derived/derived_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/grid/scalar_names.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPieceNodes = 48 << 10;

/// The first scalar of the given centring with one of these names (simplified).
std::optional<uint32_t> scalarCalled(const GridDescription& description, Centring centring,
                                     std::initializer_list<const char*> names) {
  for (const char* name : names)
    for (uint32_t n = 0; n < description.scalars.size(); ++n) {
      const GridScalar& scalar = description.scalars[n];
      if (scalar.centring == centring && simplifiedName(scalar.name) == name) return n;
    }
  return std::nullopt;
}

/// Cuts `box` into pieces: whole planes if several fit, else strips of equal length along j and k.
std::vector<NodeBox> piecesOf(const GridBlock& block, const NodeBox& box) {
  const uint64_t rows = std::max<uint64_t>(1, kPieceNodes / block.ni);
  const uint64_t width = box.j1 - box.j0;
  const auto side = static_cast<uint64_t>(std::sqrt(static_cast<double>(rows)));
  const uint64_t planes = std::max<uint64_t>(1, rows / width >= 4 ? rows / width : side);
  const uint64_t strip = std::min(width, std::max<uint64_t>(1, rows / planes));
  std::vector<NodeBox> pieces;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += strip)
      pieces.push_back({j, std::min(j + strip, box.j1), k, std::min(k + planes, box.k1)});
  return pieces;
}

}  // namespace

// ---- choosing the quantities ----

DerivedSource::DerivedSource(std::unique_ptr<GridSource> source, const DerivedOptions& options)
    : source_(std::move(source)), description_(source_->description()) {
  const auto chosen = [](std::optional<double> by_user, std::optional<double> by_file, double otherwise) {
    return by_user ? *by_user : by_file.value_or(otherwise);
  };
  gas_.gamma = chosen(options.gas.gamma, description_.gas.gamma, gas_.gamma);
  gas_.constant = chosen(options.gas.constant, description_.gas.constant, gas_.constant);
  if (!(gas_.gamma > 1) || !std::isfinite(gas_.gamma))
    throw UsageError("--gamma: {} is not a ratio of specific heats; expected a number above 1", gas_.gamma);
  if (!(gas_.constant > 0) || !std::isfinite(gas_.constant))
    throw UsageError("--gas-constant: {} is not valid; expected a number above 0", gas_.constant);
  if (gas_.gamma != PerfectGas{}.gamma || gas_.constant != PerfectGas{}.constant)
    description_.format += fmt::format("; gas with gamma {}, R {}", gas_.gamma, gas_.constant);
  if (options.blank_value) blank_value_ = static_cast<float>(*options.blank_value);
  findInputs();
  describe();
}

void DerivedSource::findInputs() {
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    const auto find = [&](std::initializer_list<const char*> names) {
      return scalarCalled(description_, centring, names);
    };
    inputs_.centring = centring;
    inputs_.density = find({"density", "rho"});
    inputs_.energy = find({"energy", "energystagnationdensity", "stagnationenergy", "rhoe"});
    inputs_.pressure = find({"pressure"});
    inputs_.momentum = {find({"momentumx", "momentum:x", "xmomentum", "rhou"}),
                        find({"momentumy", "momentum:y", "ymomentum", "rhov"}),
                        find({"momentumz", "momentum:z", "zmomentum", "rhow"})};
    inputs_.velocity = {find({"velocityx", "velocity:x"}), find({"velocityy", "velocity:y"}),
                        find({"velocityz", "velocity:z"})};
    if (inputs_.hasVelocity() || inputs_.hasPressure()) return;
  }
  inputs_.centring = Centring::kNode;
}

bool DerivedSource::offers(const QuantityInfo& quantity) const {
  const unsigned needs = quantity.needs;
  if ((needs & kNeedsDensity) && !inputs_.density) return false;
  if ((needs & (kNeedsVelocity | kNeedsVelocityGradient)) && !inputs_.hasVelocity()) return false;
  if ((needs & (kNeedsPressure | kNeedsPressureGradient)) && !inputs_.hasPressure()) return false;
  if (needs & kNeedsFreestream)
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
    // If the files hold a scalar of that name, it is not computed, and PLOT3D's number refers to it.
    const auto stored = std::find_if(
        description_.scalars.begin(), description_.scalars.begin() + static_cast<ptrdiff_t>(of_source),
        [&](const GridScalar& scalar) { return answersTo(scalar, simplifiedName(quantity.name)); });
    if (stored != description_.scalars.begin() + static_cast<ptrdiff_t>(of_source)) {
      stored->function = quantity.function;
      continue;
    }
    GridScalar scalar;
    scalar.name = quantity.name;
    if (*quantity.alias) scalar.aliases = {quantity.alias};
    scalar.function = quantity.function;
    scalar.derived = true;
    scalar.centring =
        (quantity.needs & ~unsigned{kNeedsJacobian | kNeedsVolume}) ? inputs_.centring : Centring::kNode;
    description_.scalars.push_back(std::move(scalar));
    quantities_.push_back(quantity);
  }
}

// ---- computing them ----

bool DerivedSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  return source_->readFringe(block, box, out);
}

void DerivedSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                         NodeArrays& out) const {
  const size_t of_source = source_->description().scalars.size();
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
    source_->read(block, box, scalars, out);
    return;
  }

  const auto nodes = static_cast<size_t>(description_.blocks[block].ni * rowsOf(box));
  for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  out.blank.resize(nodes);
  out.scalars.resize(scalars.size());
  for (auto& values : out.scalars) values.resize(nodes);
  FlowWindow window(*source_, inputs_, gas_, blank_value_, needs);
  for (const NodeBox& piece : piecesOf(description_.blocks[block], box)) {
    window.read(block, piece, stored);
    window.copyStored(box, stored_to, out);
    window.computeFlow();
    for (size_t n = 0; n < scalars.size(); ++n)
      if (scalars[n] >= of_source)
        window.compute(quantities_[scalars[n] - of_source].quantity, freestream_mach_[block], box,
                       out.scalars[n]);
  }
}

}  // namespace curvisplat
