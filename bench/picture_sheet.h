// Pictures of one size in labelled rows, as one picture.
#pragma once

#include <string>
#include <vector>

#include "render/image/image.h"

namespace curvisplat {

class PictureSheet {
 public:
  /// Pictures are drawn at 1 / `shrink` of their size.
  PictureSheet(ImageSize picture, int shrink);

  /// `label`: letters become small ones; what the sheet has no letter for is left blank. An empty picture (of
  /// size 0 x 0) leaves its place blank.
  void addRow(const std::string& label, const std::vector<Image>& pictures);

  /// The sheet over white.
  Image image() const;

 private:
  ImageSize tile_;
  int shrink_;
  size_t columns_ = 0;
  std::vector<Image> rows_;
};

/// Means of `factor` x `factor` pixels, clamped to 0..1.
Image shrunk(const Image& picture, int factor);

/// `gain` times the difference of red, green and blue, around grey.
Image signedDifference(const Image& a, const Image& b, float gain);

}  // namespace curvisplat
