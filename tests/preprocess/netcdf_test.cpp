// NetCDF files by the CF conventions: axes in any order, missing values, units, and what is no grid.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <thread>

#include "preprocess/convert/scan.h"
#include "tests/preprocess/netcdf_fixture.h"
#include "tests/support/earth_files.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

class Netcdf : public NetcdfFixture {};

using Index = std::vector<size_t>;
constexpr auto kSingle = NetcdfNumbers::kSinglePrecision;
constexpr auto kDouble = NetcdfNumbers::kDoublePrecision;

double degreesEast(size_t i) {
  return 10 + 2 * static_cast<double>(i);
}
double degreesNorth(size_t j) {
  return -30 + 1.5 * static_cast<double>(j);
}
double metresUp(size_t k) {
  return 100.0 * static_cast<double>(k * k);
}

void addAxes(NetcdfWriter& file, size_t ni, size_t nj, size_t nk) {
  file.dimension("lon", ni);
  file.dimension("lat", nj);
  file.dimension("alt", nk);
  file.variable("lon", kDouble, {"lon"}, {{"standard_name", "longitude"}},
                [](const Index& n) { return degreesEast(n[0]); });
  file.variable("lat", kDouble, {"lat"}, {{"standard_name", "latitude"}},
                [](const Index& n) { return degreesNorth(n[0]); });
  file.variable("alt", kDouble, {"alt"}, {{"standard_name", "altitude"}, {"units", "km"}},
                [](const Index& n) { return 1e-3 * metresUp(n[0]); });
}

TEST_P(Netcdf, WhyIndicesTakeThePlaceOfCoordinatesIsSaid) {
  const auto write = [&](bool with_places) {
    NetcdfWriter file(path_, GetParam());
    for (const char* const name : {"x", "y", "z"}) file.dimension(name, 4);
    const auto add = [&](const std::string& name, const NetcdfAttributes& attributes) {
      file.variable(name, kDouble, {"z", "y", "x"}, attributes,
                    [](const Index& n) { return static_cast<double>(n[2] + n[1] * n[0]); });
    };
    add("T", {{"coordinates", "X Y Z"}});
    if (with_places)
      for (const char* const name : {"X", "Y", "Z"}) add(name, {{"units", "m"}});
  };
  write(false);
  EXPECT_EQ(open({"T"})->description().warnings,
            (std::vector<std::string>{
                "the dimensions x, y, z have no coordinates; the indices of the nodes take their place"}));
  write(true);
  EXPECT_EQ(
      open({"T"})->description().warnings,
      (std::vector<std::string>{"X and Y have three dimensions, expected one or two, and are not used; the "
                                "indices of the nodes take their place"}));
}

TEST_P(Netcdf, AxesOfOneDimensionInAnyOrder) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 5, 4, 3);
    file.variable("usual", kSingle, {"alt", "lat", "lon"}, {},
                  [](const Index& n) { return static_cast<double>(100 * n[0] + 10 * n[1] + n[2]); });
    file.variable("turned", kSingle, {"lon", "lat", "alt"}, {},
                  [](const Index& n) { return static_cast<double>(100 * n[2] + 10 * n[1] + n[0]); });
  }
  const auto usual = open({"usual"}), turned = open({"turned"});
  EXPECT_TRUE(usual->description().times.empty());
  expectAll(*usual, "usual", [](size_t i, size_t j, size_t k) {
    return Expected{{degreesEast(i), degreesNorth(j), 1e-3 * metresUp(k)},
                    static_cast<double>(100 * k + 10 * j + i)};
  });
  EXPECT_EQ(turned->description().blocks.at(0).ni, 3u);
  expectAll(*turned, "turned", [](size_t i, size_t j, size_t k) {
    return Expected{{degreesEast(k), degreesNorth(j), 1e-3 * metresUp(i)},
                    static_cast<double>(100 * i + 10 * j + k)};
  });
}

TEST_P(Netcdf, LargeGridsAreReadInPieces) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 400, 75, 6);
    file.variable("value", kSingle, {"alt", "lat", "lon"}, {},
                  [](const Index& n) { return static_cast<double>(n[0] + 2 * n[1] + 700 * n[2]); });
  }
  const auto source = open();
  options_.globe.radius_km = kRadius;
  expectBox(*source, 0, {0, 75, 0, 6}, [](size_t i, size_t j, size_t k) {
    return Expected{{degreesEast(i), degreesNorth(j), 1e-3 * metresUp(k)},
                    static_cast<double>(k + 2 * j + 700 * i)};
  });
}

