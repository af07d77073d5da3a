// The inputs of derived scalars: the scalars of a source that give the flow (FlowInputs), and the
// gas; and FlowWindow, the flow and its gradients at the samples of a few rows of a structured grid.
// FlowWindow needs memory for its rows and their halo alone. Each thread has a FlowWindow of its own; any
// thread may call the functions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/formats/derived/flow_quantities.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"

namespace curvisplat {

/// Indices of the scalars that the flow is computed from, all of one centring.
struct FlowInputs {
  Centring centring = Centring::kNode;
  std::optional<uint32_t> density, energy, pressure;
  std::array<std::optional<uint32_t>, 3> momentum, velocity;

  bool hasVelocity() const;
  bool hasPressure() const;
  /// The inputs that quantities with these needs (QuantityNeeds) use.
  std::vector<uint32_t> neededFor(unsigned needs) const;
};

/// The flow from its inputs: input(scalar) is the value of one, or NaN.
template <typename Input>
FlowState flowFrom(const FlowInputs& inputs, const PerfectGas& gas, const Input& input) {
  FlowState flow;
  flow.density = input(inputs.density);
  const bool stored = inputs.velocity[0] && inputs.velocity[1] && inputs.velocity[2];
  for (size_t axis = 0; axis < 3; ++axis)
    flow.velocity[static_cast<int>(axis)] =
        stored ? input(inputs.velocity[axis]) : input(inputs.momentum[axis]) / flow.density;
  flow.pressure = inputs.pressure ? input(inputs.pressure)
                                  : pressureOf(flow.density, flow.velocity, input(inputs.energy), gas.gamma);
  return flow;
}

/// The user's options for derived scalars.
struct DerivedOptions {
  GasModel gas;                       // overrides the files' values; the defaults are 1.4 and 1
  std::optional<double> blank_value;  // samples with this value are blanked
};

/// The scalars of density, velocity, ... by their names: those at nodes, if there are enough, or those in
/// cells.
FlowInputs findFlowInputs(const GridDescription& description);

/// The gas by the options and the files; appended to description.format if it is not the usual one. Throws
/// UsageError if gamma or the gas constant is out of range.
PerfectGas gasOf(const DerivedOptions& options, GridDescription& description);

/// Whether the inputs have what the quantity needs, but for the freestream.
bool offers(const FlowInputs& inputs, const QuantityInfo& quantity);

/// Adds the quantity to description.scalars, of which the first `stored` are the files'. If these hold a
/// scalar of its name, it is not computed, and PLOT3D's number refers to it: returns false.
bool addQuantity(const QuantityInfo& quantity, Centring centring, size_t stored,
                 GridDescription& description);

/// The flow and its gradients at the samples of a block, which is processed piece by piece, in one thread.
/// The buffers keep their capacity.
class FlowWindow {
 public:
  /// `needs`: union of the needs (QuantityNeeds) of all quantities that will be computed. The references
  /// must outlive the window.
  FlowWindow(const GridSource& source, const FlowInputs& inputs, const PerfectGas& gas,
             std::optional<float> blank_value, unsigned needs);

  /// Reads `box` and its halo: coordinates, the source's scalars `stored`, and the inputs. Throws Error.
  void read(uint32_t block, const NodeBox& box, const std::vector<uint32_t>& stored);

  /// Copies the box that was read to its place in `whole`; stored scalar n goes to out.scalars[to[n]]. Must
  /// be called before computeFlow().
  void copyStored(const NodeBox& whole, std::span<const size_t> to, NodeArrays& out) const;

  /// Computes the flow at each sample of the window, on which gradients depend.
  void computeFlow();

  /// Computes the box's values to its place in `whole`; NaN at blanked samples and where the flow is
  /// undefined.
  void compute(Quantity quantity, double freestream_mach, const NodeBox& whole,
               std::vector<float>& out) const;

 private:
  template <typename Each>
  void forEachRow(const NodeBox& whole, const Each& each) const;
  /// The element of the first node that the box has in a row.
  size_t nodeAt(uint64_t j, uint64_t k) const {
    return (k - window_.k0) * plane_ + (j - window_.j0) * row_ + (box_.i0 - window_.i0);
  }
  glm::dvec3 position(size_t n) const { return {nodes_.x[n], nodes_.y[n], nodes_.z[n]}; }
  double input(const std::optional<uint32_t>& scalar, size_t n) const;
  FlowState flowAt(size_t n) const;
  void measureCells();
  double meanVolume(size_t n, const std::array<uint64_t, 3>& index) const;
  void moveToCentres();
  template <typename Has>
  std::pair<size_t, size_t> neighbours(size_t n, int axis, uint64_t index, const Has& has) const;
  /// [axis] the samples between which a difference along it is taken.
  using EndsOfAxes = std::array<std::pair<size_t, size_t>, 3>;
  /// Returns the steps between the ends, as columns. One is zero where rounding alone sets its ends apart, as
  /// the nodes of a pole: their values say nothing of a gradient then. Steps through thin layers may be as short
  /// as the rounding of a large coordinate, but are no shorter than a millionth of the longest.
  glm::dmat3 stepsBetween(const EndsOfAxes& ends) const;
  glm::dmat3 velocityGradient(size_t n, const std::array<uint64_t, 3>& index) const;
  glm::dvec3 pressureGradient(size_t n, const std::array<uint64_t, 3>& index) const;
  double determinant(size_t n, const std::array<uint64_t, 3>& index) const;

  const GridSource& source_;
  const FlowInputs& inputs_;
  const PerfectGas& gas_;
  const std::optional<float> blank_value_;
  const unsigned needs_;
  const std::vector<uint32_t> needed_;
  const bool moves_;  // positions are moved to the centres of the cells
  const Halo halo_;

  const GridBlock* block_ = nullptr;
  NodeBox box_, window_;
  size_t row_ = 0, plane_ = 0;
  size_t stored_ = 0;  // number of scalars before the inputs in nodes_
  NodeArrays nodes_;
  std::vector<uint8_t> present_;
  std::vector<FlowState> flow_;
  std::vector<double> volumes_;  // [lowest node of a cell]: NaN if there is no cell
};

}  // namespace curvisplat
