// Whole cells at borders, of cell-centred data, as two splats.
#pragma once

#include "stream/model/border_code.h"

namespace curvisplat {

/// As kWholeCellStyle, but cells are cut at faces as two splats: the cell, and the one that would be next to it beyond the face, as
/// cells inside of the grid are drawn (render/project/border_parts.cpp). Its `cut` is the cell itself. In one dimension, the density
/// behind the border of an even grid is 0.999 to 1.001; it is 0.932 to 1.030 with one wider splat, and 0.928 to 1.033 where
/// cells grow by 0.865.
inline constexpr BorderStyle kWholeCellPairs{{0, 1, 1}, kWholeCellStyle.parts};

inline bool isOfPairs(const BorderStyle& style) {
  return style.cut.size == kWholeCellPairs.cut.size;
}

}  // namespace curvisplat
