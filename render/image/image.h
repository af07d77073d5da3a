// Pictures in memory: their size, their pixels as 32-bit floats, a further channel beside the colours, and
// what is measured of pictures: how far two are apart, and how much there is to see in one.
//
// Rows count from the top and pixels from the left. Colours are premultiplied by alpha. A picture takes 16
// bytes a pixel, and measuring it is one pass over the pixels, or two. Any thread may call the functions; a
// picture that is written belongs to one thread.
#pragma once

#include <glm/vec4.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace curvisplat {

/// The size of a picture in pixels.
struct ImageSize {
  int width = 600;
  int height = 600;

  bool operator==(const ImageSize&) const = default;
  uint64_t pixels() const { return static_cast<uint64_t>(width) * static_cast<uint64_t>(height); }
};

/// Four floats a pixel: red, green and blue, premultiplied by alpha, and alpha.
struct Image {
  ImageSize size{0, 0};
  std::vector<float> rgba;

  explicit Image(ImageSize size_ = {0, 0});
  float* pixel(int x, int y) { return &rgba[4 * (static_cast<size_t>(y) * size.width + x)]; }
  const float* pixel(int x, int y) const { return &rgba[4 * (static_cast<size_t>(y) * size.width + x)]; }
};

/// How far two images are apart.
struct ImageDifference {
  double psnr_db = 0;  // over red, green and blue, relative to a peak of 1; infinite if the images are equal
  double largest = 0;  // absolute difference of one channel
  int largest_x = 0, largest_y = 0;
};
/// Compares two images, each composited over white. Throws Error if the sizes differ or a pixel is not
/// finite.
ImageDifference compareImages(const Image& a, const Image& b);

/// One number a pixel, beside an image's colours.
struct ImageChannel {
  std::string name;           // unique, and not that of a colour; at most 255 bytes
  std::vector<float> values;  // [pixels]
};

/// How much there is to see in a picture, as shares of its pixels. Two colours are distinct if a channel
/// differs by 0.1 or more.
struct PictureContrast {
  double seen = 0;   // distinct from the background
  double other = 0;  // of these, distinct from the most frequent colour among them too
};

/// Measures a picture. `background`: premultiplied red, green, blue and alpha. Deterministic.
PictureContrast contrastOf(const Image& image, const glm::vec4& background);

}  // namespace curvisplat
