// The grid's faces as meshes: which patches a view needs, and their triangles.
//
// A patch in sight is refined, the one with the longest edge on the screen first, while an edge of its quads
// is longer than the allowed error, or than twice that up to two pixels: the nodes that a patch leaves out
// lie within half an edge. So a face of any size takes memory only for what is seen of it. Where patches of
// two levels meet, the finer one's border follows the coarser one's edges, so there are no gaps.
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

/// The patches of a surface that are drawn, in rising order. `pixels`: the allowed error on the screen; edges
/// shorter than half a pixel gain nothing. At most about `max_nodes` nodes in all. Pure.
using ChosenPatches = std::vector<std::pair<uint32_t, uint32_t>>;  // number of the part, patch
ChosenPatches choosePatches(const GridSurface& surface, const ScreenView& view, double pixels,
                            size_t max_nodes);

/// The mesh of patches. Parallel on the caller's TBB arena. Throws Error if the cache is damaged.
TriangleMesh meshOfPatches(const GridSurface& surface, const ChosenPatches& chosen);

/// Keeps the meshes of the last frame, which the next often needs again. One thread at a time.
class FaceMeshes {
 public:
  /// The scene's surfaces, with meshes for its grid surfaces.
  SurfaceScene withMeshes(const std::shared_ptr<const SurfaceScene>& scene, const ScreenView& view,
                          double lod_pixels);
  /// The bytes that the meshes take at most, approximately, in any picture of `pixels` pixels.
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
