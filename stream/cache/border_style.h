// How the cells at the borders of a cache are drawn: by its centring and its features.
#pragma once

#include "stream/cache/manifest.h"
#include "stream/model/border_pairs.h"

namespace curvisplat {

inline BorderStyle borderStyleOf(const Manifest& manifest) {
  if (!manifest.cells) return kHalfCellStyle;
  return manifest.hasFeature(kBorderPairs) ? kWholeCellPairs : kWholeCellStyle;
}

}  // namespace curvisplat
