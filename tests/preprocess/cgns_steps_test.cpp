// Time steps in CGNS files: those of the iterative data, those of IOSS, and solutions without times.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/preprocess/cgns_fixture.h"

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
  EXPECT_NE(errorOf(3).find("has 3 time steps; --time-step 3 is out of range"), std::string::npos)
      << errorOf(3);
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

}  // namespace
}  // namespace curvisplat
