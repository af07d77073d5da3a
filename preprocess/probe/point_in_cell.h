// Finds where in a cell a point lies, and the weights of the cell's corners there: trilinear in hexahedra,
// linear in tetrahedra, and what hexahedra with collapsed edges give in wedges and pyramids, as VTK's cells
// do. Polyhedra are cut into tetrahedra between their centre, those of their faces and their edges. Pure: any
// thread.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// The weights of a hexahedron's corners (Hexahedron's order) at a point; nullopt outside.
std::optional<std::array<double, 8>> weightsInHexahedron(const std::array<glm::dvec3, 8>& corners,
                                                         const glm::dvec3& point);

/// The weights of the corners of a cell of any shape, in its order; nullopt outside. `faces`: of a polyhedron (MeshCells::faces).
std::optional<std::vector<double>> weightsInCell(CellKind shape, std::span<const glm::dvec3> corners,
                                                 std::span<const uint32_t> faces, const glm::dvec3& point);

}  // namespace curvisplat
