// A picture on its way to a page: a header of 44 bytes, and the bytes of a JPEG or PNG file.
//
//   byte  0  4  "CVP1"
//         4  4  picture     counted from 1 for each viewer; the page reports it as shown
//         8  8  request     the number of the page's request, a double
//        16  4  step        the time step
//        20  2  width       of the view, in pixels
//        22  2  height
//        24  1  format      0: JPEG, 1: PNG
//        25  1  is_final    nothing finer follows
//        26  1  level       of LineQuality
//        27  1  unused
//        28  4  seconds     that it took to draw, a float
//        32  4  error_px    the largest error on the screen, a float
//        36  4  splats      drawn
//        40  2  data_width  of the part that shows the data, at the left, in pixels
//        42  2  unused
//
// Numbers are little-endian.
#pragma once

#include <cstdint>
#include <string>

#include "render/image/image.h"
#include "tools/serve/line_quality.h"

namespace curvisplat {

struct PictureHeader {
  uint32_t picture = 0;
  double request = 0;
  uint32_t step = 0;
  ImageSize size;
  bool is_png = false, is_final = false;
  uint8_t level = 0;
  float seconds = 0, error_px = 0;
  uint32_t splats = 0;
  int data_width = 0;
};
inline constexpr size_t kPictureHeaderBytes = 44;

/// The message of a picture that is lossless.
std::string losslessMessage(const PictureHeader& header, const Image& image);
/// The message of a JPEG of `image`, which is opaque. With a reduction it has fewer pixels than header.size.
std::string jpegMessage(const PictureHeader& header, const Image& image, const PictureQuality& quality);

}  // namespace curvisplat
