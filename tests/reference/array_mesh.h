// Unstructured grids in memory, for tests: of any cells, and the half-annulus in tetrahedra and in hexahedra.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/mesh/mesh_source.h"
#include "preprocess/scenes/scene.h"

namespace curvisplat {

/// One piece of a mesh. `cells` has readCells()'s form without hidden ones' flags and scalars.
struct ArrayPiece {
  std::vector<glm::dvec3> points;
  MeshCells cells;
  std::vector<float> point_values;  // the scalar "f"
  std::vector<float> cell_values;   // the scalar "c"
};

class ArrayMesh final : public MeshSource {
 public:
  explicit ArrayMesh(std::vector<ArrayPiece> pieces);

  const GridDescription& description() const override { return description_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  std::vector<ArrayPiece> pieces_;
  GridDescription description_;
};

/// Sets both scalars, of cells at the mean of their corners.
void setValues(ArrayPiece& piece, const std::function<double(const glm::dvec3&)>& field);

/// A scene in tetrahedra: two interleaved lattices of nu x nv x nw cubes, whose centres and corners are the points
/// (body-centred cubic, 12 tetrahedra a cube).
ArrayPiece tetrahedraOf(const Scene& scene, uint64_t nu, uint64_t nv, uint64_t nw);
/// A scene in nu x nv x nw hexahedra.
ArrayPiece hexahedraOf(const Scene& scene, uint64_t nu, uint64_t nv, uint64_t nw);

/// A cube, by its lowest corner and its length.
struct Box {
  std::array<uint64_t, 3> low;
  uint64_t size;
};
/// Hexahedra that share the points where their corners meet. Values are those of a linear field.
ArrayPiece boxesOf(const std::vector<Box>& boxes);
/// n x n x n cells of a cube, each even one of them in eight parts.
ArrayPiece partedCube(uint64_t n);

/// The same mesh with points and cells in a random order, and corners turned the other way round in every second
/// tetrahedron.
ArrayPiece shuffled(const ArrayPiece& piece, uint32_t seed);
/// The same mesh in pieces, each with points of its own: a cell goes to piece number part(cell).
std::vector<ArrayPiece> split(const ArrayPiece& piece, size_t pieces,
                              const std::function<size_t(size_t cell)>& part);

}  // namespace curvisplat
