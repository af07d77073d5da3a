#include "render/frame/step_player.h"

#include <utility>

namespace curvisplat {

StepPlayer::StepPlayer(CacheReader& cache, const DrawnScalars& scalars, Backend backend)
    : cache_(cache),
      scalars_(scalars),
      backend_(backend),
      renderer_(std::make_unique<FrameRenderer>(cache, scalars, backend)) {}

void StepPlayer::setTransferFunction(const TransferFunction& transfer_function) {
  scalars_.opacity.function = transfer_function;
  renderer_->setTransferFunction(transfer_function);
}

void StepPlayer::goTo(const StepPosition& position) {
  if (position == cache_.position()) return;
  CacheReader next = cache_.at(position);
  if (next.sharesGeometryWith(cache_)) {
    renderer_->changeStep([&] { cache_ = std::move(next); });
    return;
  }
  renderer_.reset();  // reads the cache
  cache_ = std::move(next);
  renderer_ = std::make_unique<FrameRenderer>(cache_, scalars_, backend_);
}

}  // namespace curvisplat
