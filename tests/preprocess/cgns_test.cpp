// CGNS files written by libcgns' upper layer, as other programs write them, HDF5 and ADF: what is read is
// what was written, wherever it stands in the file, and what cannot be drawn is said in words.
#include <gtest/gtest.h>

#include <thread>

#include "tests/preprocess/cgns_fixture.h"
#include "tests/support/expect_error.h"
#include "tests/support/grid_nodes.h"

namespace curvisplat {
namespace {

void expectAllBoxes(const GridSource& source, uint32_t scalar, const CgnsFunction& value) {
  const GridBlock& dims = source.description().blocks.at(0);
  for (uint64_t j0 = 0; j0 < dims.nj; ++j0)
    for (uint64_t j1 = j0 + 1; j1 <= dims.nj; ++j1)
      for (uint64_t k0 = 0; k0 < dims.nk; ++k0)
        for (uint64_t k1 = k0 + 1; k1 <= dims.nk; ++k1)
          ASSERT_NO_FATAL_FAILURE(expectValues(source, 0, {j0, j1, k0, k1}, scalar, value));
}

TEST_P(Cgns, VertexAndCellSolutionsAreReadByAnyBox) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.family("Wing");
    file.zone("Zone 1", {5, 4, 3});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex", {{"Density", linear(2)}, {"Pressure", linear(0.5, 9)}});
    file.solution("Cells", "CellCenter", {{"Temperature", linear(7)}});
  }
  const auto source = open();
  const GridDescription& description = source->description();
  ASSERT_EQ(description.blocks.size(), 1u);
  EXPECT_EQ(description.blocks[0].name, "Zone 1");
  EXPECT_EQ(description.blocks[0].ni, 5u);
  EXPECT_EQ(description.blocks[0].nj, 4u);
  EXPECT_EQ(description.blocks[0].nk, 3u);
  EXPECT_EQ(description.coordinate_bytes, 8);
  EXPECT_TRUE(description.times.empty());
  EXPECT_TRUE(description.warnings.empty());
  ASSERT_EQ(description.scalars.size(), 3u);
  EXPECT_EQ(description.scalars[1].centring, Centring::kNode);
  EXPECT_EQ(description.scalars[2].centring, Centring::kCell);
  expectAllBoxes(*source, 1, linear(0.5, 9));
  expectAllBoxes(*source, 2, linear(7));
  expectPartsOfRows(*source);
}

TEST_P(Cgns, RindPlanesAreDropped) {
  const CgnsRind grid{1, 2, 0, 3, 2, 1}, nodes{0, 1, 2, 0, 1, 1}, cells{1, 1, 1, 0, 0, 2};
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {4, 3, 3});
    file.coordinates("GridCoordinates", cartesian(), grid);
    file.solution("Nodes", "Vertex", {{"Density", linear(2)}}, nodes);
    file.solution("Cells", "CellCenter", {{"Temperature", linear(7)}}, cells);
  }
  const auto source = open();
  expectAllBoxes(*source, 0, linear(2));
  expectAllBoxes(*source, 1, linear(7));
}

TEST_P(Cgns, LargePlanesAreReadInPieces) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {300, 301, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex",
                  {{"MomentumX", linear(3)},
                   {"MomentumY", linear(4)},
                   {"MomentumZ", [](int64_t, int64_t, int64_t) { return 0.0; }}});
  }
  const auto source = open();
  expectValues(*source, 0, {0, 301, 0, 2}, 0, linear(3));
  const std::vector<uint32_t> length = scalarsNamed(source->description(), {"Momentum:mag"});
  expectValues(*source, 0, {0, 301, 0, 2}, length.at(0), linear(5));
}

TEST_P(Cgns, NumbersOfAnyTypeAreConverted) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {3, 3, 3});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex",
                  {{"Single", linear(0.5), CgnsNumbers::kSinglePrecision},
                   {"Integer", linear(3), CgnsNumbers::kInteger},
                   {"Double", linear(0.1), CgnsNumbers::kDoublePrecision}});
  }
  const auto source = open();
  expectAllBoxes(*source, 0, linear(0.5));
  expectAllBoxes(*source, 1, linear(3));
  expectAllBoxes(*source, 2, linear(0.1));
}

