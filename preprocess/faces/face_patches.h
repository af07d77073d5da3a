// Cuts a face into patches, at all its levels of detail.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/faces/face_spool.h"
#include "stream/base/progress.h"
#include "stream/cache/faces_file.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

/// Which quads of a face are drawn: a bit each, rows along u.
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

/// Appends the streams of the face's patches and returns them, the coarsest first; numbers of children count from
/// `first_number`. None if no quad is drawn. Holds 256 patches at a time.
std::vector<FacePatch> writePatches(const FaceSpool& spool, uint32_t face, const QuadMask& drawn,
                                    uint32_t first_number, FacesWriter& writer, const Progress& progress);

}  // namespace curvisplat
