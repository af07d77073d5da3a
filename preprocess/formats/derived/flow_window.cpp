#include "preprocess/formats/derived/flow_window.h"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/slabs.h"
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
    // SV_U: Fluent's.
    inputs.velocity = {find({"velocityx", "velocity:x", "svu"}), find({"velocityy", "velocity:y", "svv"}),
                       find({"velocityz", "velocity:z", "svw"})};
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

namespace {

constexpr unsigned kGradients = kNeedsVelocityGradient | kNeedsPressureGradient;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

Halo haloFor(bool cells, unsigned needs) {
  if (cells && (needs & kGradients)) return kCellHalo;
  return needs & (kGradients | kNeedsJacobian | kNeedsVolume) ? kNodeHalo : kNoHalo;
}

bool isFinite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool allThere(const std::array<std::optional<uint32_t>, 3>& components) {
  return components[0] && components[1] && components[2];
}

}  // namespace

bool FlowInputs::hasVelocity() const {
  return allThere(velocity) || (density && allThere(momentum));
}

bool FlowInputs::hasPressure() const {
  return pressure || (density && energy && hasVelocity());
}

std::vector<uint32_t> FlowInputs::neededFor(unsigned needs) const {
  std::vector<uint32_t> inputs;
  const auto add = [&](const std::optional<uint32_t>& input) {
    if (input && std::find(inputs.begin(), inputs.end(), *input) == inputs.end()) inputs.push_back(*input);
  };
  const bool of_pressure = needs & (kNeedsPressure | kNeedsPressureGradient);
  const bool from_energy = of_pressure && !pressure;
  const bool of_velocity = (needs & (kNeedsVelocity | kNeedsVelocityGradient)) || from_energy;
  const bool from_momentum = of_velocity && !allThere(velocity);
  if ((needs & kNeedsDensity) || from_energy || from_momentum) add(density);
  if (of_velocity)
    for (const auto& component : from_momentum ? momentum : velocity) add(component);
  if (of_pressure) add(from_energy ? energy : pressure);
  return inputs;
}

FlowWindow::FlowWindow(const GridSource& source, const FlowInputs& inputs, const PerfectGas& gas,
                       std::optional<float> blank_value, unsigned needs)
    : source_(source),
      inputs_(inputs),
      gas_(gas),
      blank_value_(blank_value),
      needs_(needs),
      needed_(inputs.neededFor(needs)),
      moves_(inputs.centring == Centring::kCell && (needs & kGradients)),
      halo_(haloFor(inputs.centring == Centring::kCell, needs)) {}

void FlowWindow::read(uint32_t block, const NodeBox& box, const std::vector<uint32_t>& stored) {
  block_ = &source_.description().blocks[block];
  box_ = box;
  window_ = {
      box.j0 - std::min(box.j0, halo_.before), std::min(box.j1 + halo_.after, block_->nj),
      box.k0 - std::min(box.k0, halo_.before), std::min(box.k1 + halo_.after, block_->nk),
      box.i0 - std::min(box.i0, halo_.before), std::min(box.endOfRow(block_->ni) + halo_.after, block_->ni)};
  row_ = window_.rowNodes(block_->ni);
  plane_ = row_ * (window_.j1 - window_.j0);
  std::vector<uint32_t> all = stored;
  all.insert(all.end(), needed_.begin(), needed_.end());
  readBox(source_, block, window_, all, nodes_);
  stored_ = stored.size();
}

/// Calls each(element in the window, element in `whole`, j, k).
template <typename Each>
void FlowWindow::forEachRow(const NodeBox& whole, const Each& each) const {
  const WindowStrides to(whole, block_->ni);
  for (uint64_t k = box_.k0; k < box_.k1; ++k)
    for (uint64_t j = box_.j0; j < box_.j1; ++j) each(nodeAt(j, k), to.at(box_.i0, j, k), j, k);
}

void FlowWindow::copyStored(const NodeBox& whole, std::span<const size_t> to, NodeArrays& out) const {
  forEachRow(whole, [&](size_t from, size_t at, uint64_t, uint64_t) {
    const auto copy = [&](const auto& source, auto& target) {
      std::copy_n(source.begin() + static_cast<ptrdiff_t>(from), box_.rowNodes(block_->ni),
                  target.begin() + static_cast<ptrdiff_t>(at));
    };
    copy(nodes_.x, out.x);
    copy(nodes_.y, out.y);
    copy(nodes_.z, out.z);
    copy(nodes_.blank, out.blank);
    for (size_t n = 0; n < stored_; ++n) copy(nodes_.scalars[n], out.scalars[to[n]]);
  });
}

