// How large the pictures of one viewer may be, so that they arrive in time: learned from when the page reports that it
// has drawn them.
//
// At most three pictures are on their way. Where the line is too slow, they queue up, and the time until they are
// shown grows beyond the shortest one lately, which is the line's own: then pictures become coarser by a
// level. When that time has been short for some pictures they become finer again. A value type; knows no clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace curvisplat {

/// How a picture of a moving camera is encoded.
struct PictureQuality {
  int jpeg = 90;      // 1..100
  int reduction = 1;  // of the resolution in each direction
};

class LineQuality {
 public:
  static constexpr size_t kMaxOnTheWay = 3;
  static constexpr int kCoarsest = 6;

  /// Whether a further picture may be sent.
  bool isOpen() const { return sent_.size() < kMaxOnTheWay; }
  size_t onTheWay() const { return sent_.size(); }
  int level() const { return level_; }
  PictureQuality quality() const;

  /// `counts`: whether its delay says something about the line: a lossless picture is allowed to take long.
  void sent(uint64_t picture, double now_s, bool counts);
  /// The page has drawn a picture, and all before it. Others than those on their way are ignored.
  void shown(uint64_t picture, double now_s);

 private:
  struct Sent {
    uint64_t picture;
    double at_s;
    bool counts;
  };
  void learn(double delay_s);

  std::deque<Sent> sent_;
  std::deque<double> delays_;  // lately
  int level_ = 0;
  int in_time_ = 0;                  // pictures since the last late one
  int since_change_ = kMaxOnTheWay;  // pictures since the level changed
};

}  // namespace curvisplat
