// Moments of four cells at once are those of each cell, bit for bit.
#include "preprocess/moments/four_cells.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

namespace curvisplat {
namespace {

struct Shape {
  CellKind kind;
  std::vector<glm::dvec3> corners;
};

const std::vector<Shape>& shapes() {
  static const std::vector<Shape> all{
      {CellKind::kPyramid, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}}},
      {CellKind::kWedge, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
      {CellKind::kHexahedron,
       {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}}};
  return all;
}

/// Four distorted cells of a shape, with values.
class FourCells {
 public:
  FourCells(const Shape& shape, size_t fields, std::mt19937& random) : kind_(shape.kind), fields_(fields) {
    std::uniform_real_distribution<double> shift(-0.15, 0.15), value(-1, 1);
    for (size_t cell = 0; cell < kCellsAtOnce; ++cell) {
      const double size = std::exp(8 * value(random));
      const glm::dvec3 place(size * value(random), 100 * value(random), 1e-3 * value(random));
      for (const glm::dvec3& corner : shape.corners) {
        at_.push_back(place + size * (corner + glm::dvec3(shift(random), shift(random), shift(random))));
        for (size_t n = 0; n < fields; ++n) values_.push_back(static_cast<float>(1e3 * value(random)));
      }
    }
  }
  size_t corners() const { return at_.size() / kCellsAtOnce; }
  glm::dvec3& corner(size_t cell, size_t n) { return at_[cell * corners() + n]; }
  CellView view(size_t cell) const {
    return {kind_,
            std::span(at_).subspan(cell * corners(), corners()),
            std::span(values_).subspan(cell * corners() * fields_, corners() * fields_),
            {}};
  }
  std::array<CellView, kCellsAtOnce> views() const { return {view(0), view(1), view(2), view(3)}; }
  std::vector<double> oneByOne() const {
    const size_t size = corners() * momentCount(fields_);
    std::vector<double> moments(kCellsAtOnce * size);
    DualScratch scratch;
    for (size_t cell = 0; cell < kCellsAtOnce; ++cell)
      dualMoments(view(cell), fields_, scratch, std::span(moments).subspan(cell * size, size));
    return moments;
  }

 private:
  CellKind kind_;
  size_t fields_;
  std::vector<glm::dvec3> at_;
  std::vector<float> values_;
};

TEST(FourCells, HaveTheMomentsOfEachBitForBit) {
  std::mt19937 random(5);
  for (const Shape& shape : shapes()) {
    for (size_t fields = 0; fields <= 4; ++fields) {
      ASSERT_TRUE(isTakenAtOnce(shape.kind, fields));
      for (int n = 0; n < 200; ++n) {
        const FourCells cells(shape, fields, random);
        const std::vector<double> expected = cells.oneByOne();
        std::vector<double> found(expected.size(), -1);
        ASSERT_TRUE(dualMomentsOfFour(cells.views(), fields, found));
        ASSERT_EQ(std::memcmp(found.data(), expected.data(), found.size() * sizeof(double)), 0)
            << shape.corners.size() << " corners, " << fields << " fields";
      }
    }
  }
}

TEST(FourCells, HaveTheBodyOfEachBitForBit) {
  std::mt19937 random(7);
  for (const Shape& shape : shapes()) {
    for (int n = 0; n < 200; ++n) {
      FourCells cells(shape, 0, random);
      if (n % 10 == 0)  // a point: no volume
        for (size_t corner = 1; corner < cells.corners(); ++corner)
          cells.corner(2, corner) = cells.corner(2, 0);
      std::array<CellBody, kCellsAtOnce> found;
      setBodiesOfFour(cells.views(), found);
      for (size_t cell = 0; cell < kCellsAtOnce; ++cell) {
        const CellBody expected = bodyOf(cells.view(cell));
        ASSERT_EQ(std::memcmp(&found[cell], &expected, sizeof expected), 0)
            << shape.corners.size() << " corners";
      }
    }
  }
}

TEST(FourCells, WithAPieceWithoutVolumeAreLeftToOthers) {
  std::mt19937 random(6);
  for (const Shape& shape : shapes())
    for (size_t cell = 0; cell < kCellsAtOnce; ++cell) {
      FourCells cells(shape, 1, random);
      for (size_t n = 0; n < cells.corners(); ++n) cells.corner(cell, n).z = 0;
      std::vector<double> found(cells.oneByOne().size());
      EXPECT_FALSE(dualMomentsOfFour(cells.views(), 1, found));
    }
}

TEST(FourCells, AreNotTakenOfOtherShapesOrWithManyFields) {
  for (const CellKind kind : {CellKind::kNone, CellKind::kTetrahedron, CellKind::kPolyhedron})
    EXPECT_FALSE(isTakenAtOnce(kind, 1));
  EXPECT_FALSE(isTakenAtOnce(CellKind::kHexahedron, 5));
}

}  // namespace
}  // namespace curvisplat
