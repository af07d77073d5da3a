#include "render/frame/segment_drawer.h"

#include <optional>
#include <span>

#include "stream/base/stage_timer.h"

namespace curvisplat {

bool SegmentDrawer::drawNext() {
  std::optional<std::span<const ScreenSplat>> segment = ring_.nextIfReady();
  if (!segment) {
    painter_.finishDraws();
    release();
    const WaitTimer timer(waited_s_, "wait for splats");
    segment = ring_.next();
  }
  if (!segment) return false;
  {
    const TraceScope trace("draw batch", TraceKind::kStage);
    painter_.draw(*segment);
  }
  ++kept_;
  release();
  return true;
}

void SegmentDrawer::release() {
  for (; kept_ > painter_.drawsUnderWay(); --kept_) ring_.release();
}

}  // namespace curvisplat
