// Pictures in floating point.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/image/image_size.h"

namespace curvisplat {

/// Rows from the top, pixels from the left, four floats a pixel: red, green, blue (multiplied by alpha),
/// alpha.
struct Image {
  ImageSize size{0, 0};
  std::vector<float> rgba;

  explicit Image(ImageSize size_ = {0, 0});
  float* pixel(int x, int y) { return &rgba[4 * (static_cast<size_t>(y) * size.width + x)]; }
  const float* pixel(int x, int y) const { return &rgba[4 * (static_cast<size_t>(y) * size.width + x)]; }
};

struct ImageDifference {
  double psnr_db = 0;  // over red, green and blue against a peak of 1; infinite for equal images
  double largest = 0;  // of one channel
  int largest_x = 0, largest_y = 0;
};
/// Both composited over white where they have alpha. Throws Error if the sizes differ or a pixel is not
/// finite.
ImageDifference compareImages(const Image& a, const Image& b);

}  // namespace curvisplat
