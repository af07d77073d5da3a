#include "render/frame/first_picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr double kPixelsToDetail = 2;
constexpr double kMaxReduction = 8;

/// The two rows or columns of the reduced image between which one of the whole image lies.
struct Between {
  int first, second;
  float part;  // of the second
};

/// The images' centres coincide; `scale` is the number of reduced pixels per pixel of the whole image.
std::vector<Between> positions(int whole, int reduced, double scale) {
  std::vector<Between> found;
  for (int n = 0; n < whole; ++n) {
    const double at = std::clamp((n + 0.5 - 0.5 * whole) * scale + 0.5 * reduced - 0.5, 0.0, reduced - 1.0);
    const int first = static_cast<int>(at);
    found.push_back({first, std::min(first + 1, reduced - 1), static_cast<float>(at - first)});
  }
  return found;
}

}  // namespace

ReducedSize::ReducedSize(ImageSize size, double detail_px) : whole_(size), reduced_(size) {
  const double reduction = std::clamp(detail_px / kPixelsToDetail, 1.0, kMaxReduction);
  if (reduction < 1.5) return;
  // The camera fits its view to the height. The width follows from it, so that nothing at the sides is lost.
  reduced_.height = std::max(1, static_cast<int>(std::lround(size.height / reduction)));
  const double scale = static_cast<double>(reduced_.height) / size.height;
  reduced_.width = static_cast<int>(std::ceil(size.width * scale));
}

Image ReducedSize::enlarge(const Image& picture) const {
  CURVISPLAT_CHECK_OP(picture.size.width, ==, reduced_.width);
  CURVISPLAT_CHECK_OP(picture.size.height, ==, reduced_.height);
  const double scale = static_cast<double>(reduced_.height) / whole_.height;
  const std::vector<Between> columns = positions(whole_.width, reduced_.width, scale);
  const std::vector<Between> rows = positions(whole_.height, reduced_.height, scale);
  Image image(whole_);
  for (int y = 0; y < whole_.height; ++y)
    for (int x = 0; x < whole_.width; ++x) {
      const float* const corners[2][2] = {
          {picture.pixel(columns[x].first, rows[y].first), picture.pixel(columns[x].second, rows[y].first)},
          {picture.pixel(columns[x].first, rows[y].second),
           picture.pixel(columns[x].second, rows[y].second)}};
      for (int c = 0; c < 4; ++c) {
        const float upper = std::lerp(corners[0][0][c], corners[0][1][c], columns[x].part);
        const float lower = std::lerp(corners[1][0][c], corners[1][1][c], columns[x].part);
        image.pixel(x, y)[c] = std::lerp(upper, lower, rows[y].part);
      }
    }
  return image;
}

}  // namespace curvisplat
