// Draws what lies in the volume before the volume is drawn: surfaces, faces of the grid, slices and isosurfaces. They become layers
// of the plan's pixels. DESIGN.md, "Surfaces and slices" and "Isosurfaces". Included by frame_pipeline.h and its own source only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>

#include "render/frame/frame_options.h"
#include "render/frame/frame_plan.h"
#include "render/frame/frame_statistics.h"
#include "render/surface/face_meshes.h"
#include "render/surface/iso_groups.h"
#include "render/surface/iso_layers.h"
#include "render/surface/iso_meshes.h"
#include "render/surface/scene_triangles.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct SamplingWork;

/// Keeps the surfaces' memory from picture to picture.
class LayerDrawer {
 public:
  /// Gives the splats of some bricks to whoever samples them, and returns once all are sampled. Splats of other
  /// scalars than the picture's take the memory of the bricks that are kept, which are then read again.
  using Sample = std::function<void(const SamplingWork& work)>;

  /// The cache and the planner must outlive it.
  LayerDrawer(const CacheReader& cache, const DrawnScalars& scalars, const FramePlanner& planner)
      : cache_(cache),
        variable_(scalars.opacity.variable),
        coloured_by_(scalars.colour ? std::optional(scalars.colour->variable) : std::nullopt),
        planner_(planner) {}

  /// Draws options.scene, if there is one, and puts its layers into the plan. Adds to `statistics`. Throws
  /// UsageError where options.memory_bytes does not suffice, and what `sample` and `throw_if_stopped` throw.
  void draw(FramePlan& plan, const FrameOptions& options, const Sample& sample,
            const std::function<void()>& throw_if_stopped, FrameStatistics& statistics);
  /// Gives up the memory that is kept from picture to picture.
  void release() {
    surface_memory_ = {};
    iso_meshes_.clear();
  }
  /// The cache is at another step.
  void stepChanged() { iso_meshes_.clear(); }

  /// The memory, in bytes, that a scene takes, estimated: its meshes, their vertices on the screen and their
  /// triangles in tiles, samples of slices and of surfaces, and a layer and a half a pixel with a window behind
  /// it. The same for all pictures of one size.
  uint64_t bytes(const FrameOptions& options) const;

 private:
  struct IsoInput {
    const IsoGroup& group;
    std::span<const BrickPart> parts;
    const Sample& sample;
    double depth_origin;
    const ColourTable* opacities;  // of the picture's function; null: not needed
  };
  PictureScalars scalars() const { return {variable_, coloured_by_}; }
  const IsoMeshes::Meshes* isoMeshes(const IsoInput& input, const FramePlan& plan,
                                     const FrameOptions& options,
                                     const std::function<void()>& throw_if_stopped,
                                     FrameStatistics& statistics);
  BrickSource::Variables readFor(const IsoGroup& group) const;
  IsoLayers isosurfaces(const IsoInput& input, const FramePlan& plan, const FrameOptions& options,
                        FrameStatistics& statistics) const;
  uint64_t isoBytes(const FrameOptions& options) const;

  const CacheReader& cache_;
  const size_t variable_;
  const std::optional<size_t> coloured_by_;  // another variable
  const FramePlanner& planner_;
  FaceMeshes face_meshes_;
  std::map<size_t, IsoMeshes> iso_meshes_;  // by scalar
  ScreenVertices surface_memory_;           // of the last picture's surfaces, for the next one's
};

}  // namespace curvisplat
