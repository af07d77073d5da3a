// A picture of a grid by the shortest way: nodes to splats, all of them in one order, painted. No cache, no
// codec, no bricks. Every correction of the method can be left out, to see what it is worth.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/seams/joint_nodes.h"
#include "preprocess/splats/node_splats.h"
#include "render/camera/camera.h"
#include "render/colour/transfer_function.h"
#include "render/image/image.h"
#include "render/project/light.h"
#include "render/project/plane_cuts.h"
#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"
#include "stream/model/corrections.h"

namespace curvisplat {

struct DirectOptions {
  SplatCorrections nodes;
  bool merge_seams = true;  // else coincident nodes of block faces stay apart
  UnlikeHalves unlike = UnlikeHalves::kApart;
  bool border_parts = true;  // else half cells are drawn as one splat
  double voxel = 0;          // world units: splats are merged into voxels of this size; 0: they are not
  double spread = 12;        // as VoxelMerger
  bool even = true;          // else merged splats have the blur of their own size, and end at no faces
  bool variance = true;      // else merged splats forget the variance that their slope does not explain

  std::vector<ClipPlane> clip_planes;
  bool cut_splats =
      true;  // else splats whose centre is outside of a clip plane, or behind a surface, are left
             // out, and no others
  std::shared_ptr<const SurfaceScene> scene;
  SliceCorrections slices;
  IsoCorrections isosurfaces;

  std::optional<Light> light;
  double light_g0 = 1;

  bool per_pixel = true;
  bool hidden_slope = true;  // else classification forgets how the scalar changes along the ray
  bool secant = true;        // perspective: else the depth counts as the distance
  double low_pass_px2 = kLowPass;
  double slope_low_pass_px2 = kSlopeLowPass;
  double widest = kWidest;
  double near = 1e-3;
};

/// Draws the scalar at `scalar` of the source's description, over white, in memory.
Image drawDirectly(const GridSource& source, uint32_t scalar, const DirectOptions& options,
                   const TransferFunction& function, const Camera& camera, ImageSize size);

}  // namespace curvisplat
