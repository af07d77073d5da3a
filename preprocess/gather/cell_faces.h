// The faces of gathered cells, for FaceMatcher.
#pragma once

#include <glm/vec3.hpp>

#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/face_matcher.h"

namespace curvisplat {

/// A face as one of its cells has it.
struct HalfFace {
  size_t cell = 0;                    // among the gathered ones
  std::span<const uint32_t> corners;  // places among the cell's
  bool of_plain_cell = false;         // which is no polyhedron, and whose corners are different points
  glm::dvec3 inward{0.0};             // at right angles to it, as long as its area, into the cell
  glm::dvec3 centre{0.0};             // the mean of its corners
};

/// The faces of all cells in their order. Collapsed ones, with fewer than three corners, are left out.
class FaceList {
 public:
  /// Which face.
  struct Place {
    uint32_t cell, at;  // among the gathered ones; where it begins in facesOf() the cell
    bool of_plain_cell;
  };
  std::vector<FaceCorners> corners;
  std::vector<Place> places;

  void assign(const GatheredCells& cells);  // in parallel; keeps the capacity
  /// Face n, measured. Any thread.
  HalfFace face(const GatheredCells& cells, size_t n) const;

 private:
  bool assignCell(const GatheredCells& cells, size_t n);
  void leaveOutCollapsed();

  std::vector<size_t> begins_{0};  // [cell + 1], in corners, with collapsed ones
};

}  // namespace curvisplat
