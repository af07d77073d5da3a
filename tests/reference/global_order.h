// The specification of a frame's drawing order: all splats of its cut in memory, sorted for each order tile by
// itself, and each tile drawn as a picture of its own. Keys are the program's (keyAt): DepthKeysTest compares these with a formula.
#pragma once

#include <vector>

#include "render/backend/backend.h"
#include "render/colour/transfer_function.h"
#include "render/frame/frame_options.h"
#include "render/image/image.h"
#include "render/project/projection.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The picture that FrameRenderer::render() is to draw, bit for bit. A scene has surfaces alone; no part is left out
/// behind them.
Image globallySorted(const CacheReader& cache, const DrawnScalars& scalars, Backend backend,
                     const Camera& camera, const FrameOptions& options);
/// Draws the same of the cache's first variable.
inline Image globallySorted(const CacheReader& cache, const TransferFunction& transfer_function,
                            Backend backend, const Camera& camera, const FrameOptions& options) {
  return globallySorted(cache, DrawnScalars(0, transfer_function), backend, camera, options);
}

}  // namespace curvisplat
