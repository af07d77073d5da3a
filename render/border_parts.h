// A half cell's splat as it is drawn: in parts that follow the border more closely than one symmetric kernel
// can (stream/half_cell.h).
#pragma once

#include <array>
#include <cstdint>

#include "render/splat_cutter.h"

namespace curvisplat {

/// At most two parts along each of three axes.
using BorderPieces = std::array<SplatPiece, 8>;

/// The parts of `whole` in pieces[0 .. n - 1]; returns n: 2, 4 or 8, or 1 for a whole cell.
size_t partsAtBorder(const SplatPiece& whole, uint32_t half_cell, BorderPieces& pieces);

}  // namespace curvisplat
