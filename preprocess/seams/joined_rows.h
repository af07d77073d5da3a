// Halves whose grid lines go on in one another at a joint, as one cell that has never been cut: at the seam of a closed
// row, and between blocks that abut. The columns of the two halves' Jacobians add up to the whole one's:
//
//        X-  <--- half of A ---  X  --- half of B --->  X+        J = (X+ - X-) / 2, and f's difference as well
//
// Moments of the two halves are another cell where the row is bent: its thickness is that of the chord's sagitta, 22,000
// times as much for layers of 1 m on a sphere of 10 degrees. Sums depend on the order of adding. Not for several threads
// at once.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "preprocess/seams/joint_sides.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/splats.h"

namespace curvisplat {

class JoinedRows {
 public:
  explicit JoinedRows(size_t variables) : scalars_(variables) {}

  void clear();

  struct Part {
    const NodeSplat& node;
    glm::dvec3 offset{0.0};               // of the unstretched part's middle, from the node
    std::span<const SplatScalar> values;  // of the part as it came
    std::span<const SplatScalar> unstretched;
  };
  void add(const Part& part, std::span<const JointSide> sides);

  /// Whether each part has another one on the other side of it along all the lines on which it has any; all parts along
  /// the same one, two or three lines.
  bool goOn() const;

  /// Overwrites the splat (the position from the node's) and the values.
  void finish(const glm::dvec3& node, Splat& splat, std::span<SplatScalar> values) const;

  /// The frame of the whole splat, unstretched, of a unit vector of a part's, the part with `sides`.
  glm::dvec3 inFrame(const Splat& whole, const Splat& part, std::span<const JointSide> sides,
                     const glm::dvec3& direction) const;

 private:
  static constexpr size_t kMaxLines = 3;
  struct Half {
    double count = 0;
    glm::dvec3 column{0.0};  // sum; inwards
  };
  struct Line {
    glm::dvec3 normal{0.0};      // of the face, of unit length, towards the first part
    std::array<Half, 2> halves;  // on the first part's side, on the other one
    glm::dvec3 column() const {
      return halves[0].column / halves[0].count - halves[1].column / halves[1].count;
    }
  };
  struct ScalarSums {
    std::array<std::array<double, 2>, kMaxLines> change{};  // along the halves' columns
    glm::dvec3 across{0.0};  // S times the gradient, of the columns that are not cut
    double mean = 0, weight = 0, least = 0, most = 0, plain_mean = 0;
  };
  /// The line that leads along the normal, and which of its halves; adds one for the first part.
  std::pair<size_t, size_t> lineAlong(const glm::dvec3& normal);

  size_t parts_ = 0, lines_ = 0;
  bool fits_ = true;
  std::array<Line, kMaxLines> line_;
  glm::dmat3 across_{0.0};  // S of the columns that are not cut
  double weight_ = 0;
  glm::dvec3 offset_{0.0}, plain_offset_{0.0};
  std::vector<ScalarSums> scalars_;
};

}  // namespace curvisplat
