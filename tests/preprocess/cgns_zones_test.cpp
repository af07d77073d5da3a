// Time steps in CGNS files: those of the iterative data, those of IOSS, and solutions without times. Overset
// holes of CGNS zones, written by libcgns: which nodes and cells they blank, against a list made here.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "tests/preprocess/cgns_fixture.h"
#include "tests/support/expect_error.h"
#include "tests/support/grid_nodes.h"

namespace curvisplat {
namespace {

class CgnsSteps : public Cgns {};

TEST_P(CgnsSteps, StepsAreThoseOfTheIterativeData) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.baseSteps({0.5, 1.5, 2.5});
    file.zone("Moving", {3, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.coordinates("Grid 2", cartesian(64));
    file.solution("S 1", "Vertex", {{"Density", linear(1)}});
    file.solution("S 2", "Vertex", {{"Density", linear(2)}});
    file.zoneSteps({"S 2", "S 1", "Null"}, {"GridCoordinates", "Grid 2", "Grid 2"});
  }
  const auto first = open();
  EXPECT_EQ(first->description().times, (std::vector<double>{0.5, 1.5, 2.5}));
  EXPECT_EQ(first->description().time_step, 0u);
  expectValues(*first, 0, {0, 2, 0, 2}, 0, linear(2));
  const auto second = open(1);
  EXPECT_EQ(second->description().time_step, 1u);
  expectValues(*second, 0, {0, 2, 0, 2}, 0, linear(1), 64);
  EXPECT_TRUE(open(2)->description().scalars.empty());
  expectSays(errorOf(3), "has 3 time steps; --time-step 3 is out of range");
}

TEST_P(CgnsSteps, StepsOfIossAreInTablesOfTheirOwn) {
  // Its FlowSolutionPointers name solutions that need not exist; there is a table for each location besides.
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.baseSteps({0.5, 1.5});
    file.zone("Zone", {3, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    for (const int step : {1, 2}) {
      file.solution("Nodes@" + std::to_string(step), "Vertex", {{"Density", linear(step)}});
      file.solution("Cells@" + std::to_string(step), "CellCenter", {{"Density", linear(step)}});
    }
    file.zoneSteps({"Solution@1", "Nodes@2"});
    file.pointers("VertexSolutionPointers", {"Nodes@1", "Nodes@2"});
    file.pointers("CellCenterSolutionPointers", {"Null", "Cells@2"});
  }
  const auto first = open();
  ASSERT_EQ(first->description().scalars.size(), 1u);
  expectValues(*first, 0, {0, 2, 0, 2}, 0, linear(1));
  const auto second = open(1);
  ASSERT_EQ(second->description().scalars.size(), 2u);
  expectValues(*second, 0, {0, 2, 0, 2}, 0, linear(2));
}

TEST_P(CgnsSteps, ZonesMayBeThereAtSomeStepsOnly) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.baseSteps({100, 200}, {{"First", "Always"}, {"Always", "Second"}}, true);
    for (const char* zone : {"First", "Always", "Second"}) {
      file.zone(zone, {3, 2, 2});
      file.coordinates("GridCoordinates", cartesian());
    }
  }
  const auto first = open(), second = open(1);
  EXPECT_EQ(first->description().times, (std::vector<double>{100, 200}));
  ASSERT_EQ(first->description().blocks.size(), 2u);
  EXPECT_EQ(first->description().blocks[0].name, "First");
  EXPECT_EQ(first->description().blocks[1].name, "Always");
  ASSERT_EQ(second->description().blocks.size(), 2u);
  EXPECT_EQ(second->description().blocks[0].name, "Always");
  EXPECT_EQ(second->description().blocks[1].name, "Second");
}

TEST_P(CgnsSteps, SolutionsWithoutTimesFollowOneAnother) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {3, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("First", "Vertex", {{"Density", linear(1)}});
    file.solution("Turbulence", "Vertex", {{"ViscosityEddy", linear(5)}});
    file.solution("Cells", "CellCenter", {{"Density", linear(6)}});
    file.solution("Second", "Vertex", {{"Density", linear(2)}});
    file.zone("Steady", {3, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Only", "Vertex", {{"Density", linear(3)}});
  }
  const auto first = open();
  EXPECT_EQ(first->description().times, (std::vector<double>{0, 1}));
  ASSERT_EQ(first->description().scalars.size(), 3u);
  EXPECT_EQ(first->description().scalars[0].name, "Density:node");
  EXPECT_EQ(first->description().scalars[2].name, "Density:cell");
  expectValues(*first, 0, {0, 2, 0, 2}, 0, linear(1));
  expectValues(*first, 0, {0, 2, 0, 2}, 1, linear(5));
  expectValues(*first, 0, {0, 2, 0, 2}, 2, linear(6));
  const auto second = open(1);
  ASSERT_EQ(second->description().scalars.size(), 1u);
  EXPECT_EQ(second->description().scalars[0].name, "Density");
  expectValues(*second, 0, {0, 2, 0, 2}, 0, linear(2));
  expectValues(*second, 1, {0, 2, 0, 2}, 0, linear(3));
}

INSTANTIATE_TEST_SUITE_P(Types, CgnsSteps, testing::Values(CgnsFileType::kAdf, CgnsFileType::kHdf5),
                         [](const auto& type) { return type.param == CgnsFileType::kAdf ? "Adf" : "Hdf5"; });

constexpr std::array<int, 3> kNodes{6, 5, 4};
using Hidden = std::function<bool(uint64_t i, uint64_t j, uint64_t k)>;

class CgnsHolesOfZones : public Cgns {
 protected:
  void write(bool cells, const std::vector<int>& indices, bool ranges) const {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", kNodes);
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex", {{"Density", linear(2)}});
    file.solution("Cells", "CellCenter", {{"Pressure", linear(3)}});
    file.hole("Hole", cells, indices, ranges);
  }

  /// Expects these blanked nodes and cells without a value, for every box of rows.
  void expectBlanked(const Hidden& node, const Hidden& cell) const {
    const auto source = open();
    EXPECT_TRUE(source->description().warnings.empty());
    EXPECT_TRUE(source->description().blocks[0].has_blanking);
    expectPartsOfRows(*source);
    EXPECT_EQ(source->rowsInMemory({}), 0u);
    const std::vector<uint32_t> scalars{0, 1};
    for (uint64_t j0 = 0; j0 < 5; ++j0)
      for (uint64_t k0 = 0; k0 < 4; ++k0) {
        NodeArrays nodes;
        source->read(0, {j0, 5, k0, 4}, scalars, nodes);
        size_t n = 0;
        for (uint64_t k = k0; k < 4; ++k)
          for (uint64_t j = j0; j < 5; ++j)
            for (uint64_t i = 0; i < 6; ++i, ++n) {
              SCOPED_TRACE(testing::Message() << i << ", " << j << ", " << k);
              ASSERT_EQ(nodes.blank[n], node(i, j, k));
              ASSERT_FALSE(std::isnan(nodes.scalars[0][n]));
              ASSERT_EQ(std::isnan(nodes.scalars[1][n]), i == 5 || j == 4 || k == 3 || cell(i, j, k));
            }
      }
  }
};

bool never(uint64_t, uint64_t, uint64_t) {
  return false;
}

TEST_P(CgnsHolesOfZones, RangesOfNodes) {
  write(false, {2, 2, 1, 3, 4, 2, 6, 5, 4, 6, 5, 4}, true);
  expectBlanked(
      [](uint64_t i, uint64_t j, uint64_t k) {
        return (i >= 1 && i <= 2 && j >= 1 && j <= 3 && k <= 1) || (i == 5 && j == 4 && k == 3);
      },
      never);
}

TEST_P(CgnsHolesOfZones, PointsThatAreNodes) {
  write(false, {1, 1, 1, 2, 1, 1, 3, 1, 1, 6, 5, 4, 1, 2, 3}, false);
  expectBlanked(
      [](uint64_t i, uint64_t j, uint64_t k) {
        return (i <= 2 && j == 0 && k == 0) || (i == 5 && j == 4 && k == 3) || (i == 0 && j == 1 && k == 2);
      },
      never);
}

TEST_P(CgnsHolesOfZones, RangesOfCellsHideNodesInTheirMidst) {
  write(true, {1, 1, 1, 3, 2, 2}, true);
  // A node is hidden if all cells around it are.
  expectBlanked([](uint64_t i, uint64_t j, uint64_t k) { return i <= 2 && j <= 1 && k <= 1; },
                [](uint64_t i, uint64_t j, uint64_t k) { return i <= 2 && j <= 1 && k <= 1; });
}

TEST_P(CgnsHolesOfZones, HolesBeyondTheZoneAreNamedAndNotApplied) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.hole("Hole", false, {1, 1, 1, 2, 2, 3}, true);
  }
  const auto source = open();
  ASSERT_EQ(source->description().warnings.size(), 1u);
  expectSays(source->description().warnings[0], "Hole is not applied");
  expectSays(source->description().warnings[0], "has the index 3; expected 1 to 2");
  EXPECT_FALSE(source->description().blocks[0].has_blanking);
}

INSTANTIATE_TEST_SUITE_P(Types, CgnsHolesOfZones, testing::Values(CgnsFileType::kAdf, CgnsFileType::kHdf5),
                         [](const auto& type) { return type.param == CgnsFileType::kAdf ? "Adf" : "Hdf5"; });

}  // namespace
}  // namespace curvisplat
