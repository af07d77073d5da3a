// The nodes of a structured grid and their values, found again from the splats of a cache's leaves. Isosurfaces are contoured in the
// cells between them (cell_contour.h).
//
// A leaf says which node each splat stands for. The splat sits in the middle of the node's cell, and its mean is the scalar's there, with
// a correction for the scalar's bend (preprocess/splats/node_splats.h). Both are undone: a half cell reaches from its middle to its node
// by half its length, from the border's code; an inner one by what the positions of the neighbours say; the value follows by the splat's
// slope, and the correction by a few steps of a fixed point. What is left is second order: where the place is a part of a cell off, the
// value is the one there.
//
// Blanked nodes are those that neither have a splat nor share one. Beside them cells are half ones, as at borders, and lack octants in
// cells with a blanked corner: a splat sits in the middle of what is left. So leaves of such grids are read twice: first for what is
// blanked.
//
// All nodes of the grid are kept, block by block, i fastest: 16 bytes a node, with a second scalar 20, with blanked ones one more; 12 more
// while they are made, and with blanked ones 48 more for each of the largest block. One thread makes them, from leaves that it reads one
// after the other; immutable then.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/surface/joined_nodes.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class GridNodes {
 public:
  /// The most nodes of a grid: with IsoMeshes::kMaxTriangles they take about what the field of splats gets of 96 MiB. Not a share of
  /// --memory, since pictures do not depend on that.
  static constexpr uint64_t kMaxNodes = uint64_t{1} << 19;

  /// Whether the cache may have a splat of each of its grid's nodes that are not blanked: of a structured grid whose values are at its
  /// nodes, and of which no block covers another. From the manifest alone.
  static bool canBeOf(const Manifest& manifest);
  /// The bytes that they take while they are made, without the leaf that is being read; and those that are kept.
  struct Bytes {
    uint64_t while_made, kept;
    uint64_t of_gradients;  // while isosurfaces are made of them (NodeGradients)
  };
  static Bytes bytes(const Manifest& manifest, bool two_scalars);

  /// Reads all leaves. `other`: a second variable, or none. `throw_if_stopped` is called between leaves and faces
  /// of blocks. Throws as CacheReader::readGeometry() does, and DamagedBrick if leaves have nodes outside of the
  /// grid; with `keep_going` damaged() has them.
  GridNodes(const CacheReader& cache, size_t variable, std::optional<size_t> other, bool keep_going,
            const std::function<void()>& throw_if_stopped);

  /// Whether they were found. Not where nodes share a splat and it could not be told which, or where leaves are damaged.
  bool areComplete() const { return complete_; }
  /// The damaged leaves, with one line each that says why.
  const std::map<uint32_t, std::string>& damaged() const { return damaged_; }
  using Block = NodeLattice3;
  const std::vector<Block>& blocks() const { return blocks_; }
  size_t size() const { return value_.size(); }
  /// The point that positions count from, in the data's coordinates.
  const glm::dvec3& origin() const { return origin_; }
  glm::vec3 position(size_t node) const { return {x_[node], y_[node], z_[node]}; }
  float value(size_t node) const { return value_[node]; }
  bool hasBlanks() const { return !marks_.empty(); }
  /// Whether a node is not there. Its place and value mean nothing.
  bool isBlank(size_t node) const { return hasBlanks() && (marks_[node] & kBlank) != 0; }
  /// The nodes beside one along an axis; its own number where there is none, or a blanked one.
  struct Neighbours {
    size_t before, after;
    bool hasBefore(size_t node) const { return before != node; }
    bool hasAfter(size_t node) const { return after != node; }
    bool areBoth(size_t node) const { return hasBefore(node) && hasAfter(node); }
  };
  using OfAxes = std::array<Neighbours, 3>;
  OfAxes neighbours(const Block& block, size_t node) const;
  /// The nodes that have the place and the values of another one, in their order.
  std::span<const JoinedNode> joined() const { return joined_; }
  bool hasOther() const { return !other_.empty(); }
  float other(size_t node) const { return other_[node]; }

 private:
  struct Slopes {
    std::vector<float> x, y, z;
    void resize(size_t count);
  };
  static constexpr uint8_t kBlank = 1, kShared = 2;  // marks of nodes: not there; at a place of several

  using Stop = std::function<void()>;
  void read(const CacheReader& cache, size_t variable, const Stop& throw_if_stopped);
  void readLeaves(const CacheReader& cache, size_t variable, const Stop& throw_if_stopped);
  void addLeaf(const CacheReader& cache, uint32_t brick, const SplatGeometry& geometry,
               const SplatVariable& values, const std::vector<NodeRun>& runs);
  bool join(const Manifest& manifest, const Stop& throw_if_stopped);
  void copyToJoined();
  void markBlanks();
  using Index = std::array<uint64_t, 3>;
  OfAxes neighbours(const Block& block, size_t node, const Index& index) const;
  std::optional<glm::dvec3> middleOfPart(const Block& block, size_t node) const;
  template <typename Use>
  void forNodes(const Block& block, const Use& use) const;
  void completeParts(const Block& block);
  void moveToNodes(const Block& block);
  void unbend(const Block& block, float least, float most);

  const glm::dvec3 origin_;
  std::vector<Block> blocks_;
  std::vector<JoinedNode> joined_;
  std::vector<uint8_t> marks_;  // [node]; empty if none is blanked
  const bool has_parts_;        // cells lack octants beside blanked nodes (kCellOctants)
  bool complete_ = true;
  const bool keep_going_;
  std::map<uint32_t, std::string> damaged_;
  std::vector<float> x_, y_, z_, value_, other_;
  Slopes slopes_;  // of the scalar in space; while nodes are made
};

}  // namespace curvisplat