TEST_P(Cgns, UnitsAreTheFilesOrTheStandards) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.dimensional();
    file.zone("Zone", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution(
        "Nodes", "Vertex",
        {{"Density", linear(1)}, {"Mine", linear(1)}, {"Pressure", linear(1)}, {"Other", linear(1)}});
    file.fieldUnits(2, {0, 2, -3, 0, 0});
    file.fieldUnits(3, {});
  }
  const auto source = open();
  const std::vector<GridScalar>& scalars = source->description().scalars;
  EXPECT_EQ(scalars.at(0).unit, "kg m-3");
  EXPECT_EQ(scalars.at(1).unit, "m2 s-3");
  EXPECT_EQ(scalars.at(2).unit, "");  // nondimensional
  EXPECT_EQ(scalars.at(3).unit, "");  // nothing tells
}

TEST_P(Cgns, ZonesOfAllBasesAreBlocks) {
  {
    CgnsWriter file = writer();
    file.base("Near");
    file.zone("Zone", {2, 3, 4});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex", {{"Density", linear(1)}});
    file.base("Surface", 2, 3);
    file.base("Far");
    file.zone("Zone", {5, 2, 2});
    file.coordinates("GridCoordinates", cartesian(8));
    file.solution("Nodes", "Vertex", {{"Density", linear(2)}});
  }
  const auto source = open();
  ASSERT_EQ(source->description().blocks.size(), 2u);
  EXPECT_EQ(source->description().blocks[0].name, "Near/Zone");
  EXPECT_EQ(source->description().blocks[1].name, "Far/Zone");
  ASSERT_EQ(source->description().scalars.size(), 1u);
  expectValues(*source, 0, {0, 3, 0, 4}, 0, linear(1));
  expectValues(*source, 1, {0, 2, 0, 2}, 0, linear(2), 8);
}

TEST_P(Cgns, BoundaryConditionsFamiliesAndUnitsAreNoted) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.dimensional();
    file.family("Wing");
    file.family("Body");
    for (const char* zone : {"One", "Two"}) {
      file.zone(zone, {3, 2, 2});
      file.coordinates("GridCoordinates", cartesian());
      file.boundary("Wall", true);
    }
    file.boundary("Inflow", false);
  }
  EXPECT_EQ(open()->description().notes,
            (std::vector<std::string>{"boundary conditions: BCInflow 1, BCWall 2", "families: Wing, Body",
                                      "units: Kilogram, Meter, Second, Kelvin, Radian"}));
  const auto source = open();
  const auto& boundaries = source->description().boundaries;
  ASSERT_EQ(boundaries.size(), 3u);
  EXPECT_EQ(boundaries[0].name, "Wall");
  EXPECT_EQ(boundaries[0].type, "BCWall");
  EXPECT_EQ(boundaries[1].block, 1u);
  EXPECT_EQ(boundaries[2].type, "BCInflow");
  EXPECT_EQ(boundaries[2].first, (std::array<uint64_t, 3>{0, 0, 0}));
  EXPECT_EQ(boundaries[2].last, (std::array<uint64_t, 3>{2, 1, 0}));
}

TEST_P(Cgns, ZonesWithoutTheFieldAreNotDrawnAndNamed) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Full", {3, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex", {{"Density", linear(1)}});
    file.zone("Bare", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
  }
  const auto source = open();
  ASSERT_EQ(source->description().warnings.size(), 1u);
  EXPECT_EQ(source->description().warnings[0],
            "1 of 2 zones (Bare) have no Density; they are not drawn with it");
  const NodeArrays full = readAll(*source, 0, {0}), bare = readAll(*source, 1, {0});
  for (const float value : full.scalars[0]) EXPECT_FALSE(std::isnan(value));
  for (const float value : bare.scalars[0]) EXPECT_TRUE(std::isnan(value));
}

