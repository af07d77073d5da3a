// How the cells at the borders of a cache are drawn: by its centring and its features.
#pragma once

#include "stream/cache/manifest.h"
#include "stream/model/border_pairs.h"

namespace curvisplat {

// Features, as manifest.h has others.
inline constexpr const char* kFaceLayers =
    "face-layers";  // cells are cut at more faces that they are behind (layers_code.h)
inline constexpr const char* kBorderPairs =
    "border-pairs";  // cells at faces are drawn as two splats (border_pairs.h)

inline BorderStyle borderStyleOf(const Manifest& manifest) {
  if (!manifest.cells) return kHalfCellStyle;
  return manifest.hasFeature(kBorderPairs) ? kWholeCellPairs : kWholeCellStyle;
}

}  // namespace curvisplat
