// Cuts a face of the grid into patches, at all its levels of detail; and finds the parts of faces that
// boundary conditions name, by face and by row, in time proportional to the parts, however many there are.
// One thread calls; patches are coded in parallel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/faces/face_spool.h"
#include "stream/base/progress.h"
#include "stream/cache/faces_file.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

/// The quads of a face that are drawn: a bit each, rows along u.
class QuadMask {
 public:
  explicit QuadMask(const GridFace& face)
      : columns_(face.nodes[0] - 1), bits_(columns_ * (face.nodes[1] - 1)) {}

  uint64_t columns() const { return columns_; }
  uint64_t rows() const { return bits_.size() / columns_; }
  bool at(uint64_t u, uint64_t v) const { return bits_[v * columns_ + u]; }
  void draw(uint64_t u, uint64_t v) { bits_[v * columns_ + u] = true; }
  /// Whether at least half of the quads [u0, u1) x [v0, v1) are drawn.
  bool mostOf(uint64_t u0, uint64_t u1, uint64_t v0, uint64_t v1) const;

 private:
  uint64_t columns_;
  std::vector<bool> bits_;
};

/// Appends the streams of the face's patches and returns them, the coarsest first; numbers of children count
/// from `first_number`. None if no quad is drawn. Holds 256 patches at a time.
std::vector<FacePatch> writePatches(const FaceSpool& spool, uint32_t face, const QuadMask& drawn,
                                    uint32_t first_number, FacesWriter& writer, const Progress& progress);

/// The regions (parts that boundary conditions name) of all faces. Any thread may ask.
class FaceRegions {
 public:
  explicit FaceRegions(std::vector<FaceRegion> regions);

  /// The regions of a face, in the order in which they were given.
  std::span<const FaceRegion> of(uint32_t face) const;

 private:
  std::vector<FaceRegion> regions_;  // by face
};

/// The quads of a face that lie in any of its regions, row after row.
class RegionRows {
 public:
  /// `regions`: of one face, each with a quad at least. `quads`: the range of each row.
  RegionRows(std::span<const FaceRegion> regions, const RowRange& quads);

  /// The quads of row v, which is no less than that of the call before: [quad of the range], 1 in a region.
  /// Valid until the next call.
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
