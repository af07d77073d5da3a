// The splat of a cell at a border as it is drawn: in parts that follow the border more closely than one
// symmetric kernel can (stream/border_code.h).
#pragma once

#include <array>
#include <cstdint>

#include "render/project/splat_cutter.h"
#include "stream/model/border_code.h"

namespace curvisplat {

/// At most two parts along each of three axes.
using BorderPieces = std::array<SplatPiece, 8>;

/// The parts of `whole`, as `parts` says of each axis, in pieces[0 .. n - 1]; returns n: 2, 4 or 8, or 1 for
/// a cell that ends at no border.
size_t partsAtBorder(const SplatPiece& whole, uint32_t border_code, const BorderParts& parts,
                     BorderPieces& pieces);

}  // namespace curvisplat
