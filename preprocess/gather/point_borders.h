// Which outer faces the splats of points end at: those that have the point, and for points behind, those of a cell
// that has the point.
#pragma once

#include <cstdint>
#include <memory>

#include "preprocess/gather/cell_faces.h"
#include "preprocess/gather/outer_planes.h"
#include "stream/base/nameless_file.h"

namespace curvisplat {

class PointBorders {
 public:
  /// For ranges of `range_points` numbers. `cells`: about how many there will be.
  PointBorders(uint64_t points, uint64_t range_points, uint64_t cells, uint64_t memory_bytes,
               const ScratchFiles& scratch);

  /// Cells in the mesh's order.
  void add(const GatheredCells& cells);
  /// Once, after all cells; then load().
  void finish(const Progress& progress);
  OuterPlanes::OfRange load(size_t range) { return planes_.load(range); }

  /// Of the faces that wait for their second cell, whatever memory there is.
  static uint64_t waitingBytes(uint64_t cells);
  /// Of the record of a face.
  static size_t faceBytes();
  static constexpr uint64_t kMaxPlanesOfFace = 8;

 private:
  FaceMatcher faces_;
  OuterPlanes planes_;
  FaceList list_;
};

}  // namespace curvisplat
