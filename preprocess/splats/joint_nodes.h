// The nodes of block faces that coincide at one point, and what becomes of them. Two halves give back the whole cell, which is
// stretched, and skewed, by what both blocks have there (joint_line.h); so are the splats one away from the face. Where one half is
// more than 2.5 times as thick as the other, they stay apart, each cut at the face between them: one splat for both would
// reach too far on the thin side and not far enough on the thick one.
//
//    block A      |  block B                          alike                     unlike
//    o     o     o|o     o     o                  o--[  o  ]--o              o----[o|o]-o-o
//                half cells                        one splat           two splats, cut at the face
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/splats/bend_of_parts.h"
#include "preprocess/splats/joint_sides.h"
#include "preprocess/splats/merge.h"
#include "preprocess/splats/node_splats.h"
#include "preprocess/splats/open_borders.h"

namespace curvisplat {

/// What is done with coincident halves of unlike thickness.
enum class UnlikeHalves {
  kApart,
  kMerged,  // caches of version 1
};

/// Halves are unlike if one is more than this many times as thick as the other.
inline constexpr double kMaxJointRatio = 2.5;
/// The same where grid lines have a kink at the joint: one splat of two such halves bulges out of both.
inline constexpr double kMaxKinkedRatio = 1.3;

/// A splat with its values.
struct SplatWithValues {
  NodeSplat splat;
  std::vector<SplatScalar> values;
};

/// Some of the nodes at one point as one splat.
class MergedParts {
 public:
  /// `sides`: those of a part.
  MergedParts(const NodeSplat& first, std::span<const SplatScalar> values, std::span<const JointSide> sides);
  void add(const NodeSplat& part, std::span<const SplatScalar> values, std::span<const JointSide> sides);
  /// Its node (and node_position) is the lowest of the parts; regular is false unless there is only one, which
  /// comes out as it went in.
  SplatWithValues finish() const;
  /// The nodes in it, in the order of adding.
  const std::vector<uint64_t>& nodes() const { return nodes_; }

 private:
  std::vector<OpenBorders::Layer> layersOfLowest() const;

  glm::dvec3 origin_;
  SplatWithValues lowest_;
  SplatMerger merger_;
  BendOfParts bend_;
  OpenBorders borders_;
  std::vector<JointSide> sides_;  // of the lowest
  std::vector<uint64_t> nodes_;
};

/// Not for several threads at once. The sums depend on the order of adding.
class JointNodes {
 public:
  explicit JointNodes(UnlikeHalves unlike) : unlike_(unlike) {}

  /// A node at the point, or one of the layer behind a face there, which loses its border code if that face is closed.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values);

  /// Gets a splat and the nodes that it is merged of; none of the layer behind.
  using Sink =
      std::function<void(const NodeSplat&, std::span<const SplatScalar>, std::span<const uint64_t> nodes)>;
  void finish(const Sink& sink);

 private:
  void mergeAll();
  std::vector<MergedParts> groups(std::span<const size_t> group, std::span<const JointSide> sides) const;

  UnlikeHalves unlike_;
  std::vector<SplatWithValues> parts_;
  std::optional<MergedParts> merged_;  // in place of parts_, if there are many
  std::vector<SplatWithValues> behind_;
};

}  // namespace curvisplat
