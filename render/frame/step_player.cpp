#include "render/frame/step_player.h"

#include <utility>

namespace curvisplat {

StepPlayer::StepPlayer(CacheReader& cache, size_t variable, const TransferFunction& transfer_function,
                       Backend backend)
    : cache_(cache),
      variable_(variable),
      transfer_function_(transfer_function),
      backend_(backend),
      renderer_(std::make_unique<FrameRenderer>(cache, variable, transfer_function, backend)) {}

void StepPlayer::setTransferFunction(const TransferFunction& transfer_function) {
  transfer_function_ = transfer_function;
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
  renderer_ = std::make_unique<FrameRenderer>(cache_, variable_, transfer_function_, backend_);
}

}  // namespace curvisplat
