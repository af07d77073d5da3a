// A grid whose blocks are faces of equal dimensions, in one file (netcdf_source.h) or a file for each (tile_source.h):
// what joining them (joined_faces.h) reads.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

class FaceSource : public GridSource {
 public:
  /// As read(), of a box that begins and ends anywhere along i.
  virtual void readPart(uint32_t block, const CfRange& range, std::span<const uint32_t> scalars,
                        NodeArrays& out) const = 0;
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    const uint64_t end = box.endOfRow(description().blocks[block].ni);
    readPart(block, {{box.i0, box.j0, box.k0}, {end, box.j1, box.k1}}, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }

  /// Whether the nodes are on a sphere, with their levels along k.
  virtual bool onSphere() const = 0;
  /// On the unit sphere, of the nodes of a range with a single level.
  virtual std::vector<glm::dvec3> pointsOf(uint32_t block, const CfRange& range) const = 0;
};

}  // namespace curvisplat
