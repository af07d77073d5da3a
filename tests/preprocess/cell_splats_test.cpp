#include "preprocess/splats/cell_splats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <random>
#include <vector>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/shape/shape.h"
#include "stream/model/border_code.h"
#include "tests/reference/mapped_block.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/with_corrections.h"

namespace curvisplat {
namespace {

/// A block whose scalars stand in cells: a function of the cell's centre.
struct CellBlock : MappedBlock {
  using MappedBlock::MappedBlock;

  glm::dvec3 centre(uint64_t i, uint64_t j, uint64_t k) const {
    glm::dvec3 sum(0.0);
    for (size_t corner = 0; corner < 8; ++corner) {
      const size_t n = at(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2));
      sum += glm::dvec3(nodes.x[n], nodes.y[n], nodes.z[n]);
    }
    return sum / 8.0;
  }

  void addCellScalar(const std::function<double(const glm::dvec3&)>& f) {
    auto& values = nodes.scalars.emplace_back(block.nodes(), NAN);
    for (uint64_t k = 0; k + 1 < block.nk; ++k)
      for (uint64_t j = 0; j + 1 < block.nj; ++j)
        for (uint64_t i = 0; i + 1 < block.ni; ++i)
          values[at(i, j, k)] = static_cast<float>(f(centre(i, j, k)));
  }

  /// Marks nodes without values as a NodeReader does.
  void mark() {
    for (size_t n = 0; n < block.nodes(); ++n)
      for (const auto& values : nodes.scalars) nodes.blank[n] |= std::isnan(values[n]) ? kNoValue : 0;
  }

  NodeSplats cellSplats(const BlockEnds& ends = {}, const SplatCorrections& corrections = {},
                        const SplatRules& rules = {}) {
    const WithCorrections scope({corrections, {}, {}});
    mark();
    NodeSplats out;
    CellScratch scratch;
    computeCellSplats(window(), {0, block.nj, 0, block.nk}, ends, scratch, out, rules);
    return out;
  }
};

glm::dvec3 annulusPoint(double u, double v, double w) {
  const double theta = M_PI * u, r = 0.3 + 0.7 * std::expm1(2.5 * v) / std::expm1(2.5);
  return {-r * std::sin(theta), r * std::cos(theta), w + 0.15 * r * std::sin(3 * theta)};
}

const NodeSplat* splatAtNode(const NodeSplats& splats, uint64_t node) {
  for (const NodeSplat& splat : splats.splats)
    if (splat.node == node) return &splat;
  return nullptr;
}

/// The trilinear map's Jacobian, integrated by two Gauss points an axis: exact.
double integratedVolume(const std::array<glm::dvec3, 8>& corner) {
  double volume = 0;
  for (int point = 0; point < 8; ++point) {
    std::array<double, 3> u;
    for (int axis = 0; axis < 3; ++axis) u[axis] = 0.5 + (point >> axis & 1 ? 0.5 : -0.5) / std::sqrt(3.0);
    glm::dmat3 jacobian(0.0);
    for (int c = 0; c < 8; ++c)
      for (int axis = 0; axis < 3; ++axis) {
        double derivative = c >> axis & 1 ? 1 : -1;
        for (int other = 0; other < 3; ++other)
          if (other != axis) derivative *= c >> other & 1 ? u[other] : 1 - u[other];
        jacobian[axis] += derivative * corner[static_cast<size_t>(c)];
      }
    volume += glm::determinant(jacobian) / 8;
  }
  return volume;
}

TEST(Hexahedron, HasTheVolumeOfItsTrilinearMap) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 50; ++n) {
    std::array<glm::dvec3, 8> corner;
    for (glm::dvec3& c : corner) c = {normal(random), normal(random), normal(random)};
    EXPECT_NEAR(Hexahedron(corner).volume(), integratedVolume(corner), 1e-12);
  }
}

