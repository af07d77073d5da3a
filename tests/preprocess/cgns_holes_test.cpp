// Overset holes of CGNS zones, written by libcgns: which nodes and cells they blank, against a list made here.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "tests/preprocess/cgns_fixture.h"
#include "tests/support/parts_of_rows.h"

namespace curvisplat {
namespace {

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

  /// Of every box of rows: the nodes that are blanked, and the cells without a value.
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
  EXPECT_NE(source->description().warnings[0].find("Hole is not applied"), std::string::npos)
      << source->description().warnings[0];
  EXPECT_NE(source->description().warnings[0].find("has the index 3; expected 1 to 2"), std::string::npos);
  EXPECT_FALSE(source->description().blocks[0].has_blanking);
}

INSTANTIATE_TEST_SUITE_P(Types, CgnsHolesOfZones, testing::Values(CgnsFileType::kAdf, CgnsFileType::kHdf5),
                         [](const auto& type) { return type.param == CgnsFileType::kAdf ? "Adf" : "Hdf5"; });

}  // namespace
}  // namespace curvisplat
