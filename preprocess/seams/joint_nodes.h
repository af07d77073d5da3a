// The nodes of block faces that coincide at one point, and what becomes of them. Two halves give back the
// whole cell, which is stretched and skewed by the lengths of both blocks' cells there (joint_sides.h); so
// are the splats of the nodes next to the face. Where one half is more than 2.5 times as thick as the other,
// they stay apart, each cut at the face between them: one splat for both would reach too far on the thin side
// and not far enough on the thick one. So do halves on two sides of a thin wall (wall_search.h).
//
//    block A      |  block B                          alike                     unlike
//    o     o     o|o     o     o                  o--[  o  ]--o              o----[o|o]-o-o
//                half cells                        one splat           two splats, cut at the face
//
// JointNodes does this for one point after another; OpenBorders and BendOfParts give the merged splat its
// borders and means. Nothing here is for several threads at once. Sums depend on the order of adding.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "preprocess/seams/joined_rows.h"
#include "preprocess/seams/joint_sides.h"
#include "preprocess/shape/merge.h"
#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Whether the splat `behind` lies behind one of the borders of `face` that are faces to be cut at.
/// `border_code`: that of `face`.
bool isOpen(const Splat& face, uint32_t border_code, const Splat& behind);

/// The borders of a node's cell that are still open once the parts that coincide there are merged: two halves
/// of two blocks close the border between them, while a face that both of them end at stays one.
class OpenBorders {
 public:
  void clear() {
    inward_.clear();
    parts_ = 0;
  }
  /// `closed`: bit n, the code's direction n leads to a side that another part is known to lie on. By kRows,
  /// directions that have lines are closed so alone: angles say nothing where thin layers bend.
  void add(const NodeSplat& part, uint32_t closed, JointFrames frames);
  /// The half cell of `merged`, the parts' splat. A direction inwards is closed by another part's opposite
  /// one, and several parts' similar ones are one, with a face to be cut at if all have; angles are measured
  /// in the merged cell's own frame, where thin cells are round.
  uint32_t of(const Splat& merged) const { return of(merged, {}).code; }

  /// A face that one of the parts lies in the layer behind of.
  struct Layer {
    glm::dvec3 inward{0.0};  // world units, as long as the cell
    glm::dvec3 face{0.0};    // a point of it
    uint8_t axis = 0;        // LayerAxis'
  };
  /// The half cell of `merged` as above, with the faces of `layers` but for those across a direction in which one of the
  /// parts ends.
  LayeredBorder of(const Splat& merged, std::span<const Layer> layers) const;

 private:
  struct Inward {
    glm::dvec3 along;  // world units, as long as the part's cell
    size_t part;
    bool face;
    bool closed = false;
    bool has_line = false;
  };
  std::vector<Inward> inward_;
  size_t parts_ = 0;
};

/// Corrects the means of a cell that was merged from its parts, since scalars bend from one part to the next.
/// A half cell knows no second difference along its short axis (node_splats.h), and its parts' means make an
/// eighth of it where a tenth is right; the rest is taken off, and so is the variance that is this bend's
/// alone. The node is then as if its block had never been cut.
class BendOfParts {
 public:
  explicit BendOfParts(size_t variables) : sums_(variables) {}

  void clear() {
    weight_ = 0;
    middle_ = glm::dvec3(0.0);
    std::fill(sums_.begin(), sums_.end(), Sums());
  }
  /// `offset`: of the part's middle, from any point that is common to all.
  void add(const Splat& splat, const glm::dvec3& offset, std::span<const SplatScalar> values);
  void correct(std::span<SplatScalar> merged) const;

 private:
  struct Sums {
    double along = 0;
    glm::dvec3 gradient{0.0};
  };
  double weight_ = 0;
  glm::dvec3 middle_{0.0};
  std::vector<Sums> sums_;
};

/// How coincident halves of unlike thickness are treated.
enum class UnlikeHalves {
  kApart,         // they stay two splats; directions are compared by JointFrames::kRows
  kApartInCells,  // the same, but compared by JointFrames::kCells
  kMerged,        // they become one splat, as in caches of version 1; compared by JointFrames::kCells
};

/// The frames in which directions are compared.
inline JointFrames framesOf(UnlikeHalves unlike) {
  return unlike == UnlikeHalves::kApart ? JointFrames::kRows : JointFrames::kCells;
}

