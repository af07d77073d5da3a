// Draws the time steps of a cache: one renderer as long as the geometry stays, so that decoded geometry is kept while
// values change. One caller at a time, as FrameRenderer.
#pragma once

#include <cstdint>
#include <memory>

#include "render/frame/frame.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class StepPlayer {
 public:
  /// `cache` must outlive it, and is at the step that is drawn. Throws Error as FrameRenderer.
  StepPlayer(CacheReader& cache, const DrawnScalars& scalars, Backend backend);

  FrameRenderer& renderer() { return *renderer_; }
  /// Of the opacities, of this step and those to come.
  void setTransferFunction(const TransferFunction& transfer_function);
  /// Makes this step, or time between two, the one that is drawn. Throws Error as CacheReader.
  void goTo(const StepPosition& position);
  /// The time that is drawn.
  double time() const { return cache_.time(); }

 private:
  CacheReader& cache_;
  DrawnScalars scalars_;
  const Backend backend_;
  std::unique_ptr<FrameRenderer> renderer_;
};

}  // namespace curvisplat