void FlowWindow::computeFlow() {
  present_.resize(nodes_.x.size());
  for (size_t n = 0; n < present_.size(); ++n) present_[n] = !nodes_.blank[n] && isFinite(position(n));
  if (needs_ & kNeedsVolume) measureCells();
  if (moves_) moveToCentres();
  if (needed_.empty()) return;
  flow_.resize(present_.size());
  for (size_t n = 0; n < flow_.size(); ++n) flow_[n] = flowAt(n);
}

void FlowWindow::measureCells() {
  const uint64_t rows = window_.j1 - window_.j0, planes = window_.k1 - window_.k0;
  volumes_.assign(present_.size(), kNone);
  for (size_t n = 0; n < present_.size(); ++n) {
    if (n % row_ + 1 == row_ || n / row_ % rows + 1 == rows || n / plane_ + 1 == planes) continue;
    bool there = true;
    for (size_t corner = 0; corner < 8; ++corner)
      there &= present_[n + (corner & 1) + (corner >> 1 & 1) * row_ + (corner >> 2) * plane_] != 0;
    if (there)
      volumes_[n] = std::abs(
          Hexahedron(cornersAt(nodes_.x.data(), nodes_.y.data(), nodes_.z.data(), n, row_, plane_)).volume());
  }
}

/// The mean volume of the cells around a node, exact for each; NaN where all of them lack a corner.
double FlowWindow::meanVolume(size_t n, const std::array<uint64_t, 3>& index) const {
  double sum = 0;
  int cells = 0;
  for (size_t corner = 0; corner < 8; ++corner) {
    const bool i = corner & 1, j = corner & 2, k = corner & 4;
    if ((i && index[0] == 0) || (j && index[1] == 0) || (k && index[2] == 0)) continue;
    const double volume = volumes_[n - i - (j ? row_ : 0) - (k ? plane_ : 0)];
    if (std::isnan(volume)) continue;
    sum += volume;
    ++cells;
  }
  return cells > 0 ? sum / cells : kNone;
}

/// Works in place, since a centre depends on its own and later elements only.
void FlowWindow::moveToCentres() {
  const uint64_t rows = window_.j1 - window_.j0, planes = window_.k1 - window_.k0;
  for (size_t n = 0; n < present_.size(); ++n) {
    const bool last = n % row_ + 1 == row_ || n / row_ % rows + 1 == rows || n / plane_ + 1 == planes;
    glm::dvec3 sum(0.0);
    bool there = !last;
    for (size_t corner = 0; corner < 8 && there; ++corner) {
      const size_t at = n + (corner & 1) + (corner >> 1 & 1) * row_ + (corner >> 2) * plane_;
      there = present_[at];
      sum += position(at);
    }
    present_[n] = there;
    nodes_.x[n] = sum.x / 8;
    nodes_.y[n] = sum.y / 8;
    nodes_.z[n] = sum.z / 8;
  }
}

double FlowWindow::input(const std::optional<uint32_t>& scalar, size_t n) const {
  if (!scalar) return kNone;
  const auto at = std::find(needed_.begin(), needed_.end(), *scalar);
  if (at == needed_.end()) return kNone;
  const float value = nodes_.scalars[stored_ + static_cast<size_t>(at - needed_.begin())][n];
  return blank_value_ && value == *blank_value_ ? kNone : double{value};
}

FlowState FlowWindow::flowAt(size_t n) const {
  return flowFrom(inputs_, gas_, [&](const std::optional<uint32_t>& scalar) { return input(scalar, n); });
}

/// The neighbours of a sample along an axis for which `has` is true; the sample itself where there is none.
template <typename Has>
std::pair<size_t, size_t> FlowWindow::neighbours(size_t n, int axis, uint64_t index, const Has& has) const {
  const size_t stride = axis == 0 ? 1 : axis == 1 ? row_ : plane_;
  const uint64_t count = axis == 0 ? block_->ni : axis == 1 ? block_->nj : block_->nk;
  const bool before = index > 0 && has(n - stride);
  const bool after = index + 1 < count && has(n + stride);
  return {before ? n - stride : n, after ? n + stride : n};
}

