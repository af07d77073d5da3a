// How cells follow one another across a joint of blocks. The stretch of a splat (stretch.h) is of five cells in a row, some of
// which belong to the other block where the splat is on a face, or one away from it. A block alone does not know
// them: it takes them for its own, mirrored. Once the face's nodes are found to be another block's as well (joint_nodes.h), the
// cells are as if the grid had never been cut.
//
//      block A            |           block B
//      o     o     o     o|o   o   o   o          the five cells of A's node on the face (2), and of the one beside it (1)
//            1     2     2 2   2   2
//      1     1     1     1 1   1
//
// Largest and smallest density in a uniform medium, in one dimension, of blocks of even cells and of unlike sizes:
//
//     sizes 1 and          1.5             2               3               4
//     halves as mirrored   0.979 1.029     0.962 1.054     0.921 1.097     0.887 1.137
//     as one row           0.996 1.004     0.992 1.007     0.980 1.026     0.966 1.063
//
// Half cells at borders are cut (border_code.h), which is fitted to even cells: they are stretched by 0.62 of what a whole cell
// would be, or a gap would show behind the border.
//
//     elements of 3 steps (1, 1.6, 1)      0.939 1.007  ->  0.972 1.004       of 5    0.904 1.012  ->  0.957 1.010
//     a cell, then others twice as long    0.909 1.007  ->  0.959 1.007       half as long    0.988 1.023  ->  0.987 1.016
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "preprocess/splats/stretch.h"

namespace curvisplat {

/// The lengths of five cells in a row, in world units, from the other side of the joint on. The third is the splat's own: of a node
/// on the face, as long as its block makes it.
using CellRow = std::array<double, 5>;

/// What a stretch is where `row` is all there is to know; the growth and the drift are towards the row's end.
inline Stretch stretchOfRow(const CellRow& row, StretchFit fit) {
  return stretchOf(row[0] * row[0], row[1] * row[1], row[2] * row[2], row[3] * row[3], row[4] * row[4], fit);
}

/// The stretch of a half cell that ends at a border.
inline double stretchAtBorder(double of_whole) {
  constexpr double kShare = 0.62;
  return 1 + kShare * (of_whole - 1);
}

/// The row of a node on a face of its block, or one away from it, across the face. Lengths are kept to 1.5 %, up to 39 times the unit.
class JointLine {
 public:
  JointLine() = default;
  /// `unit`: > 0, the length of the node's half cell, or of its whole cell one away from the face.
  JointLine(const CellRow& row, double unit);
  /// The same from twice the lengths, squared.
  static JointLine ofExtents(const SquaredExtents& extents, double unit);

  bool isThere() const { return unit_ > 0; }
  double unit() const { return unit_; }
  CellRow row() const;
  Stretch stretch(StretchFit fit) const { return stretchOfRow(row(), fit); }

  /// Which way the row leads, away from the face, in the frame of the node's splat: to a hundredth.
  glm::dvec3 inward() const;
  void setInward(const glm::dvec3& unit_vector);

 private:
  static constexpr double kStep = 1.0 / 24;  // of binary logarithms: even cells come out even

  float unit_ = 0;
  std::array<int8_t, 5> logarithms_{};
  std::array<int8_t, 3> inward_{};
};

}  // namespace curvisplat
