// The first picture of a progressive frame: so little of the cache, at so few pixels, that it is there within
// a fraction of a second whatever the size of the cache and of the image, drawn in software too.
//
// A coarse level of depth n voxels covers each pixel about 10 n times, which takes longer than all else; but
// it has no detail finer than its voxels. It is drawn with two pixels a voxel and enlarged.
#pragma once

#include "render/camera/camera.h"
#include "render/image/image.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// What a picture may cost that is to be had quickly; the coarsest bricks are drawn whatever they cost.
struct QuickLimits {
  uint64_t max_splats = CutOptions::kNoLimit;
  uint64_t max_bytes = CutOptions::kNoLimit;  // to be read
  double detail_px = 0;                       // the finest detail that is needed
};

/// A hundredth of a second of a disk, a twentieth of a second of drawing in software.
inline constexpr QuickLimits kFirstPicture{100'000, 4 << 20, 0};

/// An image with fewer pixels than `size` that shows what a camera shows in one of `size`.
class ReducedSize {
 public:
  /// By how much may be reduced what has no detail finer than `detail_px`: from 1 to 8 times.
  ReducedSize(ImageSize size, double detail_px);

  bool isWhole() const { return reduced_.height == whole_.height; }
  ImageSize size() const { return reduced_; }
  /// A picture of size() as one of the whole size: linear between its pixels.
  Image enlarge(const Image& picture) const;

 private:
  ImageSize whole_, reduced_;
};

}  // namespace curvisplat
