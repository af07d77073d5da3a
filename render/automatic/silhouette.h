// The data's silhouette: the area that it covers when it is looked at from a side.
#pragma once

#include <string_view>
#include <vector>

#include "render/automatic/coarse_samples.h"

namespace curvisplat {

struct Silhouette {
  std::string_view view;  // as Camera::named() knows it
  double area = 0;        // world units squared
};

/// From iso, unless a view along an axis shows more than 1.15 times its area. All samples count, whatever
/// their values: the box that the data lies in says nothing about a thin shell.
Silhouette widestSilhouette(const CoarseSamples& samples);

}  // namespace curvisplat
