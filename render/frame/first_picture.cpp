#include "render/frame/first_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "stream/base/error.h"

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

/// A row of the reduced picture at the columns of the whole one.
void widen(const float* row, const std::vector<Between>& columns, float* out) {
  for (const Between& column : columns) {
    const float *const left = row + 4 * column.first, *const right = row + 4 * column.second;
    for (int c = 0; c < 4; ++c) out[c] = left[c] + column.part * (right[c] - left[c]);
    out += 4;
  }
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
  const size_t row_floats = 4 * static_cast<size_t>(whole_.width);
  // The rows of the reduced picture, made as wide as the whole one: each lies above or below several rows of it.
  std::array<std::vector<float>, 2> wide{std::vector<float>(row_floats), std::vector<float>(row_floats)};
  std::array<int, 2> held{-1, -1};
  const auto widened = [&](int row) -> const float* {
    const auto slot = static_cast<size_t>(row % 2);
    if (held[slot] != row) {
      held[slot] = row;
      widen(picture.pixel(0, row), columns, wide[slot].data());
    }
    return wide[slot].data();
  };
  for (int y = 0; y < whole_.height; ++y) {
    const Between& row = rows[static_cast<size_t>(y)];
    const float *const upper = widened(row.first), *const lower = widened(row.second);
    float* const out = image.pixel(0, y);
    for (size_t n = 0; n < row_floats; ++n) out[n] = upper[n] + row.part * (lower[n] - upper[n]);
  }
  return image;
}

}  // namespace curvisplat
