// The colours of a transfer function as a table, and its opacities as those of a sheet: over one opacity unit.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "render/colour/transfer_function.h"

namespace curvisplat {

/// Takes a millisecond to build. Immutable; any thread.
class ColourTable {
 public:
  explicit ColourTable(const TransferFunction& function);

  /// Outside of the function's range, the colour at its nearer end. Not for NaN.
  glm::vec3 at(double scalar) const { return glm::vec3(valueAt(scalar)); }
  /// The opacity points' own opacity there.
  float opacityAt(double scalar) const { return valueAt(scalar).w; }

 private:
  static constexpr int kCells = 4096;

  glm::vec4 valueAt(double scalar) const;

  bool log_scale_;
  double low_, scale_;
  std::vector<glm::vec4> values_;  // [kCells + 1]
};

}  // namespace curvisplat
