// Draws what comes out of a SegmentRing, in sequence. A segment goes back when the painter no longer reads
// it, which with OpenGL is a draw or two later; all of them go back before a wait, since the worker that is
// waited for may need their space.
#pragma once

#include <cstddef>

#include "render/frame/segment_ring.h"
#include "render/project/painter.h"

namespace curvisplat {

/// On the painter's thread, between its begin() and end().
class SegmentDrawer {
 public:
  /// Adds the time that it waits to `waited_s`. All are borrowed.
  SegmentDrawer(Painter& painter, SegmentRing& ring, double& waited_s)
      : painter_(painter), ring_(ring), waited_s_(waited_s) {}

  /// Waits for the next segment and draws it. False if the ring was closed, or pauses.
  bool drawNext();

 private:
  void release();

  Painter& painter_;
  SegmentRing& ring_;
  double& waited_s_;
  size_t kept_ = 0;  // segments drawn and not given back
};

}  // namespace curvisplat
