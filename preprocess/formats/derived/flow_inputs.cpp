#include "preprocess/formats/derived/flow_inputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "preprocess/grid/scalar_names.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

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

}  // namespace

FlowInputs findFlowInputs(const GridDescription& description) {
  FlowInputs inputs;
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    const auto find = [&](std::initializer_list<const char*> names) {
      return scalarCalled(description, centring, names);
    };
    inputs.centring = centring;
    inputs.density = find({"density", "rho"});
    inputs.energy = find({"energy", "energystagnationdensity", "stagnationenergy", "rhoe"});
    inputs.pressure = find({"pressure"});
    inputs.momentum = {find({"momentumx", "momentum:x", "xmomentum", "rhou"}),
                       find({"momentumy", "momentum:y", "ymomentum", "rhov"}),
                       find({"momentumz", "momentum:z", "zmomentum", "rhow"})};
    inputs.velocity = {find({"velocityx", "velocity:x"}), find({"velocityy", "velocity:y"}),
                       find({"velocityz", "velocity:z"})};
    if (inputs.hasVelocity() || inputs.hasPressure()) return inputs;
  }
  inputs.centring = Centring::kNode;
  return inputs;
}

PerfectGas gasOf(const DerivedOptions& options, GridDescription& description) {
  PerfectGas gas;
  const auto chosen = [](std::optional<double> by_user, std::optional<double> by_file, double otherwise) {
    return by_user ? *by_user : by_file.value_or(otherwise);
  };
  gas.gamma = chosen(options.gas.gamma, description.gas.gamma, gas.gamma);
  gas.constant = chosen(options.gas.constant, description.gas.constant, gas.constant);
  if (!(gas.gamma > 1) || !std::isfinite(gas.gamma))
    throw UsageError("--gamma: {} is not a ratio of specific heats; expected a number above 1", gas.gamma);
  if (!(gas.constant > 0) || !std::isfinite(gas.constant))
    throw UsageError("--gas-constant: {} is not valid; expected a number above 0", gas.constant);
  if (gas.gamma != PerfectGas{}.gamma || gas.constant != PerfectGas{}.constant)
    description.format += fmt::format("; gas with gamma {}, R {}", gas.gamma, gas.constant);
  return gas;
}

bool offers(const FlowInputs& inputs, const QuantityInfo& quantity) {
  const unsigned needs = quantity.needs;
  if ((needs & kNeedsDensity) && !inputs.density) return false;
  if ((needs & (kNeedsVelocity | kNeedsVelocityGradient)) && !inputs.hasVelocity()) return false;
  return !(needs & (kNeedsPressure | kNeedsPressureGradient)) || inputs.hasPressure();
}

bool addQuantity(const QuantityInfo& quantity, Centring centring, size_t stored,
                 GridDescription& description) {
  const auto end = description.scalars.begin() + static_cast<ptrdiff_t>(stored);
  const auto same = std::find_if(description.scalars.begin(), end, [&](const GridScalar& scalar) {
    return answersTo(scalar, simplifiedName(quantity.name));
  });
  if (same != end) {
    same->function = quantity.function;
    return false;
  }
  GridScalar scalar;
  scalar.name = quantity.name;
  if (*quantity.alias) scalar.aliases = {quantity.alias};
  scalar.function = quantity.function;
  scalar.derived = true;
  scalar.centring = centring;
  description.scalars.push_back(std::move(scalar));
  return true;
}

}  // namespace curvisplat
