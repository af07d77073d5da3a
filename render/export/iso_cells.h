// The cubes of a lattice that an isosurface goes through, in tiles of 32x32 columns of cubes, and the quads between them.
//
// The lattice is treated as a picture: a column of its points is the ray of a pixel. So the field is that of
// iso_field.h, and a point on the edge of two tiles has the same bits in both, without which the mesh would
// have gaps. Any thread, a tile each.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "render/surface/iso_splats.h"

namespace curvisplat {

/// The vertex of a cube that meets the surface.
struct IsoVertex {
  glm::dvec3 at;     // in view axes, from the eye
  glm::vec3 normal;  // towards smaller values
  float inside;      // -1 to 1, in lengths of the splats; below 0: beyond a border of the data
};

struct IsoCells {
  struct Cell {
    uint64_t number;
    IsoVertex vertex;
  };
  std::vector<Cell> cells;  // of the tile
  std::vector<std::array<uint64_t, 4>>
      quads;  // numbers of cells, of this tile or the one before it on either axis
};

/// The points at which the field is sampled: `size` pixels, and planes of depth, `spacing` apart.
struct IsoLattice {
  std::array<uint32_t, 3> size{};
  double spacing = 1;

  uint64_t number(uint64_t i, uint64_t j, uint64_t k) const { return (j * size[0] + i) * size[2] + k; }
};

/// Finds the cubes and quads of a tile. `splats`: sorted, of one isosurface, in a parallel view whose depth
/// origin is 0.
IsoCells isoCells(const IsoSplats& splats, size_t tile, const IsoLattice& lattice);
/// The bytes of memory that isoCells() takes at most, if a column meets the surface no more than eight times
/// on average.
uint64_t isoCellsBytes(const IsoSplats& splats, size_t tile, const IsoLattice& lattice);

}  // namespace curvisplat
