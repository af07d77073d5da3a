// The first picture of a progressive frame. It uses so few splats and pixels that it appears within a
// fraction of a second, whatever the size of the cache and of the image, also if it is drawn in software.
//
// A coarse level that is n voxels deep covers each pixel about 10 n times, which takes longer than everything
// else. But it has no detail finer than its voxels: it is drawn with two pixels per voxel and then enlarged.
#pragma once

#include "render/camera/camera.h"
#include "render/image/image.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// Limits for a picture that must appear quickly. The coarsest bricks are drawn even if they exceed them.
struct QuickLimits {
  uint64_t max_splats = CutOptions::kNoLimit;
  uint64_t max_bytes = CutOptions::kNoLimit;  // bytes to read
  double detail_px = 0;                       // size of the finest detail that is needed, in pixels
};

/// About 0.01 s of reading from a disk and 0.05 s of drawing in software.
inline constexpr QuickLimits kFirstPicture{100'000, 4 << 20, 0};

/// The size of a reduced image that shows everything that a camera shows in an image of the whole size.
class ReducedSize {
 public:
  /// Reduces `size` as far as a picture without detail finer than `detail_px` allows: 1 to 8 times.
  ReducedSize(ImageSize size, double detail_px);

  bool isWhole() const { return reduced_.height == whole_.height; }
  ImageSize size() const { return reduced_; }
  /// Enlarges a picture of size() to the whole size, with linear interpolation between its pixels.
  Image enlarge(const Image& picture) const;
  /// The part of a reduced picture's width, in its middle, that enlarge() shows of it: the picture may be a little wider.
  static double shownWidth(ImageSize whole, ImageSize reduced) {
    return static_cast<double>(whole.width) * reduced.height /
           (static_cast<double>(whole.height) * reduced.width);
  }

 private:
  ImageSize whole_, reduced_;
};

}  // namespace curvisplat