TEST(CellSplats, OfAnAffineGridAreItsCells) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 20; ++n) {
    glm::dmat3 jacobian(1.0);
    for (int column = 0; column < 3 && n > 0; ++column)
      jacobian[column] = glm::dvec3(normal(random), normal(random), normal(random));
    CellBlock grid(5, 4, 6, [&](double i, double j, double k) { return jacobian * glm::dvec3(i, j, k); });
    grid.addCellScalar([](const glm::dvec3& p) { return p.x; });
    const NodeSplats out = grid.cellSplats();
    ASSERT_EQ(out.splats.size(), 4u * 3 * 5);
    const double determinant = glm::determinant(jacobian);
    EXPECT_NEAR(totalWeight(out) / std::abs(60 * determinant), 1, 1e-9);
    EXPECT_EQ(out.right_handed, determinant > 0 ? 60u : 0u);
    EXPECT_EQ(out.left_handed, determinant > 0 ? 0u : 60u);
    EXPECT_EQ(out.degenerate, 0u);
    // One at the block's end is a whole cell as well.
    for (const uint64_t i : {1u, 3u}) {
      const NodeSplat* cell = splatAtNode(out, grid.at(i, 2, 4));
      ASSERT_NE(cell, nullptr);
      EXPECT_TRUE(cell->regular);
      EXPECT_FALSE(cell->on_block_face);
      EXPECT_LT(glm::distance(cell->splat.position, jacobian * glm::dvec3(i + 0.5, 2.5, 4.5)), 1e-12);
      const glm::dmat3 a = cell->splat.factor();
      const glm::dmat3 difference = a * glm::transpose(a) - jacobian * glm::transpose(jacobian);
      for (int column = 0; column < 3; ++column) EXPECT_LT(glm::length(difference[column]), 1e-11);
    }
  }
}

TEST(CellSplats, EndAtBordersButNotWhereBlocksAbut) {
  const glm::dmat3 jacobian(2, 0.3, 0, -0.4, 1, 0.2, 0.1, 0, 3);
  CellBlock grid(4, 4, 4, [&](double i, double j, double k) { return jacobian * glm::dvec3(i, j, k); });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x; });
  grid.nodes.scalars[0][grid.at(1, 1, 1)] = NAN;  // the cell in the middle
  // Beyond the upper end of i there is another block.
  GridBlock other = grid.block;
  other.ni = 2;
  const TemporaryFolder folder;
  AbuttingFaces faces(std::vector{grid.block, other}, 8, 1 << 20, folder.path());
  for (uint64_t k = 0; k < 3; ++k)
    for (uint64_t j = 0; j < 3; ++j)
      for (const size_t block : {0u, 1u}) {
        std::array<glm::dvec3, 8> corners;
        for (size_t c = 0; c < 8; ++c)
          corners[c] = jacobian * glm::dvec3((block == 0 ? 2 : 3) + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
        const auto centre = faces.centreOf({block, {block == 0 ? 2u : 0u, j, k}, 0, block == 0}, corners);
        faces.add({&centre, 1});
      }
  faces.match(Progress());

  const NodeSplats out = grid.cellSplats({0, &faces});
  ASSERT_EQ(out.splats.size(), 26u);
  for (const NodeSplat& splat : out.splats) {
    const uint64_t i = splat.node % 4, j = splat.node / 4 % 4, k = splat.node / 16;
    std::vector<glm::dvec3> expected;  // inwards
    const auto beside = [](uint64_t a, uint64_t b, uint64_t c) { return a != 1 && b == 1 && c == 1; };
    if (i == 0) expected.push_back(jacobian[0]);
    if (beside(i, j, k) && i == 2) expected.push_back(jacobian[0]);
    if (beside(i, j, k) && i == 0) expected.pop_back();  // it ends on both sides
    if (j != 1 && !beside(j, i, k)) expected.push_back(j == 0 ? jacobian[1] : -jacobian[1]);
    if (k != 1 && !beside(k, i, j)) expected.push_back(k == 0 ? jacobian[2] : -jacobian[2]);
    const InwardAxes found = inwardAxes(splat.border_code);
    ASSERT_EQ(found.count, static_cast<int>(expected.size())) << i << j << k;
    for (int n = 0; n < found.count; ++n)
      EXPECT_LT(glm::distance(splat.splat.factor() * glm::dvec3(found.axis[static_cast<size_t>(n)]),
                              expected[static_cast<size_t>(n)]),
                0.03 * glm::length(expected[static_cast<size_t>(n)]))
          << i << j << k;
  }
  for (const NodeSplat& splat : grid.cellSplats().splats) EXPECT_EQ(splat.border_code, kNoBorder);
}

