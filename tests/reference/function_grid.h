// Grids that are made of functions or of other grids, for tests that need odd ones: nodes that are what a
// function says (FunctionGridSource), scalars in the cells of any grid (CellGridSource), a block whose axes
// are swapped, mirrored or cut (RearrangedGridSource), and boxes that overlap a scene's block (oversetGrid).
// Any thread may read from any of them.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/scenes/scene.h"

namespace curvisplat {

/// A node's number in its block, and what the function answers.
struct GridNode {
  uint32_t block = 0;
  uint64_t i = 0, j = 0, k = 0;
};
struct NodeValues {
  glm::dvec3 position{0.0};
  std::vector<float> scalars;
  bool blank = false;
};

/// A grid of any blocks whose nodes are what a function says.
class FunctionGridSource : public GridSource {
 public:
  using Function = std::function<NodeValues(const GridNode&)>;

  /// Scalars are named "s0", "s1", ...
  FunctionGridSource(std::vector<GridBlock> blocks, size_t scalars, Function function,
                     Centring centring = Centring::kNode);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  GridDescription description_;
  Function function_;
};

GridBlock gridBlock(uint64_t ni, uint64_t nj, uint64_t nk);

/// A cell, by its lowest node.
struct GridCell {
  uint32_t block = 0;
  uint64_t i = 0, j = 0, k = 0;
  glm::dvec3 centre{0.0};  // the mean of its corners
};

/// The nodes of another source, which must outlive it, and its scalars; behind these, cell-centred scalars
/// "c0", "c1", ... of what a function says.
class CellGridSource : public GridSource {
 public:
  using Function = std::function<double(const GridCell&)>;

  CellGridSource(const GridSource& nodes, std::vector<Function> functions);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  const GridSource* nodes_;
  std::vector<Function> functions_;
  GridDescription description_;
};

/// Another way to describe a block: its axes swapped or mirrored, or cut into abutting blocks. What is drawn
/// must not change.
struct Rearrangement {
  std::array<int, 3> axes{0, 1, 2};       // i, j, k run along these axes of the original
  std::array<bool, 3> mirrored{};         // i, j, k run backwards
  std::array<uint64_t, 3> cuts{1, 1, 1};  // blocks along i, j, k; neighbours share a face of nodes
};

/// The first block of `source`, rearranged, with all its scalars, held in memory.
class RearrangedGridSource : public GridSource {
 public:
  RearrangedGridSource(const GridSource& source, const Rearrangement& how);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  GridDescription description_;
  Rearrangement how_;
  NodeArrays nodes_;
  std::array<uint64_t, 3> size_;                // of the original
  std::vector<std::array<uint64_t, 3>> first_;  // [block] along i, j, k
};

/// A box of even nodes, turned about its middle.
struct OversetBox {
  glm::dvec3 middle{0.0}, size{1.0};
  uint64_t nodes = 2;  // along each axis
  double turn = 0;     // about z, then about x
};

/// A scene's block of ni x nj x nk nodes, and boxes in it that overlap it and one another, with the same
/// field: one scalar "s0", the scene's.
FunctionGridSource oversetGrid(std::shared_ptr<const Scene> scene, const GridBlock& block,
                               const std::vector<OversetBox>& boxes, Centring centring = Centring::kNode);

/// One to five boxes in the half-annulus: they lie inside it, and from the second on overlap one another.
std::vector<OversetBox> boxesInHalfAnnulus(size_t count, uint64_t nodes);

}  // namespace curvisplat