TEST_P(Netcdf, MissingValuesOfEachKindAreBlank) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 8, 2, 2);
    file.variable("value", kSingle, {"alt", "lat", "lon"},
                  {{"missing_value", NetcdfNumberList{-1, -2}},
                   {"valid_min", NetcdfNumberList{0}},
                   {"valid_max", NetcdfNumberList{50}}},
                  [](const Index& n) {
                    const double values[] = {7, -1, -2, -3, 51, std::nan(""), 9.969209968386869e+36, 50};
                    return values[n[2]];
                  });
    file.variable("ranged", kSingle, {"alt", "lat", "lon"}, {{"valid_range", NetcdfNumberList{2, 5}}},
                  [](const Index& n) { return static_cast<double>(n[2]); });
    file.variable("filled", NetcdfNumbers::kInt32, {"alt", "lat", "lon"}, {},
                  [](const Index& n) { return n[2] == 3 ? -2147483647.0 : static_cast<double>(n[2]); });
  }
  const auto valuesOf = [&](const char* name) {
    const auto source = open({name});
    const uint32_t scalar = scalarsNamed(source->description(), {name}).at(0);
    NodeArrays nodes;
    source->read(0, {0, 1, 0, 1}, std::span(&scalar, 1), nodes);
    std::string there;
    for (size_t n = 0; n < nodes.blank.size(); ++n) {
      EXPECT_EQ(nodes.blank[n] != 0, std::isnan(nodes.scalars[0][n]));
      there += nodes.blank[n] ? '.' : static_cast<char>('0' + n);
    }
    return there;
  };
  EXPECT_EQ(valuesOf("value"), "0......7");
  EXPECT_EQ(valuesOf("ranged"), "..2345..");
  EXPECT_EQ(valuesOf("filled"), "012.4567");
}

TEST_P(Netcdf, ARangeInUnpackedUnitsBlanksUnpackedValues) {
  // Stored n is 273.15 + 0.01 n (or minus): unpacked ranges of the scale's type leave 2 to 5.
  const auto drawn = [&](double scale, const NetcdfAttributes& range) {
    {
      NetcdfWriter file(path_, GetParam());
      addAxes(file, 8, 2, 2);
      NetcdfAttributes attributes = range;
      attributes.push_back({"scale_factor", NetcdfDoubleList{{scale}}});
      attributes.push_back({"add_offset", NetcdfDoubleList{{273.15}}});
      file.variable("t", NetcdfNumbers::kInt16, {"alt", "lat", "lon"}, attributes,
                    [](const Index& n) { return static_cast<double>(n[2]); });
    }
    const auto source = open();
    const uint32_t scalar = 0;
    NodeArrays nodes;
    source->read(0, {0, 1, 0, 1}, std::span(&scalar, 1), nodes);
    std::string there;
    for (size_t n = 0; n < nodes.blank.size(); ++n)
      there += nodes.blank[n] ? '.' : static_cast<char>('0' + n);
    return there;
  };
  EXPECT_EQ(drawn(0.01, {{"valid_range", NetcdfDoubleList{{273.17, 273.2}}}}), "..2345..");
  EXPECT_EQ(drawn(0.01, {{"valid_min", NetcdfDoubleList{{273.17}}}}), "..234567");
  EXPECT_EQ(drawn(0.01, {{"valid_max", NetcdfDoubleList{{273.2}}}}), "012345..");
  EXPECT_EQ(drawn(-0.01, {{"valid_range", NetcdfDoubleList{{273.1, 273.13}}}}), "..2345..");
  // In the type of the variable a range is of stored values.
  EXPECT_EQ(drawn(0.01, {{"valid_range", NetcdfNumberList{2, 5}}}), "..2345..");
  EXPECT_EQ(drawn(0.01, {{"valid_range", NetcdfDoubleList{{200, 300}}}}), "01234567");
}

TEST_P(Netcdf, AGridWithoutAnyValueIsExplained) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.variable("t", kSingle, {"alt", "lat", "lon"}, {{"valid_min", NetcdfNumberList{200}}},
                  [](const Index&) { return 7.0; });
  }
  const auto source = open();
  const NodeReader reader(*source, {0}, std::nullopt);
  Progress progress;
  expectError([&] { surveyGrid(reader, 1 << 20, {}, progress); },
              {"all 24 samples are blanked", "t is missing where it is below valid_min 200"});
}

