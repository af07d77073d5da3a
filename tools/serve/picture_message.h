// Pictures on their way to a page: the bytes of a message (PictureHeader, and a JPEG or PNG file), and how
// fine the pictures of one viewer may be, so that they arrive in time (LineQuality).
//
// Encoding compresses the whole picture on the calling thread, row by row: beside the picture it takes the
// memory of the message, twice (messageBytes()). The functions keep no state: any thread may call them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>

#include "render/image/image.h"

namespace curvisplat {

/// How a picture of a moving camera is encoded.
struct PictureQuality {
  int jpeg = 90;      // 1..100
  int reduction = 1;  // of the resolution in each direction
};

/// Learns how fine pictures may be from the page's reports that it has drawn them.
///
/// At most three pictures are on their way. Where the line is too slow, they queue up, and the time until
/// they are shown grows beyond the shortest one of late, which is the line's own delay: then pictures become
/// coarser by a level. When that time has been short for some pictures, they become finer again. A value
/// type, which knows no clock.
class LineQuality {
 public:
  static constexpr size_t kMaxOnTheWay = 3;
  static constexpr int kCoarsest = 6;

  /// Whether a further picture may be sent: not while more than `most_bytes` are on their way.
  bool isOpen(uint64_t most_bytes = UINT64_MAX) const {
    return sent_.size() < kMaxOnTheWay && bytes_ <= most_bytes;
  }
  size_t onTheWay() const { return sent_.size(); }
  int level() const { return level_; }
  PictureQuality quality() const;

  /// A picture was sent. `counts`: whether its delay tells about the line, since a lossless picture may take
  /// long.
  void sent(uint64_t picture, double now_s, bool counts, uint64_t bytes = 0);
  /// The page has drawn this picture and all before it. Pictures that are not on their way are ignored.
  void shown(uint64_t picture, double now_s);

 private:
  struct Sent {
    uint64_t picture, bytes;
    double at_s;
    bool counts;
  };
  void learn(double delay_s);

  std::deque<Sent> sent_;
  uint64_t bytes_ = 0;         // of sent_
  std::deque<double> delays_;  // lately
  int level_ = 0;
  int in_time_ = 0;                  // pictures since the last late one
  int since_change_ = kMaxOnTheWay;  // pictures since the level changed
};

/// The header of a picture. In a message it takes 44 bytes, and the bytes of a JPEG or PNG file follow:
///
///   byte  0  4  "CVP1"
///         4  4  picture     counted from 1 for each viewer; the page reports it as shown
///         8  8  request     the number of the page's request, a double
///        16  4  step        the time step
///        20  2  width       of the view, in pixels
///        22  2  height
///        24  1  format      0: JPEG, 1: PNG
///        25  1  is_final    nothing finer follows
///        26  1  level       of LineQuality
///        27  1  unused
///        28  4  seconds     that it took to draw, a float
///        32  4  error_px    the largest error on the screen, a float
///        36  4  splats      drawn
///        40  2  data_width  of the part that shows the data, at the left, in pixels
///        42  2  unused
///
/// Numbers are little-endian.
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

/// The most bytes that the message of a picture of this size has.
uint64_t messageBytes(ImageSize size);
/// The message of a lossless picture.
std::string losslessMessage(const PictureHeader& header, const Image& image);
/// The message of a JPEG of `image`, which is opaque. With a reduction it has fewer pixels than header.size.
std::string jpegMessage(const PictureHeader& header, const Image& image, const PictureQuality& quality);

}  // namespace curvisplat
