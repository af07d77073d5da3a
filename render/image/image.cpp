#include "render/image/image.h"

#include <cmath>
#include <limits>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

// A premultiplied red, green or blue channel, composited over white.
double overWhite(const float* pixel, int channel) {
  return static_cast<double>(pixel[channel]) + (1 - static_cast<double>(pixel[3]));
}

}  // namespace

Image::Image(ImageSize size_) : size(size_), rgba(4 * size_.pixels()) {}

ImageDifference compareImages(const Image& a, const Image& b) {
  if (a.size != b.size)
    throw Error("the images have different sizes: {} x {} and {} x {} pixels", a.size.width, a.size.height,
                b.size.width, b.size.height);
  ImageDifference difference;
  double sum = 0;
  for (int y = 0; y < a.size.height; ++y)
    for (int x = 0; x < a.size.width; ++x)
      for (int channel = 0; channel < 3; ++channel) {
        const double d = std::abs(overWhite(a.pixel(x, y), channel) - overWhite(b.pixel(x, y), channel));
        if (!std::isfinite(d)) throw Error("pixel ({}, {}) of one of the images is not finite", x, y);
        sum += d * d;
        if (d > difference.largest) {
          difference.largest = d;
          difference.largest_x = x;
          difference.largest_y = y;
        }
      }
  const double values = 3.0 * a.size.width * a.size.height;
  difference.psnr_db = sum > 0 ? -10 * std::log10(sum / values) : std::numeric_limits<double>::infinity();
  return difference;
}

}  // namespace curvisplat
