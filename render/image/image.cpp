#include "render/image/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

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

namespace {

constexpr float kDistinct = 0.1f;
constexpr int kSteps = 10;  // of a channel, where the most frequent colour is looked for

bool distinct(const float* a, const float* b) {
  for (int channel = 0; channel < 4; ++channel)
    if (!(std::abs(a[channel] - b[channel]) < kDistinct)) return true;
  return false;
}

size_t binOf(const float* rgba) {
  size_t bin = 0;
  for (int channel = 0; channel < 3; ++channel)
    bin = bin * kSteps +
          static_cast<size_t>(std::clamp(static_cast<int>(rgba[channel] * kSteps), 0, kSteps - 1));
  return bin;
}

}  // namespace

PictureContrast contrastOf(const Image& image, const glm::vec4& background) {
  const size_t pixels = image.rgba.size() / 4;
  if (pixels == 0) return {};
  struct Bin {
    size_t count = 0;
    std::array<double, 4> sum{};
  };
  std::vector<Bin> bins(size_t{kSteps} * kSteps * kSteps);
  size_t seen = 0;
  for (size_t n = 0; n < pixels; ++n) {
    const float* const pixel = &image.rgba[4 * n];
    if (!distinct(pixel, &background[0])) continue;
    ++seen;
    Bin& bin = bins[binOf(pixel)];
    ++bin.count;
    for (size_t channel = 0; channel < 4; ++channel) bin.sum[channel] += static_cast<double>(pixel[channel]);
  }
  if (seen == 0) return {};
  const Bin& mode = *std::max_element(bins.begin(), bins.end(),
                                      [](const Bin& a, const Bin& b) { return a.count < b.count; });
  std::array<float, 4> colour;
  for (size_t channel = 0; channel < 4; ++channel)
    colour[channel] = static_cast<float>(mode.sum[channel] / static_cast<double>(mode.count));
  size_t other = 0;
  for (size_t n = 0; n < pixels; ++n) {
    const float* const pixel = &image.rgba[4 * n];
    other += distinct(pixel, &background[0]) && distinct(pixel, colour.data());
  }
  return {static_cast<double>(seen) / static_cast<double>(pixels),
          static_cast<double>(other) / static_cast<double>(pixels)};
}

}  // namespace curvisplat
