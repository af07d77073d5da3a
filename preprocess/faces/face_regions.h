// The parts of faces that boundary conditions name, found by face and by row: both take time in proportion to the parts, however
// many there are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/faces/face_spool.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

/// The regions of all faces. Any thread may ask.
class FaceRegions {
 public:
  explicit FaceRegions(std::vector<FaceRegion> regions);

  /// Those of a face, in the order in which they were given.
  std::span<const FaceRegion> of(uint32_t face) const;

 private:
  std::vector<FaceRegion> regions_;  // by face
};

/// Which quads of a face lie in any of its regions, row after row.
class RegionRows {
 public:
  /// `regions`: of one face, each with a quad at least. `quads`: the range of each row.
  RegionRows(std::span<const FaceRegion> regions, const RowRange& quads);

  /// Of row v, which is no less than that of the call before: [quad of the range], 1 in a region. Valid until the next call.
  std::span<const uint8_t> row(uint64_t v);

 private:
  void change(const FaceRegion& region, int32_t by);

  const std::span<const FaceRegion> regions_;
  const RowRange quads_;
  std::vector<uint32_t> by_first_, by_last_;  // numbers of regions, by their first and their last row
  size_t begun_ = 0, ended_ = 0;              // of these
  std::vector<int32_t> changes_;  // [quad]: regions of this row that begin there, less those that end
  std::vector<uint8_t> inside_;   // [quad]
};

}  // namespace curvisplat
