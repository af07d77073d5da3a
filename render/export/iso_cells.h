// The cubes of a lattice that an isosurface goes through, in tiles of 32x32 columns of cubes, and the quads between them.
//
// The lattice is looked at as a picture: a column of its points is the ray of a pixel, along the view. So what is found is the field of
// iso_field.h, to the bit the same for a point on the edge of two tiles. Any thread, a tile each.
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
  glm::vec3 normal;  // to smaller values
  float inside;      // below 0: behind a border of the data
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

/// `splats` are sorted, have one value, and are seen in a parallel view whose depth origin is 0.
IsoCells isoCells(const IsoSplats& splats, size_t tile, const IsoLattice& lattice);
/// The most memory that it takes.
uint64_t isoCellsBytes(const IsoSplats& splats, size_t tile, const IsoLattice& lattice);

}  // namespace curvisplat