TEST(CellSplats, OfOneLayerEndAtBothOfItsFaces) {
  // Two-dimensional cases are one cell thick. A code has one face an axis: each half of a cell has its own.
  const glm::dmat3 jacobian(2, 0.3, 0, -0.4, 1, 0.2, 0.1, 0, 3);
  CellBlock grid(5, 4, 2, [&](double i, double j, double k) { return jacobian * glm::dvec3(i, j, k); });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x; });
  const TemporaryFolder folder;
  AbuttingFaces faces(std::vector{grid.block}, 8, 1 << 20, folder.path());
  faces.match(Progress());
  const NodeSplats out = grid.cellSplats({0, &faces});
  ASSERT_EQ(out.splats.size(), 2u * 4 * 3);
  EXPECT_NEAR(totalWeight(out) / (12 * glm::determinant(jacobian)), 1, 1e-9);
  for (const uint64_t half : {0u, 1u}) {
    const NodeSplat* splat = splatAtNode(out, grid.at(1, 1, half));
    ASSERT_NE(splat, nullptr);
    EXPECT_LT(glm::distance(splat->splat.position, jacobian * glm::dvec3(1.5, 1.5, half == 0 ? 0.25 : 0.75)),
              1e-12);
    const InwardAxes inward = inwardAxes(splat->border_code);
    ASSERT_EQ(inward.count, 1);
    EXPECT_TRUE(inward.hasFace(0));
    const glm::dvec3 along = splat->splat.factor() * glm::dvec3(inward.axis[0]);
    EXPECT_LT(glm::distance(along, (half == 0 ? 0.5 : -0.5) * jacobian[2]), 0.02);
  }
  SplatRules older;
  older.dual_cells = false;
  EXPECT_EQ(grid.cellSplats({0, &faces}, {}, older).splats.size(), 4u * 3);
}

TEST(CellSplats, OfAnyGridSumToItsHexahedra) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> off(-0.2, 0.2);
  CellBlock grid(6, 7, 5, [&](double i, double j, double k) {
    return annulusPoint(i / 5, j / 6, k / 4) + 0.05 * glm::dvec3(off(random), off(random), off(random));
  });
  grid.addCellScalar([](const glm::dvec3&) { return 1; });
  double volume = 0;
  for (uint64_t k = 0; k < 4; ++k)
    for (uint64_t j = 0; j < 6; ++j)
      for (uint64_t i = 0; i < 5; ++i)
        volume += std::abs(
            integratedVolume(cornersAt(grid.nodes.x.data(), grid.nodes.y.data(), grid.nodes.z.data(),
                                       grid.at(i, j, k), grid.block.ni, grid.block.ni * grid.block.nj)));
  EXPECT_NEAR(totalWeight(grid.cellSplats()), volume, 1e-12 * volume);
  // The density of a constant field is the same in every cell, but for what the neighbours' sizes do to it.
  SplatCorrections corrections;
  corrections.stretch = false;
  const NodeSplats out = grid.cellSplats({}, corrections);
  EXPECT_NEAR(totalWeight(out), volume, 1e-12 * volume);
  for (const NodeSplat& cell : out.splats) {
    const auto& axis = cell.splat.axis;
    EXPECT_TRUE(cell.regular);
    EXPECT_NEAR(cell.splat.weight / (axis[0] * axis[1] * axis[2]), 1, 1e-12);
  }
}

TEST(CellSplats, OfALinearFieldCarryItExactly) {
  // On any grid, at its ends and beside blanked cells: the slope is Aᵀ∇f, whatever the neighbours' distances.
  const glm::dvec3 gradient(0.5, -2, 0.25);
  CellBlock grid(12, 7, 9, [](double i, double j, double k) { return annulusPoint(i / 11, j / 6, k / 8); });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x; });
  grid.addCellScalar([&](const glm::dvec3& p) { return 1.5 + glm::dot(gradient, p); });
  grid.nodes.scalars[1][grid.at(4, 3, 3)] = NAN;
  const NodeSplats out = grid.cellSplats();
  ASSERT_EQ(out.splats.size(), 11u * 6 * 8 - 1);
  ASSERT_EQ(out.values.size(), 2 * out.splats.size());
  for (size_t n = 0; n < out.splats.size(); ++n) {
    const Splat& splat = out.splats[n].splat;
    const SplatScalar& value = out.values[2 * n + 1];
    EXPECT_NEAR(value.mean, 1.5 + glm::dot(gradient, splat.position), 1e-6);
    EXPECT_LT(glm::distance(value.slope, glm::transpose(splat.factor()) * gradient), 2e-5);
    EXPECT_EQ(value.variance, 0);
    EXPECT_NEAR(out.values[2 * n].mean, splat.position.x, 1e-6);
  }
}

