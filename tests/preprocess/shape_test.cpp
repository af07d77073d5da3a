#include "preprocess/shape/shape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <random>

#include "tests/reference/mapped_block.h"

namespace curvisplat {
namespace {

glm::dmat3 diagonal(double a, double b, double c) {
  return {a, 0, 0, 0, b, 0, 0, 0, c};
}

Splat splatOf(const CellShape& shape) {
  Splat splat;
  splat.axis = shape.axis;
  splat.shear = shape.shear;
  return splat;
}

double largestEntry(const glm::dmat3& m) {
  double largest = 0;
  for (int n = 0; n < 9; ++n) largest = std::max(largest, std::abs(m[n / 3][n % 3]));
  return largest;
}

/// ‖A⁻¹ J (A⁻¹ J)ᵀ - I‖, in long double: how far A Aᵀ is from J Jᵀ in the ellipsoid's own measure.
double shapeError(const Splat& splat, const glm::dmat3& jacobian) {
  long double m[3][3];
  for (int column = 0; column < 3; ++column) {
    const long double a10 = splat.axis[0] * splat.shear[0], a20 = splat.axis[0] * splat.shear[1];
    const long double a21 = splat.axis[1] * splat.shear[2];
    m[0][column] = jacobian[column].x / static_cast<long double>(splat.axis[0]);
    m[1][column] = (jacobian[column].y - a10 * m[0][column]) / splat.axis[1];
    m[2][column] = (jacobian[column].z - a20 * m[0][column] - a21 * m[1][column]) / splat.axis[2];
  }
  long double largest = 0;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      long double sum = r == c ? -1 : 0;
      for (int n = 0; n < 3; ++n) sum += m[r][n] * m[c][n];
      largest = std::max(largest, std::abs(sum));
    }
  return static_cast<double>(largest);
}

TEST(Shape, FactorsJacobiansOfEveryAspectRatioAndHandedness) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> exponent(-5, 0), symmetric(-1, 1);
  for (int n = 0; n < 2000; ++n) {
    const glm::dmat3 stretch = diagonal(std::pow(10, exponent(random)), std::pow(10, exponent(random)),
                                        std::pow(10, exponent(random)));
    const glm::dmat3 mirror = diagonal(1, 1, n % 2 == 0 ? 1 : -1);
    const glm::dmat3 jacobian = randomRotation(random) * stretch * randomRotation(random) * mirror;
    const CellShape shape = shapeFromJacobian(jacobian, 1);
    const Splat splat = splatOf(shape);
    ASSERT_FALSE(shape.floored);
    ASSERT_LT(shapeError(splat, jacobian), 1e-9);
    ASSERT_LT(largestEntry(splat.factor() * shape.rotation - jacobian), 1e-14);
    ASSERT_LT(largestEntry(shape.rotation * glm::transpose(shape.rotation) - glm::dmat3(1.0)), 1e-14);
    const double volume = stretch[0][0] * stretch[1][1] * stretch[2][2];
    ASSERT_NEAR(shape.determinant / volume, n % 2 == 0 ? 1 : -1, 1e-9);
    ASSERT_NEAR(shape.axis[0] * shape.axis[1] * shape.axis[2] / volume, 1, 1e-9);
  }
}

TEST(Shape, RaisesSingularAxesToTheFloorAndNoOthers) {
  std::mt19937_64 random(2);
  for (const auto& [thin, expected] :
       {std::pair{1e-5, 1e-5}, {1.1e-6, 1.1e-6}, {9e-7, 1e-6}, {1e-9, 1e-6}, {0.0, 1e-6}}) {
    for (int n = 0; n < 100; ++n) {
      const glm::dmat3 jacobian = randomRotation(random) * diagonal(2, thin * 2, 1) * randomRotation(random);
      const CellShape shape = shapeFromJacobian(jacobian, 1);
      EXPECT_EQ(shape.floored, thin < 1e-6);
      const auto sigma = singularValues(splatOf(shape).factor());
      EXPECT_NEAR(sigma[0], 2, 1e-9);
      EXPECT_NEAR(sigma[1], 1, 1e-9);
      EXPECT_NEAR(sigma[2] / (2 * expected), 1, 1e-8);
      EXPECT_NEAR(std::abs(shape.determinant), 4 * thin, 1e-9 * 4 * thin + 1e-14);
    }
  }
}

TEST(Shape, OfSingularJacobiansKeepsTheCellsExtentAndHasNoVolume) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int rank = 0; rank <= 2; ++rank) {
    for (int n = 0; n < 300; ++n) {
      glm::dmat3 jacobian(0.0);
      for (int column = 0; column < rank; ++column)
        jacobian[(column + n) % 3] = glm::dvec3(normal(random), normal(random), normal(random));
      // The columns left: zero, or a mixture of the others, of which rounding is all that stands out.
      for (int column = rank; column < 3 && n % 2 == 0; ++column)
        jacobian[(column + n) % 3] =
            normal(random) * jacobian[n % 3] + normal(random) * jacobian[(n + 1) % 3];
      const CellShape shape = shapeFromJacobian(jacobian, 1e-3);
      const Splat splat = splatOf(shape);
      const double size = singularValues(jacobian)[0];
      EXPECT_TRUE(shape.floored);
      EXPECT_EQ(shape.determinant, 0);
      EXPECT_LT(largestEntry(shape.rotation * glm::transpose(shape.rotation) - glm::dmat3(1.0)), 1e-14);
      if (rank == 0) {
        EXPECT_EQ(splat.axis, (std::array{1e-3, 1e-3, 1e-3}));
        continue;
      }
      // A Q differs from J by the floor alone.
      EXPECT_LE(singularValues(splat.factor() * shape.rotation - jacobian)[0], 1.0001 * kAxisFloor * size);
      EXPECT_NEAR(singularValues(splat.factor())[2], kAxisFloor * size,
                  1e-9 * kAxisFloor * size + 1e-15 * size);
    }
  }
}

