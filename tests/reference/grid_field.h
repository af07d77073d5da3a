// A real grid as a field: the cell that holds a point, and the scalar trilinear in the cell's own
// coordinates. In double precision, and by no formula that the splats use: the truth for grids that come
// from no analytic scene.
//
// A cell is the image of the unit cube under the trilinear map of its eight nodes; its faces are shared with
// its neighbours exactly, however bent. Cells with a blank node are not there, nor are those with a sample
// that is not finite. A scalar of cells is constant in each. Where blocks overlap, the first cell found
// counts.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "tests/reference/outer_faces.h"
#include "tests/reference/reference_field.h"

namespace curvisplat {

class GridField : public ReferenceField {
 public:
  /// Reads the whole grid, and the scalar at `scalar` of the source's description, into memory.
  GridField(const GridSource& source, uint32_t scalar);

  std::unique_ptr<FieldProbe> probe() const override;
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return {lower_, upper_}; }
  bool crossings(const glm::dvec3& origin, const glm::dvec3& direction,
                 std::vector<double>& distances) const override;
  /// Smallest and largest of the samples.
  std::pair<double, double> range() const { return range_; }

  struct Block {
    uint64_t ni = 0, nj = 0, nk = 0;
    NodeArrays nodes;
    size_t at(uint64_t i, uint64_t j, uint64_t k) const { return (k * nj + j) * ni + i; }
  };

  struct CellAddress {
    uint32_t block = 0;
    std::array<uint64_t, 3> index{};  // of its lowest node
  };

  /// A point in a cell's coordinates.
  struct InCell {
    CellAddress cell;
    glm::dvec3 uvw{0.5};
    glm::dmat3 jacobian{1.0};  // columns: the world per unit of u, v, w
  };

  enum class Search { kFound, kOutside, kFailed };
  /// Newton's method from at.uvw on in at.cell. Overwrites uvw and jacobian; `outside`: it converged, but out
  /// of the unit cube.
  Search findInCell(const glm::dvec3& world, InCell& at) const;
  /// Any cell that holds the point, by the tree of boxes.
  bool find(const glm::dvec3& world, InCell& at) const;
  /// Moves to the neighbour in the direction in which at.uvw lies outside. False at the block's end or where
  /// that cell is blank.
  bool stepTowards(InCell& at) const;
  double scalarAt(const InCell& at) const;

  bool ofCells() const { return of_cells_; }
  const std::vector<Block>& blocks() const { return blocks_; }
  /// Nodes of the cell's corners, u fastest.
  std::array<size_t, 8> cornersOf(const CellAddress& cell) const;
  bool isThere(const CellAddress& cell) const;

 private:
  // The cells of a block, halved along their longest side again and again; children follow one another.
  struct Box {
    glm::dvec3 lower{0.0}, upper{0.0};
    std::array<uint64_t, 3> begin{}, end{};  // of cells
    uint32_t block = 0;
    uint32_t skip = 0;  // the box after this one and all below it
    bool leaf = false;
  };

  void read(const GridSource& source, uint32_t scalar);
  void addOuterFaces(uint32_t block, std::vector<OuterFaces::Face>& faces) const;
  bool addBoxes(uint32_t block, const std::array<uint64_t, 3>& begin, const std::array<uint64_t, 3>& end);
  bool findFrom(const glm::dvec3& world, InCell& at) const;

  bool of_cells_ = false;
  std::vector<Block> blocks_;
  std::vector<Box> boxes_;
  OuterFaces outer_faces_;
  glm::dvec3 lower_{0.0}, upper_{0.0};
  std::pair<double, double> range_;
};

}  // namespace curvisplat
