// The grid's faces as meshes: which patches a view needs, and their triangles.
//
// A patch is refined while the longest edge of its quads is longer than the screen error allowed (up to two pixels, than
// twice that: the nodes that it leaves out lie within half an edge), the longest on the screen first, and only where it
// is in sight. So a face of any size takes memory for what is seen of it.
// Where patches of two levels meet, the finer one's border follows the coarser one's edges: no gaps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "render/project/screen_view.h"
#include "render/surface/surface_scene.h"

namespace curvisplat {

/// The patches of a part of a surface that are drawn, in rising order. `pixels`: the screen error allowed. Below edges of
/// half a pixel nothing is gained. At most about `max_nodes` nodes in all. Pure.
using ChosenPatches = std::vector<std::pair<uint32_t, uint32_t>>;  // number of the part, patch
ChosenPatches choosePatches(const GridSurface& surface, const ScreenView& view, double pixels,
                            size_t max_nodes);

/// The mesh of patches. Parallel on the caller's TBB arena. Throws Error if the cache is damaged.
TriangleMesh meshOfPatches(const GridSurface& surface, const ChosenPatches& chosen);

/// Keeps the meshes of the last frame, which the next often needs again. One thread at a time.
class FaceMeshes {
 public:
  /// The scene's surfaces, with its grid surfaces among them.
  SurfaceScene withMeshes(const std::shared_ptr<const SurfaceScene>& scene, const ScreenView& view,
                          double lod_pixels);
  /// About what they take, of any picture of `pixels` pixels.
  static uint64_t bytes(const SurfaceScene& scene, uint64_t pixels);

 private:
  struct SurfaceMesh {
    GridSurface surface;
    ChosenPatches chosen;
    std::shared_ptr<const TriangleMesh> mesh;
  };
  std::vector<SurfaceMesh> kept_;  // [grid surface]
};

}  // namespace curvisplat
