// How the splat of a cell at a border is drawn. Along each axis that ends at a face it is one wider splat
// that is cut at the face. Along the other axes it is drawn in two parts, which follow a border more closely
// than one symmetric kernel can (stream/model/border_code.h).
#pragma once

#include <array>
#include <cstdint>

#include "render/project/splat_cutter.h"
#include "stream/model/border_code.h"

namespace curvisplat {

/// At most two parts along each of three axes.
using BorderPieces = std::array<SplatPiece, 8>;

/// Writes the parts of `whole` to pieces[0 .. n - 1] and returns n: 1, 2, 4 or 8.
size_t partsAtBorder(const SplatPiece& whole, uint32_t border_code, const BorderStyle& style,
                     BorderPieces& pieces);
/// By inwardAxes() and layersOf() of its code.
size_t partsAtBorder(const SplatPiece& whole, const InwardAxes& inward, uint32_t layers,
                     const BorderStyle& style, BorderPieces& pieces);

}  // namespace curvisplat
