// Joins the faces of a grid on a sphere: of the cube of a cubed sphere, of MITgcm's "lat-lon-cap", of tiles.
// Values are at the centres of a model's cells, so that neighbouring faces are a step apart; the joined grid
// has no gaps between them.
//
// A FaceSource has a block for each face, all of the same dimensions, in one file (netcdf_source.h) or in a
// file for each face (open_netcdf.cpp). joinFaces() adds blocks: for each joint of two faces one of two
// nodes across, the last nodes of a face and the first nodes of its neighbour; for each hole between three
// or four corners one of 2x2 columns. Their nodes coincide with the faces', so that each becomes one splat
// (preprocess/seams/seams.h). The neighbours are found by the positions of the nodes alone. Two rows of
// every edge are kept in memory, 32 MiB at most, while the grid is opened. Any number of threads may read.
#pragma once

#include <glm/vec3.hpp>

#include <memory>
#include <vector>

#include "preprocess/formats/netcdf/cf_term.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A grid whose blocks are faces of equal dimensions.
class FaceSource : public GridSource {
 public:
  /// Reads as read() does, but the range may begin and end anywhere along i.
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
  /// The positions on the unit sphere of the nodes of a range with a single level.
  virtual std::vector<glm::dvec3> pointsOf(uint32_t block, const CfRange& range) const = 0;
};

/// `source` with blocks in the gaps between its faces. If its nodes are not on a sphere, it is returned as
/// it is. Throws Error as the source does.
std::unique_ptr<GridSource> joinFaces(std::unique_ptr<FaceSource> source);

}  // namespace curvisplat
