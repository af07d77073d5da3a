// What the samples of a pixel see of triangles, and the tiles in which they are drawn.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace curvisplat {

inline constexpr int kSampleTileWidth = 128, kSampleTileHeight = 32;
inline constexpr size_t kSamples = 8;
/// From the pixel's centre, in 1/16 pixel.
inline constexpr std::array<std::array<int, 2>, kSamples> kSampleOffsets{
    {{1, -3}, {-1, 3}, {5, 1}, {-3, -5}, {-5, 5}, {-7, -1}, {3, 7}, {7, -7}}};
/// The same for vectors.
struct SamplePlaces {
  alignas(64) std::array<float, kSamples> x{}, y{};
  constexpr SamplePlaces() {
    for (size_t n = 0; n < kSamples; ++n) {
      x[n] = static_cast<float>(kSampleOffsets[n][0]);
      y[n] = static_cast<float>(kSampleOffsets[n][1]);
    }
  }
};
inline constexpr SamplePlaces kSamplePlaces;

/// What the samples of a pixel see: the triangle's number, and its value there.
struct PixelSamples {
  static constexpr uint32_t kNothing = std::numeric_limits<uint32_t>::max();

  alignas(32) std::array<float, kSamples> values;
  std::array<uint32_t, kSamples> numbers;
};
static_assert(sizeof(PixelSamples) == 64);

}  // namespace curvisplat
