// The bases of readers of formats (block_source.h, element_source.h): arrays in memory, of which each value tells where it is from.
#include "preprocess/formats/common/block_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "tests/support/grid_nodes.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNi = 5, kNj = 4, kNk = 3;

GridScalar namedScalar(const char* name, Centring centring) {
  GridScalar scalar;
  scalar.name = name;
  scalar.centring = centring;
  return scalar;
}

/// Values 0, 1, 2, ... in the order of the file; longer runs than one of `most` values fail.
BlockArray<float*> numbers(std::array<uint64_t, 2> along = {}, uint64_t most = UINT64_MAX) {
  const auto run = [most](uint64_t first, uint64_t count, float* to) {
    EXPECT_LE(count, most);
    std::iota(to, to + count, static_cast<float>(first));
  };
  return {run, along};
}

/// A block whose node (i, j, k) lies at (i, 10 j, 100 k), with the given array as its scalar.
class NumberedBlock final : public BlockSource {
 public:
  NumberedBlock(BlockArray<float*> array, Centring centring, BlockArray<float*> iblank = {})
      : array_(std::move(array)), iblank_(std::move(iblank)) {
    description_.blocks.push_back({"block", kNi, kNj, kNk, static_cast<bool>(iblank_)});
    description_.scalars.push_back(namedScalar("number", centring));
    negative_is_fringe_ = true;
  }

 private:
  BlockArray<Places> nodesOf(uint32_t) const override {
    return placesAlongAxes(
        [](size_t axis, uint64_t index) { return std::pow(10.0, axis) * static_cast<double>(index); });
  }
  BlockArray<float*> valuesOf(uint32_t, uint32_t) const override { return array_; }
  BlockArray<float*> iblankOf(uint32_t) const override { return iblank_; }

  BlockArray<float*> array_, iblank_;
};

NodeArrays allOf(const GridSource& source) {
  NodeArrays nodes;
  source.read(0, {0, kNj, 0, kNk}, std::vector<uint32_t>{0}, nodes);
  return nodes;
}

TEST(BlockSource, NodesAreReadInTheirOrder) {
  const NumberedBlock source(numbers(), Centring::kNode);
  const NodeArrays nodes = allOf(source);
  ASSERT_EQ(nodes.scalars[0].size(), kNi * kNj * kNk);
  for (size_t n = 0; n < nodes.x.size(); ++n) {
    const size_t i = n % kNi, j = n / kNi % kNj, k = n / kNi / kNj;
    EXPECT_EQ(nodes.x[n], i);
    EXPECT_EQ(nodes.y[n], 10 * j);
    EXPECT_EQ(nodes.z[n], 100 * k);
    EXPECT_EQ(nodes.scalars[0][n], n);
    EXPECT_EQ(nodes.blank[n], 0);
  }
  expectPartsOfRows(source);
  EXPECT_EQ(source.rowsInMemory({}), 0u);
  std::vector<uint8_t> fringe;
  EXPECT_FALSE(source.readFringe(0, {0, 1, 0, 1}, fringe));
}

/// The values of cells in the order of an array of `row` values a row and `rows` rows a plane.
void expectCells(const BlockArray<float*>& array, uint64_t row, uint64_t rows) {
  const NumberedBlock source(array, Centring::kCell);
  const NodeArrays nodes = allOf(source);
  for (size_t n = 0; n < nodes.x.size(); ++n) {
    const size_t i = n % kNi, j = n / kNi % kNj, k = n / kNi / kNj;
    if (i + 1 < kNi && j + 1 < kNj && k + 1 < kNk)
      EXPECT_EQ(nodes.scalars[0][n], i + row * (j + rows * k)) << n;
    else
      EXPECT_TRUE(std::isnan(nodes.scalars[0][n])) << n;
  }
  expectPartsOfRows(source);
}

TEST(BlockSource, CellsLieAtTheirLowestNodes) {
  expectCells(numbers(), kNi - 1, kNj - 1);
}
TEST(BlockSource, RowsMayBeLongerInTheFile) {
  expectCells(numbers({kNi, kNj}, kNi - 1), kNi, kNj);
  expectCells(numbers({17, 9}), 17, 9);
}
TEST(BlockSource, AFileMayReadBoxes) {
  const auto box = [](const ArrayBox& part, float* to) {
    for (uint64_t k = 0; k < part.count[2]; ++k)
      for (uint64_t j = 0; j < part.count[1]; ++j)
        for (uint64_t i = 0; i < part.count[0]; ++i)
          to[i + part.memory[0] * (j + part.memory[1] * k)] = static_cast<float>(
              part.first[0] + i + (kNi - 1) * (part.first[1] + j + (kNj - 1) * (part.first[2] + k)));
  };
  expectCells(BlockArray<float*>(box), kNi - 1, kNj - 1);
}

TEST(BlockSource, MagnitudesAreOfAllComponents) {
  const auto constant = [](float value) {
    return BlockArray<float*>(
        [value](uint64_t, uint64_t count, float* to) { std::fill_n(to, count, value); });
  };
  const NumberedBlock source(magnitudeOf({constant(2), constant(-3), constant(6)}), Centring::kCell);
  const NodeArrays nodes = allOf(source);
  EXPECT_EQ(nodes.scalars[0].front(), 7);
  EXPECT_EQ(std::count(nodes.scalars[0].begin(), nodes.scalars[0].end(), 7.0f),
            (kNi - 1) * (kNj - 1) * (kNk - 1));
  expectPartsOfRows(source);
}