TEST(CellSplats, AreNotThereWithoutACornerOrAValue) {
  CellBlock grid(7, 7, 7, [](double i, double j, double k) { return glm::dvec3(i, j, k); });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x * p.x; });
  grid.nodes.blank[grid.at(3, 3, 3)] = kNoNode;
  grid.nodes.x[grid.at(3, 3, 3)] = NAN;
  grid.nodes.blank[grid.at(0, 0, 5)] = kBlankValue;
  const NodeSplats out = grid.cellSplats();
  ASSERT_EQ(out.splats.size(), 216u - 8 - 1);
  EXPECT_TRUE(allFinite(out));
  EXPECT_NEAR(totalWeight(out), 207, 1e-12);
  for (const uint64_t i : {2u, 3u}) EXPECT_EQ(splatAtNode(out, grid.at(i, 2, 3)), nullptr);
  EXPECT_EQ(splatAtNode(out, grid.at(0, 0, 5)), nullptr);
  // Its neighbour after is gone: (1.5² - 0.5²) / 1.
  const NodeSplat* beside = splatAtNode(out, grid.at(1, 2, 3));
  ASSERT_NE(beside, nullptr);
  EXPECT_NEAR(out.values[static_cast<size_t>(beside - out.splats.data())].slope.x, 2, 1e-6);
}

TEST(CellSplats, OfWindowsAreThoseOfTheWhole) {
  CellBlock grid(6, 8, 9, [](double i, double j, double k) { return annulusPoint(i / 5, j / 7, k / 8); });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x * p.y + p.z; });
  grid.nodes.blank[grid.at(2, 4, 4)] = kNoNode;
  const TemporaryFolder folder;
  AbuttingFaces faces({&grid.block, 1}, 8, 1 << 20, folder.path());
  faces.match(Progress());
  const BlockEnds ends{0, &faces};
  const NodeSplats whole = grid.cellSplats(ends);
  size_t n = 0, borders = 0;
  for (uint64_t k = 0; k < 9; ++k)
    for (uint64_t j = 0; j < 8; j += 3) {
      const NodeBox box{j, std::min<uint64_t>(j + 3, 8), k, k + 1};
      const NodeBox window{box.j0 - std::min(box.j0, kCellSplatHalo.before),
                           std::min<uint64_t>(box.j1 + kCellSplatHalo.after, 8),
                           k - std::min(k, kCellSplatHalo.before),
                           std::min<uint64_t>(k + 1 + kCellSplatHalo.after, 9)};
      NodeArrays nodes;
      nodes.scalars.resize(1);
      for (uint64_t kk = window.k0; kk < window.k1; ++kk)
        for (uint64_t jj = window.j0; jj < window.j1; ++jj)
          for (uint64_t i = 0; i < 6; ++i) {
            const size_t at = grid.at(i, jj, kk);
            nodes.x.push_back(grid.nodes.x[at]);
            nodes.y.push_back(grid.nodes.y[at]);
            nodes.z.push_back(grid.nodes.z[at]);
            nodes.blank.push_back(grid.nodes.blank[at]);
            nodes.scalars[0].push_back(grid.nodes.scalars[0][at]);
          }
      NodeSplats part;
      CellScratch scratch;
      computeCellSplats({grid.block, 0, window, &nodes}, box, ends, scratch, part);
      for (size_t m = 0; m < part.splats.size(); ++m) {
        size_t same = 0;
        while (same < whole.splats.size() && whole.splats[same].node != part.splats[m].node) ++same;
        ASSERT_LT(same, whole.splats.size());
        EXPECT_EQ(part.splats[m].splat.position, whole.splats[same].splat.position);
        EXPECT_EQ(part.splats[m].splat.axis, whole.splats[same].splat.axis);
        EXPECT_EQ(part.splats[m].splat.weight, whole.splats[same].splat.weight);
        EXPECT_EQ(part.splats[m].border_code, whole.splats[same].border_code);
        EXPECT_EQ(part.values[m].slope, whole.values[same].slope);
        borders += part.splats[m].border_code != kNoBorder;
      }
      n += part.splats.size();
    }
  EXPECT_EQ(n, whole.splats.size());
  EXPECT_GT(borders, 5u * 7 * 8 - 3 * 5 * 6);
}

