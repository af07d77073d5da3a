#include "preprocess/formats/open/open_grid.h"

#include <gtest/gtest.h>

#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/parts_of_rows.h"

namespace curvisplat {
namespace {

using namespace test;

class OpenGrid : public testing::Test {
 protected:
  std::unique_ptr<GridSource> open(const std::vector<std::string>& solutions) const {
    OpenGridOptions options;
    options.grid = folder_.path() / "grid.xyz";
    for (const std::string& solution : solutions) options.solutions.push_back(folder_.path() / solution);
    return openGrid(options);
  }
  std::vector<std::string> names(const std::vector<std::string>& solutions) const {
    std::vector<std::string> found;
    const auto source = open(solutions);
    for (const GridScalar& scalar : source->description().scalars) found.push_back(scalar.name);
    return found;
  }
  void write(const std::string& name, Plot3dKind kind, uint32_t components) {
    Plot3dLayout layout;
    layout.kind = kind;
    folder_.write(name, plot3dBytes(layout, {testBlock(5, 4, 3, components)}));
  }
  void SetUp() override { write("grid.xyz", Plot3dKind::kGrid, 0); }

  const TestFolder folder_{"open-grid"};
};

std::string usageErrorOf(const GridDescription& description, const std::vector<std::string>& names) {
  try {
    scalarsNamed(description, names);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

using Positions = std::vector<uint32_t>;

TEST_F(OpenGrid, FindsScalarsByNameAliasAndNumber) {
  write("a.q", Plot3dKind::kQ, 5);
  write("a.fun", Plot3dKind::kFunction, 3);
  folder_.write("a.nam", "velocity_u ; velocity\r\n  T\n\npressure\n");
  EXPECT_EQ(names({"a.q", "a.fun"}),
            (std::vector<std::string>{"density", "momentum_x", "momentum_y", "momentum_z", "energy",
                                      "velocity_u", "T", "pressure"}));
  const auto source = open({"a.q", "a.fun"});
  const GridDescription& description = source->description();
  EXPECT_TRUE(description.warnings.empty());
  EXPECT_EQ(scalarsNamed(description, {}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"pressure", "Density", "StagnationEnergy", "momentum-y"}),
            (Positions{7, 0, 4, 2}));
  EXPECT_EQ(scalarsNamed(description, {"2", "velocity-U"}), (Positions{6, 5}));
}

TEST_F(OpenGrid, FindsScalarsAsListsPrintThem) {
  GridDescription description;
  description.scalars = {{"T", "K", {}, 3, Centring::kNode},
                         {"T cell", "", {}, 0, Centring::kCell},
                         {"p [Pa]", "K", {}, 0, Centring::kNode}};
  EXPECT_EQ(scalarsNamed(description, {"T [K]"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"T (3)"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"T [K] (3)"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"T (3) [K]"}), Positions{0});
  EXPECT_EQ(scalarsNamed(description, {"p [Pa]"}), Positions{2});
  EXPECT_EQ(scalarsNamed(description, {"p [Pa] [K]"}), Positions{2});
  for (const char* wrong : {"T [m]", "T [K] ", "T (4)", "T cell []", "T cell (0)", "T [K] [K]"})
    EXPECT_NE(usageErrorOf(description, {wrong}).find("there is no scalar"), std::string::npos) << wrong;
  description.scalars.clear();
  EXPECT_EQ(usageErrorOf(description, {"T"}),
            "the files contain no scalar; give a Q or function file as well");
}

TEST_F(OpenGrid, ReadsPartsOfRows) {
  Plot3dLayout grid, q;
  grid.kind = Plot3dKind::kGrid;
  q.kind = Plot3dKind::kQ;
  for (Plot3dLayout* layout : {&grid, &q}) {
    layout->multi_block = true;
    layout->precision_bytes = 8;
    layout->byte_order = ByteOrder::kBig;
    layout->records = RecordMarkers::kBytes4;
  }
  grid.blanking = true;
  const std::vector<TestBlock> blocks{testBlock(9, 4, 3, 5), testBlock(7, 5, 6, 5, 40)};
  for (const uint64_t subrecord_bytes : {0u, 200u}) {
    folder_.write("grid.xyz", plot3dBytes(grid, blocks, subrecord_bytes));
    folder_.write("a.q", plot3dBytes(q, blocks, subrecord_bytes));
    const auto source = open({"a.q"});
    EXPECT_EQ(source->description().blocks.size(), 2u);
    EXPECT_TRUE(source->description().blocks[0].has_blanking);
    EXPECT_EQ(source->rowsInMemory({}), 0u);
    expectPartsOfRows(*source);
  }
}

TEST_F(OpenGrid, RefusesUnknownScalarsWithTheListOfThem) {
  write("a.fun", Plot3dKind::kFunction, 2);
  folder_.write("a.nam", "p\nT\n");
  const auto source = open({"a.fun"});
  EXPECT_EQ(scalarsNamed(source->description(), {"2"}), Positions{1});
  for (const char* name : {"rho", "0", "3", "-1", "1.5", ""}) {
    const std::string error = usageErrorOf(source->description(), {name});
    EXPECT_NE(error.find("available: p (1), T (2)"), std::string::npos) << error;
  }
  EXPECT_NE(usageErrorOf(source->description(), {"T", "2"}).find("twice"), std::string::npos);
  EXPECT_NE(usageErrorOf(open({})->description(), {}).find("the files contain no scalar"), std::string::npos);
}

TEST_F(OpenGrid, NamesThatClashCarryTheirFile) {
  write("a.fun", Plot3dKind::kFunction, 2);
  write("b.fun", Plot3dKind::kFunction, 3);
  EXPECT_EQ(names({"a.fun", "b.fun"}), (std::vector<std::string>{"a:1", "a:2", "b:1", "b:2", "3"}));
  const auto source = open({"a.fun", "b.fun"});
  EXPECT_EQ(scalarsNamed(source->description(), {"b:2", "3"}), (Positions{3, 4}));
  EXPECT_NE(usageErrorOf(source->description(), {"1"}).find("ambiguous"), std::string::npos);
  EXPECT_THROW(open({"a.fun", "a.fun"}), Error);
}

TEST_F(OpenGrid, WarnsOfNamesThatDoNotMatch) {
  write("a.fun", Plot3dKind::kFunction, 3);
  folder_.write("a.nam", "p\nT\n");
  const auto source = open({"a.fun"});
  ASSERT_EQ(source->description().warnings.size(), 1u);
  EXPECT_NE(source->description().warnings[0].find("2 names for the 3 variables"), std::string::npos);
  EXPECT_EQ(names({"a.fun"}), (std::vector<std::string>{"p", "T", "3"}));
}

TEST_F(OpenGrid, NamesForeignFiles) {
  for (const auto& [bytes, words] : {std::pair<std::string, std::string>{"\x1f\x8b\x08\x01", "gzip"},
                                     {"\x89PNG\r\n\x1a\n", "PNG"},
                                     {"# vtk DataFile Version 3.0\n", "legacy VTK"},
                                     {"<?xml version=\"1.0\"?>", "XML"},
                                     {"\x89HDF\r\n\x1a\n", "HDF5"},
                                     {"CDF\x01", "NetCDF"},
                                     {"{ \"xyz\": 1 }", "JSON"}}) {
    folder_.write("foreign", bytes + "1234567890");
    try {
      open({"foreign"});
      FAIL() << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace curvisplat
