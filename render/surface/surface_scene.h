// What is shown in a volume, or in its place: surfaces of triangles, and slices that have the scalar's colours.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "render/mesh/triangle_mesh.h"
#include "render/project/clip_planes.h"

namespace curvisplat {

inline constexpr size_t kMaxSlices = 8;

/// Opaque and lit, from both sides. In data coordinates.
struct Surface {
  std::shared_ptr<const TriangleMesh> mesh;
  glm::vec3 colour{0.7f, 0.7f, 0.7f};
  bool by_scalar =
      false;  // the transfer function's colours for the mesh's scalars; `colour` where it has none
};

struct SurfaceScene {
  std::vector<Surface> surfaces;
  std::vector<ClipPlane> slices;  // planes; either side
  double slice_opacity = 1;
  bool volume = true;  // false: surfaces and slices alone

  bool empty() const { return surfaces.empty() && slices.empty(); }
};

}  // namespace curvisplat
