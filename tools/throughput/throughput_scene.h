// What `curvisplat bench` draws: a cache, a scalar, a transfer function, and cameras around the data.
#pragma once

#include <functional>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/frame/backend.h"
#include "render/frame/frame.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Refers to objects of the subcommand.
struct ThroughputScene {
  const CacheReader& cache;
  size_t variable;
  const TransferFunction& transfer_function;
  FrameOptions options;  // of every frame, before one of them is varied
  Backend backend;
  /// `frames` cameras spread evenly over one orbit around the data.
  std::function<std::vector<Camera>(unsigned frames)> orbit;
};

}  // namespace curvisplat
