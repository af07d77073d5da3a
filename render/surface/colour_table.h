// The colours of a transfer function as a table, without its opacities.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "render/colour/transfer_function.h"

namespace curvisplat {

/// Takes a millisecond to build. Immutable; any thread.
class ColourTable {
 public:
  explicit ColourTable(const TransferFunction& function);

  /// Outside of the function's range, the colour at its nearer end. Not for NaN.
  glm::vec3 at(double scalar) const;

 private:
  static constexpr int kCells = 4096;
  bool log_scale_;
  double low_, scale_;
  std::vector<glm::vec3> colours_;  // [kCells + 1]
};

}  // namespace curvisplat
