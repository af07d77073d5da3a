// Pictures in floating point, and their files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "render/camera.h"

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

/// Writes .png (8 bit), .exr or .pfm (32-bit float) by the name's ending. PNG and EXR keep alpha where the
/// image is not opaque everywhere (PNG unassociated, EXR associated); PFM has none. Written whole or not at
/// all. Throws UsageError for another ending, Error where the file cannot be written.
void writeImage(const Image& image, const std::filesystem::path& path);
/// Throws UsageError for a file name whose ending writeImage() would refuse; for use before long work.
void checkImageName(const std::filesystem::path& path);
/// What writeImage() takes in memory for an image of that size, beside the image.
uint64_t writingBytes(const std::filesystem::path& path, ImageSize size);
/// Reads what writeImage() writes, and ordinary PNG (8 and 16 bit), scan-line EXR and PFM files. Throws
/// Error.
Image readImage(const std::filesystem::path& path);

struct ImageDifference {
  double psnr_db = 0;  // over red, green and blue against a peak of 1; infinite for equal images
  double largest = 0;  // of one channel
  int largest_x = 0, largest_y = 0;
};
/// Both composited over white where they have alpha. Throws Error if the sizes differ or a pixel is not
/// finite.
ImageDifference compareImages(const Image& a, const Image& b);

}  // namespace curvisplat
