// Finds bricks that a frame need not read or prepare, because the splats painted so far hide them. The test
// is exact: a brick is hidden if splats anywhere in its rectangle of the screen would change no bit of the
// picture (Painter::hides). The picture does not depend, therefore, on when the test is made; only how much
// is read does.
//
// Thread-safe. A test takes about 0.1 us if the answer is no.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>

#include "render/project/painter.h"
#include "render/project/screen_view.h"
#include "stream/model/octree.h"

namespace curvisplat {

class HiddenBricks {
 public:
  /// Begins a frame, in which nothing is hidden before ask(). No thread may call hides() meanwhile. `bricks`
  /// are borrowed.
  void begin(std::span<const Brick> bricks, const ScreenView& view);
  /// Makes `painter`, which has begun its frame, answer from now on. With null nothing is hidden.
  void ask(const Painter* painter) { painter_ = painter; }

  bool hides(uint32_t brick) const;

 private:
  std::span<const Brick> bricks_;
  ScreenView view_;
  std::atomic<const Painter*> painter_ = nullptr;
};

/// A rectangle that contains the footprints of all splats that the brick can have. It is larger than any
/// screen if the eye is too close to the brick to bound them.
ScreenBox screenBoxOf(const Brick& brick, const ScreenView& view);

/// No part of the brick's splats is nearer along the view; perspective: to the eye.
double nearestDepthOf(const Brick& brick, const ScreenView& view);
/// No part of them is farther.
double farthestDepthOf(const Brick& brick, const ScreenView& view);

}  // namespace curvisplat
