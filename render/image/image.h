// An image in 32-bit floats, and how far two images are apart.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/image/image_size.h"

namespace curvisplat {

/// Rows from the top, pixels from the left; four floats a pixel: red, green and blue, premultiplied by alpha,
/// and alpha.
struct Image {
  ImageSize size{0, 0};
  std::vector<float> rgba;

  explicit Image(ImageSize size_ = {0, 0});
  float* pixel(int x, int y) { return &rgba[4 * (static_cast<size_t>(y) * size.width + x)]; }
  const float* pixel(int x, int y) const { return &rgba[4 * (static_cast<size_t>(y) * size.width + x)]; }
};

struct ImageDifference {
  double psnr_db = 0;  // over red, green and blue, relative to a peak of 1; infinite if the images are equal
  double largest = 0;  // absolute difference of one channel
  int largest_x = 0, largest_y = 0;
};
/// Compares two images, each composited over white. Throws Error if the sizes differ or a pixel is not
/// finite.
ImageDifference compareImages(const Image& a, const Image& b);

}  // namespace curvisplat