TEST(BlockSource, ABlockWithoutTheScalarIsNaN) {
  const NodeArrays nodes = allOf(NumberedBlock({}, Centring::kNode));
  for (const float value : nodes.scalars[0]) EXPECT_TRUE(std::isnan(value));
}

TEST(BlockSource, IblankHidesNodesAndMarksTheFringe) {
  const auto run = [](uint64_t first, uint64_t count, float* to) {
    for (uint64_t n = 0; n < count; ++n) to[n] = static_cast<float>((first + n) % 3) - 1;
  };
  const NumberedBlock source(numbers(), Centring::kNode, run);
  const NodeArrays nodes = allOf(source);
  std::vector<uint8_t> fringe;
  ASSERT_TRUE(source.readFringe(0, {0, kNj, 0, kNk}, fringe));
  for (size_t n = 0; n < nodes.blank.size(); ++n) {
    EXPECT_EQ(nodes.blank[n], n % 3 == 1);
    EXPECT_EQ(fringe[n], n % 3 == 0);
  }
  expectPartsOfRows(source);
}

class NumberedElements final : public ElementSource {
 public:
  NumberedElements() {
    description_.pieces.push_back({"piece", "memory", 10, 4});
    description_.scalars = {namedScalar("number", Centring::kNode), namedScalar("none", Centring::kNode)};
  }

 private:
  void readPlaces(uint32_t, uint64_t first, uint64_t count, const Places& to) const override {
    for (size_t axis = 0; axis < 3; ++axis)
      for (uint64_t n = 0; n < count; ++n) to.axes[axis][n] = static_cast<double>(first + n + 100 * axis);
  }
  void appendCells(uint32_t, uint64_t first, uint64_t count, MeshCells& out) const override {
    for (uint64_t n = first; n < first + count; ++n)
      out.append(CellKind::kTetrahedron, std::array<uint64_t, 4>{n, n + 1, n + 2, n + 3});
  }
  void readValues(uint32_t, uint32_t scalar, uint64_t first, std::span<float> to) const override {
    if (scalar == 0) std::iota(to.begin(), to.end(), static_cast<float>(first));
  }
};

TEST(ElementSource, PointsAndCellsHaveTheirValues) {
  const NumberedElements source;
  MeshPoints points;
  source.readPoints(0, 3, 2, std::vector<uint32_t>{0, 1}, points);
  EXPECT_EQ(points.x, (std::vector<double>{3, 4}));
  EXPECT_EQ(points.z, (std::vector<double>{203, 204}));
  EXPECT_EQ(points.hidden, (std::vector<uint8_t>{0, 0}));
  EXPECT_EQ(points.scalars[0], (std::vector<float>{3, 4}));
  EXPECT_TRUE(std::isnan(points.scalars[1][1]));
  MeshCells cells;
  for (int again = 0; again < 2; ++again) source.readCells(0, 1, 2, {}, cells);
  EXPECT_EQ(cells.size(), 2u);
  EXPECT_EQ(cells.cornersOfCell(1)[0], 2u);
  EXPECT_FALSE(source.hasCurvedCells());
}

TEST(ElementSource, ElementsAreFoundInTheirLists) {
  const std::vector<uint64_t> lists{3, 0, 4, 2};
  std::vector<std::array<uint64_t, 4>> parts;
  forEachPartOfLists(
      lists, 2, 6, [](uint64_t count) { return count; },
      [&](const PartOfList& part) {
        parts.push_back({part.list, part.first, part.count, part.at});
      });
  const std::vector<std::array<uint64_t, 4>> expected{{0, 2, 1, 0}, {2, 0, 4, 1}, {3, 0, 1, 5}};
  EXPECT_EQ(parts, expected);
}

TEST(ElementSource, APointThatIsNoneIsRefused) {
  EXPECT_EQ(pointNumber(7, 1), 6u);
  for (const double none : {0.0, -3.0, std::nan(""), 1e300}) EXPECT_EQ(pointNumber(none, 1), UINT64_MAX);
}

TEST(ScalarList, NoTwoScalarsHaveTheSameName) {
  GridDescription description;
  description.scalars.push_back(namedScalar("u", Centring::kNode));
  ScalarList list(description);
  list.add(namesOfComponent("u", "", Centring::kCell, 4), Centring::kCell);
  list.add(namesOfComponent("u", "", Centring::kCell, 5), Centring::kCell);
  list.add(namesOfComponent("u", ":x", Centring::kNode, 6), Centring::kNode);
  std::vector<std::string> names;
  for (const GridScalar& scalar : description.scalars) names.push_back(scalar.name);
  EXPECT_EQ(names, (std::vector<std::string>{"u", "u:cell", "u:cell:5", "u:x"}));
}

TEST(ScalarList, ComponentsHaveTheirSuffixes) {
  const auto suffixes = [](uint64_t components) {
    std::string all;
    forEachComponent(components, [&](const std::string& suffix, int component) {
      all += fmt::format("{}{} ", suffix, component);
    });
    return all;
  };
  EXPECT_EQ(suffixes(1), "0 ");
  EXPECT_EQ(suffixes(3), ":mag-1 :x0 :y1 :z2 ");
  EXPECT_EQ(suffixes(4), ":00 :11 :22 :33 ");
}

}  // namespace
}  // namespace curvisplat
