// Which bricks a frame need not read or prepare, since what is painted already hides them. Exact: a brick is
// hidden if splats anywhere in its rectangle of the screen would change no bit of the picture
// (Painter::hides). So the picture does not depend on when it is asked; only how much is read does.
//
// Any thread may ask. About 0.1 us where the answer is no.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>

#include "render/project/painter.h"
#include "render/project/screen_view.h"
#include "stream/model/brick.h"

namespace curvisplat {

class HiddenBricks {
 public:
  /// Begins a frame, in which nothing is hidden before ask(). Nobody asks meanwhile. `bricks` are borrowed.
  void begin(std::span<const Brick> bricks, const ScreenView& view);
  /// From now on `painter` answers, which has begun; nobody if null.
  void ask(const Painter* painter) { painter_ = painter; }

  bool hides(uint32_t brick) const;

 private:
  std::span<const Brick> bricks_;
  ScreenView view_;
  std::atomic<const Painter*> painter_ = nullptr;
};

/// Holds the footprints of all splats that a brick can have; all of the screen, and more, where the eye is so
/// close that this cannot be told.
ScreenBox screenBoxOf(const Brick& brick, const ScreenView& view);

}  // namespace curvisplat
