// Surfaces of triangles, with smooth normals and perhaps a scalar at their vertices; and how to read them
// from files: STL and PLY, each as text or binary, and Wavefront OBJ.
//
// Files come from anyone. Whatever a file says of its sizes is compared with the bytes that are there before
// anything is allocated; the memory taken is at most about 20 times the file's size. A file that is not a
// surface is refused in one line. Any thread may call the functions.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace curvisplat {

/// A surface of triangles that share vertices.
struct TriangleMesh {
  glm::dvec3 origin{0.0};            // of the positions, in the data's coordinates
  std::vector<glm::vec3> positions;  // from the origin
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<glm::vec3> normals;  // [positions], of length 1; of either side. 0: not known
  std::vector<float> scalars;      // [positions], or none; NaN: no value
  // [positions]: the scalar that gives the opacities; none: `scalars` gives them.
  std::vector<float> opacity_scalars = {};

  uint64_t bytes() const;
};

/// Vertices and triangles as a file has them. Positions are finite, indices valid.
struct RawMesh {
  std::vector<glm::dvec3> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<float> scalars = {}, opacity_scalars = {};  // [positions], or none
};

/// Merges coincident vertices, leaves out triangles without area and computes normals: of a vertex the mean
/// of its triangles', weighted by their angles there. Where triangles meet at more than 40 degrees the
/// vertex is doubled, so that edges stay sharp. The same input gives the same bytes.
TriangleMesh meshOf(RawMesh raw);

/// Reads a surface from a file, whose format is found by its first bytes and its extension. Throws Error:
/// what is wrong, what was found, what is expected.
TriangleMesh readMeshFile(const std::filesystem::path& path);

/// Reads a surface from the bytes of a file; `path` is for messages and the extension.
RawMesh parseMesh(std::span<const std::byte> bytes, const std::filesystem::path& path);

}  // namespace curvisplat
