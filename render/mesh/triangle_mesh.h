// A surface of triangles in memory, with smooth normals, and perhaps a scalar at its vertices.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace curvisplat {

struct TriangleMesh {
  glm::dvec3 origin{0.0};            // of the positions, in the data's coordinates
  std::vector<glm::vec3> positions;  // from the origin
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<glm::vec3> normals;  // [positions], of length 1; of either side. 0: not known
  std::vector<float> scalars;      // [positions], or none; NaN: no value
  std::vector<float> opacity_scalars =
      {};  // the same of the scalar that has the opacities; none: `scalars` has

  uint64_t bytes() const;
};

/// Vertices and triangles as a file has them. Positions are finite, indices valid.
struct RawMesh {
  std::vector<glm::dvec3> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<float> scalars = {}, opacity_scalars = {};  // [positions], or none
};

/// Merges coincident vertices, leaves out triangles without area and computes normals: of a vertex the mean of
/// its triangles', weighted by their angles there. Where triangles meet at more than 40 degrees the vertex is
/// doubled, so that edges stay sharp. The same input gives the same bytes.
TriangleMesh meshOf(RawMesh raw);

}  // namespace curvisplat