TEST(CellSplats, OfPartsOfRowsAreThoseOfTheWhole) {
  CellBlock grid(18, 5, 6, [](double i, double j, double k) {
    return annulusPoint((i + 0.2 * std::sin(2 * i)) / 17, j / 4, k / 5);
  });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x * p.y + p.z; });
  grid.nodes.blank[grid.at(9, 2, 3)] = kNoNode;
  const NodeSplats whole = grid.cellSplats({});
  NodeSplats part;
  CellScratch scratch;
  for (const uint64_t nodes : {1u, 2u, 5u, 17u}) {
    size_t seen = 0;
    for (uint64_t i0 = 0; i0 < 18; i0 += nodes) {
      BlockWindow window = grid.window();
      window.i0 = i0;
      window.i1 = i0 + nodes;
      NodeArrays cut;
      if (i0 / nodes % 2 == 0) {
        window = cutWindow(grid.window(), i0, i0 + nodes, kCellSplatHalo, cut);
      }
      computeCellSplats(window, {0, 5, 0, 6}, {}, scratch, part);
      for (size_t n = 0; n < part.splats.size(); ++n, ++seen) {
        size_t same = 0;
        while (same < whole.splats.size() && whole.splats[same].node != part.splats[n].node) ++same;
        ASSERT_LT(same, whole.splats.size());
        EXPECT_EQ(part.splats[n].splat.position, whole.splats[same].splat.position);
        EXPECT_EQ(part.splats[n].splat.axis, whole.splats[same].splat.axis);
        EXPECT_EQ(part.splats[n].growth_code, whole.splats[same].growth_code);
        EXPECT_EQ(part.values[n].slope, whole.values[same].slope);
        EXPECT_EQ(part.values[n].mean, whole.values[same].mean);
      }
    }
    EXPECT_EQ(seen, whole.splats.size()) << nodes;
  }
}

TEST(CellSplats, OfUnevenCellsAreStretchedByTheirNeighbours) {
  // Two groups of three cells, in turn along each axis.
  const std::vector<double> x{0, 1, 2.6, 3.6, 4.6, 6.2, 7.2};
  const glm::dmat3 turn(glm::dvec3(0.6, 0.8, 0), glm::dvec3(-0.8, 0.6, 0), glm::dvec3(0, 0, 1));
  for (size_t axis = 0; axis < 3; ++axis) {
    std::array<uint64_t, 3> nodes{4, 4, 4};
    nodes[axis] = 7;
    CellBlock grid(nodes[0], nodes[1], nodes[2], [&](double i, double j, double k) {
      glm::dvec3 p(i, j, k);
      p[static_cast<int>(axis)] = x[static_cast<size_t>(p[static_cast<int>(axis)])];
      return turn * p;
    });
    grid.addCellScalar([](const glm::dvec3& p) { return p.x; });
    const NodeSplats out = grid.cellSplats();
    EXPECT_NEAR(totalWeight(out), 7.2 * 9, 1e-9);
    for (size_t n = 0; n < 6; ++n) {
      std::array<uint64_t, 3> cell{1, 1, 1};
      cell[axis] = n;
      const NodeSplat* splat = splatAtNode(out, grid.at(cell[0], cell[1], cell[2]));
      ASSERT_TRUE(splat);
      // Extents 1, 1.6, 1, 1, 1.6, 1; those beyond the ends are mirrored.
      const auto extent = [&](size_t m) { return (m + 6) % 3 == 1 ? 1.6 : 1.0; };
      const auto l = [&](size_t m) { return std::log(extent(n + m + 4) / extent(n)); };
      const double curve = l(1) + l(3), slope = l(3) - l(1), bend = l(4) - l(0) - 2 * slope;
      const double whole = std::exp(curve * (0.1531 + 0.0828 * curve) - 0.0418 * bend * slope);  // stretch.h
      const double expected = n == 0 || n == 5 ? 1 : whole;
      const Splat& s = splat->splat;
      EXPECT_NEAR(s.axis[0] * s.axis[1] * s.axis[2] / splat->splat.weight, expected, 3e-6) << axis << n;
      EXPECT_NEAR(singularValues(s.factor())[0] / (expected * extent(n)), 1, extent(n) == 1 ? 0.2 : 3e-6);
      EXPECT_TRUE(splat->regular);
    }
  }
}