TEST(Shape, OfCoincidentColumns) {
  const glm::dvec3 column(1, 2, 3);
  const CellShape shape = shapeFromJacobian({column, column, -column}, 1);
  EXPECT_TRUE(shape.floored);
  EXPECT_EQ(shape.determinant, 0);
  const auto sigma = singularValues(splatOf(shape).factor());
  EXPECT_NEAR(sigma[0], std::sqrt(42), 1e-12);
  EXPECT_NEAR(sigma[1] / (kAxisFloor * sigma[0]), 1, 1e-8);
  EXPECT_NEAR(sigma[2] / (kAxisFloor * sigma[0]), 1, 1e-8);
}

TEST(Shape, HasNoScaleOfItsOwn) {
  for (const double scale : {1e-90, 1e-60, 1e60, 1e90}) {
    const glm::dmat3 unit(1, 2, 3, 0, 1e-4, 0, 1, 0, -1);
    const CellShape at_one = shapeFromJacobian(unit, 1), scaled = shapeFromJacobian(scale * unit, 1);
    EXPECT_FALSE(scaled.floored);
    for (int n = 0; n < 3; ++n) {
      EXPECT_NEAR(scaled.axis[n] / scale / at_one.axis[n], 1, 1e-12);
      EXPECT_NEAR(scaled.shear[n], at_one.shear[n], 1e-11 * std::abs(at_one.shear[n]));
    }
  }
}

TEST(SetShape, FindsTheFactorAgain) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> exponent(-4, 0);
  for (int n = 0; n < 2000; ++n) {
    const glm::dmat3 jacobian =
        randomRotation(random) * diagonal(std::pow(10, exponent(random)), std::pow(10, exponent(random)),
                                          std::pow(10, exponent(random)));
    const Splat in = splatOf(shapeFromJacobian(jacobian, 1));
    Splat out;
    setShape(out, shapeMatrix(in), 1);
    ASSERT_LT(shapeError(out, jacobian), 1e-6);  // S has lost half the digits: 1e-16 (1e4)²
  }
}

TEST(SetShape, RaisesSingularAxes) {
  std::mt19937_64 random(5);
  for (int rank = 0; rank <= 2; ++rank) {
    for (int n = 0; n < 300; ++n) {
      const glm::dmat3 turn = randomRotation(random);
      const glm::dmat3 s = turn * diagonal(rank > 0 ? 9 : 0, rank > 1 ? 4 : 0, 0) * glm::transpose(turn);
      Splat splat;
      setShape(splat, {s[0][0], s[0][1], s[1][1], s[0][2], s[1][2], s[2][2]}, 0.25);
      const auto sigma = singularValues(splat.factor());
      if (rank == 0) {
        EXPECT_EQ(splat.axis, (std::array{0.25, 0.25, 0.25}));
        continue;
      }
      EXPECT_NEAR(sigma[0], 3, 1e-9);
      EXPECT_NEAR(sigma[1], rank > 1 ? 2 : 3e-6, 1e-9);
      EXPECT_NEAR(sigma[2], 3e-6, 1e-9);
    }
  }
}

TEST(RaisedTo, RaisesWhatIsBelowAndNothingElse) {
  std::mt19937_64 random(9);
  const glm::dmat3 turn = randomRotation(random);
  const auto turned = [&](double a, double b, double c) {
    const glm::dmat3 m = turn * glm::dmat3(a, 0, 0, 0, b, 0, 0, 0, c) * glm::transpose(turn);
    return Symmetric3{m[0][0], m[1][0], m[1][1], m[2][0], m[2][1], m[2][2]};
  };
  const auto expect = [](const Symmetric3& found, const Symmetric3& wanted) {
    EXPECT_NEAR(found.xx, wanted.xx, 1e-14);
    EXPECT_NEAR(found.xy, wanted.xy, 1e-14);
    EXPECT_NEAR(found.yy, wanted.yy, 1e-14);
    EXPECT_NEAR(found.xz, wanted.xz, 1e-14);
    EXPECT_NEAR(found.yz, wanted.yz, 1e-14);
    EXPECT_NEAR(found.zz, wanted.zz, 1e-14);
  };
  const Symmetric3 unit{1, 0, 1, 0, 0, 1};
  expect(raisedTo(turned(0.3, 0.2, 0.1), 1), unit);  // a trace below
  expect(raisedTo(turned(0.6, 0.5, 0.4), 1), unit);  // a norm below
  expect(raisedTo(turned(0.9, 0.8, 0.7), 1), unit);  // eigenvalues below
  expect(raisedTo(turned(1.1, 0.1, 0.1), 1), turned(1.1, 1, 1));
  expect(raisedTo(turned(3, 2, 0.1), 1), turned(3, 2, 1));
}

TEST(SingularValues, KeepTheDigitsOfThinColumns) {
  std::mt19937_64 random(6);
  const glm::dmat3 m = randomRotation(random) * diagonal(1, 1e-7, 1e-12);
  const auto sigma = singularValues(m);
  EXPECT_NEAR(sigma[0], 1, 1e-14);
  EXPECT_NEAR(sigma[1] / 1e-7, 1, 1e-13);
  EXPECT_NEAR(sigma[2] / 1e-12, 1, 1e-13);
  EXPECT_EQ(singularValues(diagonal(-2, 0, 3)), (std::array{3.0, 2.0, 0.0}));
}

}  // namespace
}  // namespace curvisplat
