// Draws the segments of a SegmentRing, in sequence. A segment is released when the painter no longer reads
// it, which with OpenGL is one or two draws later. All segments are released before a wait, since the worker
// that the painter waits for may need their space.
#pragma once

#include <cstddef>

#include "render/frame/segment_ring.h"
#include "render/project/painter.h"

namespace curvisplat {

/// Used on the painter's thread, between the painter's begin() and end().
class SegmentDrawer {
 public:
  /// Adds the seconds that it waits to `waited_s`. All arguments are borrowed.
  SegmentDrawer(Painter& painter, SegmentRing& ring, double& waited_s)
      : painter_(painter), ring_(ring), waited_s_(waited_s) {}

  /// Waits for the next segment and draws it. False if the ring was closed or is paused.
  bool drawNext();

 private:
  void release();

  Painter& painter_;
  SegmentRing& ring_;
  double& waited_s_;
  size_t kept_ = 0;  // segments drawn and not yet released
};

}  // namespace curvisplat