glm::dmat3 FlowWindow::stepsBetween(const EndsOfAxes& ends) const {
  constexpr double kRoundings = 4;
  constexpr double kAxisFloor = 1e-6;  // of the longest step: thin layers are thicker, poles are not
  const double digit = source_.description().coordinate_bytes == 4 ? std::numeric_limits<float>::epsilon()
                                                                   : std::numeric_limits<double>::epsilon();
  glm::dmat3 steps;
  std::array<double, 3> lengths{}, roundings{};
  for (size_t axis = 0; axis < 3; ++axis) {
    const glm::dvec3 from = position(ends[axis].first), to = position(ends[axis].second);
    const glm::dvec3 size = glm::max(glm::abs(from), glm::abs(to));
    steps[static_cast<int>(axis)] = to - from;
    lengths[axis] = glm::length(to - from);
    roundings[axis] = kRoundings * digit * std::max({size.x, size.y, size.z});
  }
  const double longest = std::max({lengths[0], lengths[1], lengths[2]});
  for (size_t axis = 0; axis < 3; ++axis)
    if (lengths[axis] <= std::min(roundings[axis], kAxisFloor * longest))
      steps[static_cast<int>(axis)] = glm::dvec3(0.0);
  return steps;
}

glm::dmat3 FlowWindow::velocityGradient(size_t n, const std::array<uint64_t, 3>& index) const {
  EndsOfAxes ends;
  glm::dmat3 differences;  // columns: along the axes
  for (int axis = 0; axis < 3; ++axis) {
    const auto [before, after] = neighbours(
        n, axis, index[axis], [&](size_t at) { return present_[at] && isFinite(flow_[at].velocity); });
    ends[static_cast<size_t>(axis)] = {before, after};
    differences[axis] = flow_[after].velocity - flow_[before].velocity;
  }
  const LatticeGradient gradient(stepsBetween(ends));
  glm::dmat3 of_components;
  for (int c = 0; c < 3; ++c)
    of_components[c] = gradient({differences[0][c], differences[1][c], differences[2][c]});
  return of_components;
}

glm::dvec3 FlowWindow::pressureGradient(size_t n, const std::array<uint64_t, 3>& index) const {
  EndsOfAxes ends;
  glm::dvec3 differences;
  for (int axis = 0; axis < 3; ++axis) {
    const auto [before, after] = neighbours(
        n, axis, index[axis], [&](size_t at) { return present_[at] && std::isfinite(flow_[at].pressure); });
    ends[static_cast<size_t>(axis)] = {before, after};
    differences[axis] = flow_[after].pressure - flow_[before].pressure;
  }
  return LatticeGradient(stepsBetween(ends))(differences);
}

/// The determinant of the Jacobian of a full-size cell around the node, also at the ends of a block.
double FlowWindow::determinant(size_t n, const std::array<uint64_t, 3>& index) const {
  glm::dmat3 jacobian;
  for (int axis = 0; axis < 3; ++axis) {
    const auto [before, after] =
        neighbours(n, axis, index[axis], [&](size_t at) { return present_[at] != 0; });
    const double steps = (before != n) && (after != n) ? 0.5 : 1.0;
    jacobian[axis] = steps * (position(after) - position(before));
  }
  return glm::determinant(jacobian);
}

void FlowWindow::compute(Quantity quantity, double freestream_mach, const NodeBox& whole,
                         std::vector<float>& out) const {
  const unsigned needs = infoOf(quantity).needs;
  const auto value = [&](size_t n, const std::array<uint64_t, 3>& index) {
    switch (quantity) {
      case Quantity::kI:
        return static_cast<double>(index[0]);
      case Quantity::kJ:
        return static_cast<double>(index[1]);
      case Quantity::kK:
        return static_cast<double>(index[2]);
      default:
        break;
    }
    if (!present_[n]) return kNone;
    if (quantity == Quantity::kJacobian) return determinant(n, index);
    if (quantity == Quantity::kVolume) return meanVolume(n, index);
    FlowGradients gradients;
    const FlowState& flow = flow_[n];
    if (needs & kNeedsVelocityGradient) {
      if (!isFinite(flow.velocity)) return kNone;
      gradients.velocity = velocityGradient(n, index);
    }
    if (needs & kNeedsPressureGradient) {
      if (!std::isfinite(flow.pressure)) return kNone;
      gradients.pressure = pressureGradient(n, index);
    }
    return flowQuantity(quantity, flow, gradients, gas_, freestream_mach);
  };
  forEachRow(whole, [&](size_t from, size_t at, uint64_t j, uint64_t k) {
    for (uint64_t i = 0; i < box_.rowNodes(block_->ni); ++i)
      out[at + i] = static_cast<float>(value(from + i, {box_.i0 + i, j, k}));
  });
}

}  // namespace curvisplat