TEST_P(Netcdf, LengthsAreFlat) {
  {
    NetcdfWriter file(path_, GetParam());
    for (const auto& [name, length] : {std::pair{"x", 4}, {"y", 3}, {"depth", 2}})
      file.dimension(name, static_cast<size_t>(length));
    for (const char* name : {"x", "y"})
      file.variable(name, kDouble, {name}, {{"units", "m"}},
                    [](const Index& n) { return 1500.0 * static_cast<double>(n[0]); });
    file.variable("depth", kDouble, {"depth"}, {{"units", "m"}, {"positive", "down"}},
                  [](const Index& n) { return 250.0 * static_cast<double>(n[0]); });
    file.variable("value", kSingle, {"depth", "y", "x"}, {}, [](const Index&) { return 1.0; });
  }
  NodeArrays nodes;
  open()->read(0, {2, 3, 1, 2}, {}, nodes);
  EXPECT_EQ(nodes.x, (std::vector<double>{0, 1.5, 3, 4.5}));
  EXPECT_EQ(nodes.y, (std::vector<double>{3, 3, 3, 3}));
  EXPECT_EQ(nodes.z, (std::vector<double>{-0.25, -0.25, -0.25, -0.25}));
  options_.globe.shape = GlobeOptions::Shape::kSphere;
  expectSays(errorOf(), "x and y are lengths; --sphere needs degrees");
}

TEST_P(Netcdf, AVariableThatIsNotAGridIsExplained) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.variable("surface", kSingle, {"lat", "lon"}, {}, [](const Index&) { return 1.0; });
  }
  expectSays(errorOf(), "no variable has three dimensions in space");
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.dimension("plev", 2);
    file.variable("plev", kSingle, {"plev"}, {{"units", "kg m-3"}, {"positive", "down"}},
                  [](const Index& n) { return 1e5 - 1e4 * static_cast<double>(n[0]); });
    file.variable("air", kSingle, {"plev", "lat", "lon"}, {}, [](const Index&) { return 1.0; });
  }
  expectSays(errorOf(), "air: plev has the unit 'kg m-3'; expected a length or a pressure");
  {
    NetcdfWriter file(path_, GetParam());
    file.dimension("a", 4);
    file.dimension("b", 4);
    file.dimension("c", 4);
    file.variable("c", kSingle, {"c"}, {{"units", "1"}}, [](const Index&) { return 1.0; });
    file.variable("bare", kSingle, {"a", "b", "c"}, {}, [](const Index&) { return 1.0; });
  }
  expectSays(errorOf(), "no longitude and latitude, or x and y, on its dimensions a, b, c");
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.dimension("cell", 5);
    file.dimension("more", 2);
    for (const char* name : {"clon", "clat"})
      file.variable(name, kSingle, {"cell"},
                    {{"units", *(name + 2) == 'o' ? "degrees_east" : "degrees_north"}},
                    [](const Index& n) { return static_cast<double>(n[0]); });
    file.variable("cells", kSingle, {"alt", "more", "cell"}, {{"coordinates", "clon clat"}},
                  [](const Index&) { return 1.0; });
  }
  expectSays(errorOf(), "do not vary along exactly two of its dimensions alt, more, cell");
}

TEST_P(Netcdf, WrongStepsAndMoreFilesAreRefused) {
  nemo::write(path_, GetParam(), false);
  expectSays(errorOf({}, 3), "has 3 time steps; --time-step 3 is out of range");
  std::ofstream(folder_ / "more.q") << "no NetCDF, but longer than a signature";
  options_.solutions = {folder_ / "more.q"};
  expectSays(errorOf(), "is not a NetCDF file; expected one");
}

TEST_P(Netcdf, ThreadsMayReadAtOnce) {
  roms::write(path_, GetParam(), "ocean_s_coordinate_g2");
  const auto source = open();
  const GridBlock& block = source->description().blocks.at(0);
  const std::vector<uint32_t> scalars = {0, 1};
  NodeArrays whole;
  source->read(0, {0, block.nj, 0, block.nk}, scalars, whole);
  std::vector<std::thread> threads;
  for (uint64_t t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (uint64_t k = 0; k < block.nk; ++k) {
        NodeArrays plane;
        source->read(0, {0, block.nj, k, k + 1}, scalars, plane);
        const size_t first = k * block.ni * block.nj;
        for (size_t n = 0; n < plane.x.size(); ++n) {
          ASSERT_EQ(plane.x[n], whole.x[first + n]);
          ASSERT_EQ(plane.scalars[1][n], whole.scalars[1][first + n]);
        }
      }
    });
  for (std::thread& thread : threads) thread.join();
}

INSTANTIATE_TEST_SUITE_P(Types, Netcdf, kNetcdfTypes, nameOf);

}  // namespace
}  // namespace curvisplat
