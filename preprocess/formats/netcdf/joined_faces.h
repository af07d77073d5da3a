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
#include "preprocess/grid/box_source.h"

namespace curvisplat {

/// A grid whose blocks are faces of equal dimensions.
class FaceSource : public BoxSource {
 public:
  /// Whether the nodes are on a sphere, with their levels along k.
  virtual bool onSphere() const = 0;
  /// The positions on the unit sphere of the nodes of a range with a single level.
  virtual std::vector<glm::dvec3> pointsOf(uint32_t block, const CfRange& range) const = 0;
};

/// `source` with blocks in the gaps between its faces. If its nodes are not on a sphere, it is returned as
/// it is. Throws Error as the source does.
std::unique_ptr<GridSource> joinFaces(std::unique_ptr<FaceSource> source);

}  // namespace curvisplat
