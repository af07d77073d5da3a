// Draws what lies in the volume before the volume is drawn: surfaces, faces of the grid, slices and isosurfaces. They become
// layers of the plan's pixels. DESIGN.md, "Splats", "Surfaces and slices" and "Isosurfaces".
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "render/frame/drawn_scalars.h"
#include "render/frame/frame_options.h"
#include "render/frame/frame_plan.h"
#include "render/frame/frame_statistics.h"
#include "render/surface/face_meshes.h"
#include "render/surface/iso_layers.h"
#include "render/surface/scene_triangles.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct SamplingWork;

/// One caller at a time.
class LayerDrawer {
 public:
  /// Gives the splats of some bricks to whoever samples them, and returns once all are sampled.
  using Sample = std::function<void(const SamplingWork& work)>;

  /// The cache and the planner must outlive it.
  LayerDrawer(const CacheReader& cache, const DrawnScalars& scalars, const FramePlanner& planner)
      : cache_(cache),
        variable_(scalars.opacity.variable),
        coloured_by_(scalars.colour ? std::optional(scalars.colour->variable) : std::nullopt),
        planner_(planner) {}

  /// Draws options.scene, if there is one, and puts its layers into the plan. Adds to `statistics`. Throws UsageError where
  /// options.memory_bytes does not suffice, and what `sample` throws.
  void draw(FramePlan& plan, const FrameOptions& options, const Sample& sample, FrameStatistics& statistics);
  /// Gives up the memory that is kept from picture to picture.
  void release() { surface_memory_ = {}; }

  /// About what a scene takes: its meshes, their vertices on the screen and their triangles in tiles, samples of slices
  /// and of surfaces, and a layer and a half a pixel with a window behind it. The same for all pictures of one size.
  static uint64_t bytes(const FrameOptions& options);

 private:
  struct IsoInput {
    const Sample& sample;
    double depth_origin;
    const ColourTable* opacities;  // of the picture's function; null: not needed
  };
  std::optional<IsoLayers> isosurfaces(const FramePlan& plan, const FrameOptions& options,
                                       const IsoInput& input, FrameStatistics& statistics) const;

  const CacheReader& cache_;
  const size_t variable_;
  const std::optional<size_t> coloured_by_;  // another variable
  const FramePlanner& planner_;
  FaceMeshes face_meshes_;
  ScreenVertices surface_memory_;  // of the last picture's surfaces, for the next one's
};

}  // namespace curvisplat
