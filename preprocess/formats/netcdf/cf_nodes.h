// The nodes of one block of a grid by the CF conventions: their positions, what blanks them, and values. Boxes are
// of any extent along i, too, so that a single column can be read.
//
// Buffers are bounded: positions are computed for 65,536 nodes at a time, and a mask that is not itself requested
// is read for 2^20. Any number of threads may read.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/formats/netcdf/cf_grid.h"
#include "preprocess/formats/netcdf/map_projection.h"
#include "preprocess/formats/netcdf/netcdf_files.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

class CfNodes {
 public:
  /// `files` must outlive the object. `mask`: which of the grid's variables blanks the nodes where it is missing.
  CfNodes(const NetcdfFiles& files, CfGrid grid, const Globe& globe, size_t mask);

  const CfGrid& grid() const { return grid_; }

  /// Reads as GridSource::read() does, but the box begins and ends anywhere along i. Throws Error.
  void read(const CfRange& range, std::span<const uint32_t> scalars, NodeArrays& out) const;

  /// Values of one variable, NaN where it is missing, to the beginning of `to`.
  void readScalar(const CfRange& range, size_t scalar, std::span<float> to) const;

  /// The positions on the unit sphere (or the map) of the nodes of a range with a single level.
  std::vector<glm::dvec3> points(const CfRange& range) const;

 private:
  void readPlaces(const CfRange& range, NodeArrays& out) const;
  void readColumns(const CfRange& range, std::vector<glm::dvec3>& columns) const;
  void readMiddles(const CfRange& range, std::vector<glm::dvec3>& columns) const;
  void blankFirstLevel(const CfRange& range, std::vector<uint8_t>& blank) const;
  void applyMask(const CfRange& range, std::vector<uint8_t>& blank) const;
  void readBlank(const CfRange& range, std::vector<uint8_t>& blank) const;
  bool projects() const { return grid_.projection && globe_.degrees(); }

  const NetcdfFiles& files_;
  CfGrid grid_;
  Globe globe_;
  size_t mask_;
  double length_;  // unit of x and y in kilometres, unless they are degrees
};

}  // namespace curvisplat