/// Halves are unlike if one is more than this many times as thick as the other.
inline constexpr double kMaxJointRatio = 2.5;
/// This limit holds where grid lines have a kink at the joint: one splat of two such halves bulges out of both.
inline constexpr double kMaxKinkedRatio = 1.3;

/// A splat with its values.
struct SplatWithValues {
  NodeSplat splat;
  std::vector<SplatScalar> values;
};

/// Splats and their values, in two arrays.
class SplatList {
 public:
  explicit SplatList(size_t variables) : variables_(variables) {}

  void add(const NodeSplat& splat, std::span<const SplatScalar> values) {
    splats_.push_back(splat);
    values_.insert(values_.end(), values.begin(), values.end());
  }
  /// Keeps its memory.
  void clear() {
    splats_.clear();
    values_.clear();
  }
  size_t size() const { return splats_.size(); }
  NodeSplat& splat(size_t n) { return splats_[n]; }
  std::span<const NodeSplat> splats() const { return splats_; }
  std::span<SplatScalar> values(size_t n) { return std::span(values_).subspan(n * variables_, variables_); }

 private:
  size_t variables_;
  std::vector<NodeSplat> splats_;
  std::vector<SplatScalar> values_;  // [splat][variable]
};

/// Some of the nodes at one point as one splat. Made once and used for many points, since its sums allocate.
class MergedParts {
 public:
  MergedParts(size_t variables, JointFrames frames)
      : frames_(frames), merger_(variables), bend_(variables), rows_(variables) {}

  /// Forgets the parts before, and begins with `first`. `sides`: the part's. `values` has one element a
  /// variable.
  void begin(const NodeSplat& first, std::span<const SplatScalar> values, std::span<const JointSide> sides);
  void add(const NodeSplat& part, std::span<const SplatScalar> values, std::span<const JointSide> sides);
  /// The merged splat. Its node (and node_position) is the lowest of the parts; regular is false unless there
  /// is only one, which comes out as it went in.
  SplatWithValues finish() const;
  /// The nodes in it, in the order of adding.
  const std::vector<uint64_t>& nodes() const { return nodes_; }

 private:
  std::vector<OpenBorders::Layer> layersOfLowest() const;

  JointFrames frames_;
  glm::dvec3 origin_{0.0};
  SplatWithValues lowest_;
  SplatMerger merger_;
  BendOfParts bend_;
  JoinedRows rows_;
  OpenBorders borders_;
  std::vector<JointSide> sides_;  // of the lowest
  std::vector<uint64_t> nodes_;
  std::vector<SplatScalar> values_of_half_;
};

/// Merges the nodes at one point after another.
class JointNodes {
 public:
  JointNodes(UnlikeHalves unlike, size_t variables)
      : variables_(variables), unlike_(unlike), parts_(variables), behind_(variables) {}

  /// A node at the point, or one of the layer behind a face there, which loses its border code if that face
  /// is closed. `wall_side`: of the node; halves of nodes on two sides of a thin wall stay apart.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values, uint32_t wall_side = 0);

  /// Gets a splat, and the nodes that it was merged from; a splat of the layer behind has no such nodes.
  using Sink =
      std::function<void(const NodeSplat&, std::span<const SplatScalar>, std::span<const uint64_t> nodes)>;
  /// Gives the merged splats to `sink`, then forgets the nodes.
  void finish(const Sink& sink);

  /// Whether two of the nodes are like halves, which finish() would make one splat.
  bool joinsHalves() const;
  /// The nodes at the point, without those of layers behind it; empty if there are many.
  std::vector<uint64_t> nodes() const;
  /// Forgets the nodes.
  void clear();

 private:
  void mergeAll();
  MergedParts& nextGroup();
  void mergeGroups(std::span<const size_t> group, std::span<const JointSide> sides);
  void finishSeveral(const Sink& sink);
  void finishBehind(std::span<const NodeSplat* const> parts, std::span<const JointSide> sides,
                    const Sink& sink);

  size_t variables_;
  UnlikeHalves unlike_;
  SplatList parts_;
  std::vector<uint32_t> wall_sides_;  // of the parts
  bool all_merged_ = false;           // in the first group, in place of parts_, if there are many
  std::vector<MergedParts> groups_;   // the first group_count_ of them are in use
  size_t group_count_ = 0;
  SplatList behind_;
  std::vector<NodeSplat> faces_;  // what the parts have become
};

}  // namespace curvisplat
