// What derived scalars are computed from, for structured and unstructured grids.
#pragma once

#include <optional>

#include "preprocess/formats/derived/flow_quantities.h"
#include "preprocess/formats/derived/flow_window.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

struct DerivedOptions {
  GasModel gas;                       // overrides the files' values; the defaults are 1.4 and 1
  std::optional<double> blank_value;  // samples with this value are blanked
};

/// The scalars of density, velocity, ... by their names: those at nodes, if there are enough, or those in cells.
FlowInputs findFlowInputs(const GridDescription& description);

/// The gas by the options and the files; appended to description.format if it is not the usual one. Throws UsageError if
/// gamma or the gas constant is out of range.
PerfectGas gasOf(const DerivedOptions& options, GridDescription& description);

/// Whether the inputs have what the quantity needs, but for the freestream.
bool offers(const FlowInputs& inputs, const QuantityInfo& quantity);

/// Adds the quantity to description.scalars, of which the first `stored` are the files'. If these hold a scalar of its
/// name, it is not computed, and PLOT3D's number refers to it: returns false.
bool addQuantity(const QuantityInfo& quantity, Centring centring, size_t stored,
                 GridDescription& description);

}  // namespace curvisplat