TEST(CellSplats, OfSteepTerrainLieInTheirMiddles) {
  // Layers over hills, the flatter the higher. Each column has cells of one height, but their layers come closer together as they get
  // steep: fitted to how far each is across its own faces, splats drifted, and an even medium looked mottled by 2.5 %.
  CellBlock grid(13, 12, 11, [](double i, double j, double k) {
    return glm::dvec3(i, j, 4 * std::sin(0.9 * i) * std::cos(0.8 * j) * (1 - k / 12) + 0.5 * k);
  });
  grid.addCellScalar([](const glm::dvec3& p) { return p.x; });
  const NodeSplats out = grid.cellSplats();
  ASSERT_EQ(out.splats.size(), 12u * 11 * 10);
  for (const NodeSplat& splat : out.splats) {
    EXPECT_LT(glm::distance(splat.splat.position, splat.node_position), 1e-9) << splat.node;
    EXPECT_NEAR(splat.splat.axis[0] * splat.splat.axis[1] * splat.splat.axis[2], splat.splat.weight, 1e-9)
        << splat.node;
  }
}

TEST(CellSplats, WhoseMiddlesNearlyCoincideStayAmongTheSamples) {
  // Every second cell is folded back over the one before it.
  CellBlock zigzag(8, 4, 4,
                   [](double i, double j, double k) { return glm::dvec3(std::fmod(i, 2) + 1e-3 * i, j, k); });
  zigzag.addCellScalar([](const glm::dvec3& p) { return std::sin(1e4 * p.x); });
  const NodeSplats out = zigzag.cellSplats();
  ASSERT_EQ(out.values.size(), 63u);
  for (size_t n = 0; n < out.values.size(); ++n) {
    EXPECT_LE(std::abs(out.values[n].mean), 1) << n;
    EXPECT_LE(glm::length(out.values[n].slope), 8) << n;
  }
}

TEST(CellSplats, OfSingularAndFoldedCellsAreFinite) {
  // A polar axis: wedges, not degenerate, with the volume of the prism.
  CellBlock polar(9, 4, 3, [](double i, double j, double k) {
    const double angle = i * M_PI / 4;
    return glm::dvec3(j * std::cos(angle), j * std::sin(angle), k);
  });
  polar.addCellScalar([](const glm::dvec3& p) { return p.z; });
  const NodeSplats wedges = polar.cellSplats();
  EXPECT_TRUE(allFinite(wedges));
  EXPECT_EQ(wedges.degenerate, 0u);
  EXPECT_NEAR(totalWeight(wedges), 2 * 8 * 0.5 * 9 * std::sin(M_PI / 4), 1e-9);

  for (const int kind : {0, 1, 2}) {  // a sheet, a line, a point
    CellBlock flat(4, 4, 4, [&](double i, double j, double k) {
      return glm::dvec3(kind < 2 ? i : 0, kind < 1 ? j : 0, 0 * k);
    });
    flat.addCellScalar([](const glm::dvec3&) { return 1; });
    const NodeSplats out = flat.cellSplats();
    EXPECT_EQ(out.splats.size(), 27u);
    EXPECT_EQ(out.degenerate, 27u);
    EXPECT_TRUE(allFinite(out)) << kind;
    EXPECT_EQ(totalWeight(out), 0);
  }

  CellBlock folded(3, 3, 3, [](double i, double j, double k) {
    const bool twisted = i == 1 && j == 1 && k == 1;
    return twisted ? glm::dvec3(-2.4, 1.7, 2.9) : glm::dvec3(i, j, k);
  });
  folded.addCellScalar([](const glm::dvec3& p) { return p.y; });
  EXPECT_TRUE(allFinite(folded.cellSplats()));

  CellBlock sheet(4, 4, 1, [](double i, double j, double k) { return glm::dvec3(i, j, k); });
  sheet.addCellScalar([](const glm::dvec3&) { return 1; });
  EXPECT_TRUE(sheet.cellSplats().splats.empty());
}

}  // namespace
}  // namespace curvisplat