TEST_P(Cgns, WhatIsNotDrawnIsNamed) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.unstructuredZone("Tetrahedra");
    file.zone("Plane", {4, 3, 1});
    file.coordinates("GridCoordinates", cartesian());
    file.zone("Empty", {2, 2, 2});
    file.zone("Zone", {3, 3, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Faces", "IFaceCenter", {{"Flux", linear(1)}});
  }
  const auto source = open();
  ASSERT_EQ(source->description().blocks.size(), 1u);
  EXPECT_TRUE(source->description().scalars.empty());
  const std::vector<std::string> expected = {
      "Base/Zone/Faces is left out: its GridLocation is IFaceCenter; expected Vertex or CellCenter",
      "left out: 1 zone of a single plane of nodes (volumes are needed): Base/Plane (4x3x1)",
      "left out: 1 zone without coordinates: Base/Empty",
      "left out: 1 zone without elements: Base/Tetrahedra"};
  EXPECT_EQ(source->description().warnings, expected);
}

TEST_P(Cgns, NothingToDrawIsAnError) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.unstructuredZone("Tetrahedra");
  }
  expectSays(errorOf(), "1 zone without elements: Base/Tetrahedra");
  {
    CgnsWriter file = writer();
    file.base("Base");
  }
  expectSays(errorOf(), "has no zones");
  { CgnsWriter file = writer(); }
  expectSays(errorOf(), "no CGNSBase_t");
}

TEST_P(Cgns, CylindricalCoordinatesAreRefused) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {3, 3, 2});
    file.coordinates(
        "GridCoordinates",
        {{"CoordinateR", linear(1)}, {"CoordinateTheta", linear(2)}, {"CoordinateZ", linear(3)}});
  }
  expectSays(errorOf(), "coordinates CoordinateR, CoordinateTheta, CoordinateZ; expected CoordinateX");
}

TEST_P(Cgns, NamesOfPlot3dAndOfComponentsServe) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex",
                  {{"Density", linear(1)},
                   {"MomentumX", linear(1)},
                   {"MomentumY", linear(1)},
                   {"MomentumZ", linear(1)},
                   {"EnergyStagnationDensity", linear(1)}});
  }
  const auto source = open();
  EXPECT_EQ(
      scalarsNamed(source->description(), {"rho", "momentum_x", "Momentum:y", "momentum:mag", "energy"}),
      (std::vector<uint32_t>{0, 1, 2, 5, 4}));
}

TEST_P(Cgns, AFurtherFileOfTheSameScalarsIsRefused) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
  }
  OpenGridOptions options;
  options.grid = path_;
  options.solutions = {path_};
  expectError([&] { openGrid(options); }, {"no further scalar"});
}

TEST_P(Cgns, ThreadsMayReadAtOnce) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {20, 20, 20});
    file.coordinates("GridCoordinates", cartesian());
    file.solution("Nodes", "Vertex", {{"Density", linear(2)}});
  }
  const auto source = open();
  std::vector<std::thread> threads;
  for (uint64_t n = 0; n < 4; ++n)
    threads.emplace_back([&source, n] {
      for (uint64_t k = n; k < 20; ++k) expectValues(*source, 0, {0, 20, k, k + 1}, 0, linear(2));
    });
  for (std::thread& thread : threads) thread.join();
}

TEST_P(Cgns, LinksThatLeadOutOfTheFolderAreNotFollowed) {
  std::filesystem::create_directory(folder_ / "in");
  const std::filesystem::path outer = path_;
  for (const char* const place : {"grid.cgns", "in/out.cgns"}) {
    path_ = folder_ / place;
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
    if (path_ != outer) file.link("Flow", "../grid.cgns", "/Base/Zone/GridCoordinates");
  }
  expectSays(errorOf(), "../grid.cgns, which lies outside ");
}

TEST_P(Cgns, AnHdf5FileOfAnyNameIsRecognised) {
  {
    CgnsWriter file = writer();
    file.base("Base");
    file.zone("Zone", {2, 2, 2});
    file.coordinates("GridCoordinates", cartesian());
  }
  std::filesystem::rename(path_, folder_ / "flow.h5");
  path_ = folder_ / "flow.h5";
  EXPECT_EQ(open()->description().blocks.size(), 1u);
}

INSTANTIATE_TEST_SUITE_P(Types, Cgns, testing::Values(CgnsFileType::kAdf, CgnsFileType::kHdf5),
                         [](const auto& type) { return type.param == CgnsFileType::kAdf ? "Adf" : "Hdf5"; });

}  // namespace
}  // namespace curvisplat
