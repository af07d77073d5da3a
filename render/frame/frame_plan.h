// The stage "plan" of a frame: which parts of which bricks the view needs, in which order they are swept, and
// how their splats come to the screen. Pure; it looks at the octree and at no payload.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/classification.h"
#include "render/frame/first_picture.h"
#include "render/frame/frame_options.h"
#include "render/frame/sweep_buffer.h"
#include "render/project/depth_keys.h"
#include "render/project/projection.h"
#include "stream/cache/cache_reader.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// How a frame of such a cache, of `size` pixels, comes to the screen. Throws UsageError as
/// ScreenView::of() does.
ScreenView screenViewOf(const Manifest& manifest, const Camera& camera, const FrameOptions& options,
                        ImageSize size);

struct FramePlan {
  ProjectionSettings settings;  // the picture has the size of settings.view
  Cut cut;
  DepthKeys keys;
  std::vector<SweptPart> parts;  // of the cut, in the sweep's order
};

/// A part of the cut as the sweep has it.
SweptPart sweptPart(const BrickPart& part, const Brick& brick, const DepthKeys& keys);

/// Of a picture that is to be had quickly.
struct QuickPlan {
  FramePlan plan;
  ReducedSize size;

  /// Whether there is nothing to refine.
  bool isFinal() const { return plan.cut.complete && size.isWhole(); }
};

/// Plans frames of one variable of one cache, which outlives it. Any number of threads may plan.
class FramePlanner {
 public:
  FramePlanner(const CacheReader& cache, size_t variable, const TransferFunction& transfer_function);

  /// Throws UsageError for a view that makes no picture, and if options.max_splats are too few.
  FramePlan plan(const Camera& camera, const FrameOptions& options, DrawingOrder order) const;
  /// The best picture within `limits`.
  QuickPlan planQuick(const Camera& camera, const FrameOptions& options, const QuickLimits& limits,
                      DrawingOrder order) const;

  /// For the plans to come, while nobody plans or draws.
  void setTransferFunction(const TransferFunction& transfer_function);
  ScreenView screenView(const Camera& camera, const FrameOptions& options, ImageSize size) const {
    return screenViewOf(cache_.manifest(), camera, options, size);
  }

  const ClassificationTable& table() const { return table_; }
  /// What the octree takes, and what plans and the later stages note about its bricks.
  uint64_t bytes() const;
  /// Of the cache's finest level, and what its borders are drawn in.
  uint64_t mostSplats() const;

 private:
  ProjectionSettings settingsFor(const Camera& camera, const FrameOptions& options, ImageSize size) const;
  Cut chooseCut(const ProjectionSettings& settings, const FrameOptions& options,
                const CutOptions& limits) const;
  FramePlan planOf(const ProjectionSettings& settings, Cut cut, DrawingOrder order) const;

  const CacheReader& cache_;
  const size_t variable_;
  ClassificationTable table_;
  std::pair<double, double> scalar_range_;  // of the transfer function
  const std::vector<ValueBounds> subtrees_;
};

}  // namespace curvisplat
