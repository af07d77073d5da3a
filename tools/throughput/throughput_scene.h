// What `curvisplat bench` draws: a cache, a scalar, a transfer function, and cameras around it.
#pragma once

#include <functional>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/backend.h"
#include "render/frame/frame.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Borrowed from the subcommand.
struct ThroughputScene {
  const CacheReader& cache;
  size_t variable;
  const TransferFunction& transfer_function;
  FrameOptions options;  // those of every frame, but for what is varied
  Backend backend;
  /// Cameras spread evenly over one turn around the data.
  std::function<std::vector<Camera>(unsigned frames)> orbit;
};

}  // namespace curvisplat
