// Isosurfaces as a part of the table of a transfer function. A splat is drawn a second time, with its scalar f at
// scale f + offset: there the table has a peak a cell wide for each isovalue, so that its mean over an interval is the
// chance that the interval has the isovalue in it. DESIGN.md, "Isosurfaces".
//
//   | the transfer function's range | constant, as at its end | nothing | isovalues |
//
// Intervals are shorter than the scalar's range, so none reaches from one part into the other.
#pragma once

#include <span>

#include "render/colour/classification.h"
#include "render/colour/transfer_function.h"

namespace curvisplat {

struct IsoTable {
  ClassificationTable table;
  double scale = 1, offset = 0;

  /// `depth`: optical depth of a crossing. `data_low`, `data_high`: the scalar's range. `with_volume`: the
  /// transfer function's own opacities are in the table; its range must not be logarithmic then.
  static IsoTable of(const TransferFunction& function, std::span<const double> values, double depth,
                     double data_low, double data_high, bool with_volume);
};

}  // namespace curvisplat
