// How coincident parts of cells lie to one another at a joint of blocks: which halves face one another,
// where the cells of one part go on in another, and how the merged splat is stretched, skewed and shifted
// by both (JointLine, preprocess/splats/stretch.h). Pure: any thread. Throws nothing but bad_alloc.
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/shape/shape.h"
#include "preprocess/splats/node_splats.h"
#include "preprocess/splats/stretch.h"
#include "stream/model/border_code.h"

namespace curvisplat {

/// One direction of a part's border code, across which another part has its other half.
struct JointSide {
  size_t part = 0;
  int direction = 0;
  glm::dvec3 inward{0.0};  // in the part's frame
  CellRow row{};           // around the whole cell, towards the part's side
  double unstretch = 1;    // the length of an unstretched half over the part's
};

/// How directions of cells are compared at a joint.
enum class JointFrames : uint8_t {
  kRows,   // by the faces that they leave, too: thin layers may bend by more than they are thick
  kCells,  // in the frames of the cells alone: caches without kDualCells (stream/cache/manifest.h)
};

/// The sides of parts of one group, by part and direction. `group`: [part]. Those without lines have none.
std::vector<JointSide> sidesOf(std::span<const NodeSplat* const> parts, std::span<const size_t> group,
                               JointFrames frames);

/// The factor by which a half was made longer along a direction to fit where it is cut (LayerFit,
/// face_layers.h).
double fittedFactor(const NodeSplat& half, const glm::dvec3& inward);

/// Makes the halves of `half`, which has `sides`, those of an unstretched cell: their borders stay. Only
/// `splat` and `values` change.
void unstretchHalves(const NodeSplat& half, std::span<const JointSide> sides, Splat& splat,
                     std::span<SplatScalar> values);

/// Makes `merged` as long as a whole cell is in the rows of `sides`, which are of `part`, one of those that
/// it was merged of. `in_merged`: the merged splat's frame of a unit vector of the part's.
void stretchWhole(const NodeSplat& part, std::span<const JointSide> sides,
                  const std::function<glm::dvec3(const glm::dvec3&)>& in_merged, NodeSplat& merged,
                  std::span<SplatScalar> values);

/// The line of a node one away from the face, which was `line`, if one of the sides leads to the node.
std::optional<JointLine> lineBehind(std::span<const NodeSplat* const> parts, std::span<const JointSide> sides,
                                    const NodeSplat& behind, const JointLine& line);

/// Makes the splat of such a node what it is with `joined` in place of its own line along that axis of the
/// lattice.
void goOnAcross(size_t axis, const JointLine& joined, NodeSplat& behind, std::span<SplatScalar> values);

/// Whether two cells end at one face, on its two sides, along directions of their codes that have lines.
bool leaveOneFace(const NodeSplat& a, const glm::dvec3& inward_of_a, const NodeSplat& b,
                  const glm::dvec3& inward_of_b);

/// Whether two directions lead away from one another as each of the two cells sees it. One alone is not enough:
/// in the frame of a thin cell all that leans out of its layer points across it, as the row of a cell whose layer
/// bends does.
bool leadApart(const NodeSplat& a, const glm::dvec3& inward_of_a, const NodeSplat& b,
               const glm::dvec3& inward_of_b);

/// Finds which halves of two coincident nodes lie opposite to one another, across a joint: calls visit(n,
/// m, cosine) for the directions n of a's border code that are opposite to directions m of b's. Directions
/// on one line have the cosine -1.
template <typename Visit>
void forEachOpposite(const NodeSplat& a, const NodeSplat& b, JointFrames frames, const Visit& visit) {
  constexpr double kOpposite = -0.5;  // cosine of two directions, in the frame of a cell
  const InwardAxes of_a = inwardAxes(a.border_code), of_b = inwardAxes(b.border_code);
  for (int n = 0; n < of_a.count; ++n)
    for (int m = 0; m < of_b.count; ++m) {
      const glm::dvec3 inward(of_a.axis[static_cast<size_t>(n)]), other(of_b.axis[static_cast<size_t>(m)]);
      const glm::dvec3 seen = inFrameOf(a.splat, b.splat.factor() * other);
      const double cosine = glm::dot(inward, seen) / glm::length(seen);
      if (!(cosine > kOpposite) && (frames == JointFrames::kCells || leadApart(a, inward, b, other)))
        visit(n, m, cosine);
      else if (frames == JointFrames::kRows && leaveOneFace(a, inward, b, other))
        visit(n, m, -1.0);
    }
}

}  // namespace curvisplat
