// NetCDF files as models of the ocean and the atmosphere write them: every node's place and value, against
// the conventions' formulas written down here once more.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <thread>

#include "preprocess/convert/scan.h"
#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/earth_files.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr double kRadius = 6371;

struct Geographic {
  double longitude, latitude, height_km;
};

struct Expected {
  Geographic place;
  double value;  // NaN: none
};

using ExpectedAt = std::function<Expected(size_t i, size_t j, size_t k)>;

double radians(double degrees) {
  return degrees * std::numbers::pi / 180;
}

class Netcdf : public testing::TestWithParam<NetcdfFileType> {
 protected:
  std::unique_ptr<GridSource> open(const std::vector<std::string>& scalars = {}, uint32_t step = 0) const {
    OpenGridOptions options = options_;
    options.grid = path_;
    options.scalars = scalars;
    if (step > 0) options.time_step = step;
    return openGrid(options);
  }

  std::string errorOf(const std::vector<std::string>& scalars = {}, uint32_t step = 0) const {
    try {
      open(scalars, step);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  void expectBox(const GridSource& source, uint32_t scalar, const NodeBox& box,
                 const ExpectedAt& expected) const {
    const GridBlock& block = source.description().blocks.at(0);
    NodeArrays nodes;
    source.read(0, box, std::span(&scalar, 1), nodes);
    ASSERT_EQ(nodes.x.size(), block.ni * (box.j1 - box.j0) * (box.k1 - box.k0));
    const double near = tolerance_;
    size_t n = 0;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < block.ni; ++i, ++n) {
          SCOPED_TRACE(std::to_string(i) + ", " + std::to_string(j) + ", " + std::to_string(k));
          const auto [at, value] = expected(i, j, k);
          const double height = at.height_km * options_.globe.vertical_scale;
          if (options_.globe.shape == GlobeOptions::Shape::kFlat) {
            ASSERT_NEAR(nodes.x[n], kRadius * radians(at.longitude), near);
            ASSERT_NEAR(nodes.y[n], kRadius * radians(at.latitude), near);
            ASSERT_NEAR(nodes.z[n], height, near);
          } else {
            const double r = options_.globe.radius_km + height;
            const double east = radians(at.longitude), north = radians(at.latitude);
            ASSERT_NEAR(nodes.x[n], r * std::cos(north) * std::cos(east), near);
            ASSERT_NEAR(nodes.y[n], r * std::cos(north) * std::sin(east), near);
            ASSERT_NEAR(nodes.z[n], r * std::sin(north), near);
          }
          ASSERT_EQ(nodes.blank[n] != 0, std::isnan(value));
          if (std::isnan(value))
            ASSERT_TRUE(std::isnan(nodes.scalars[0][n]));
          else
            ASSERT_EQ(nodes.scalars[0][n], static_cast<float>(value));
        }
  }

  void expectAll(const GridSource& source, const char* scalar, const ExpectedAt& expected) const {
    const GridBlock& block = source.description().blocks.at(0);
    const uint32_t position = scalarsNamed(source.description(), {scalar}).at(0);
    expectBox(source, position, {0, block.nj, 0, block.nk}, expected);
    expectBox(source, position, {1, 2, 0, block.nk}, expected);
    expectBox(source, position, {0, block.nj, 1, 2}, expected);
    expectBox(source, position, {block.nj - 1, block.nj, block.nk - 1, block.nk}, expected);
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "file.nc";
  OpenGridOptions options_;
  double tolerance_ = 1e-9;  // kilometres; single precision has less
};

// -- ROMS

/// Source: CF conventions 1.10, appendix D. In metres.
double romsHeight(const std::string& coordinate, double s, double c, double eta, double depth) {
  using namespace roms;
  if (coordinate == "ocean_sigma_coordinate") return eta + s * (depth + eta);
  if (coordinate == "ocean_s_coordinate") {
    const double a = kThetaS, b = kThetaB;
    const double stretching = (1 - b) * std::sinh(a * s) / std::sinh(a) +
                              b * (std::tanh(a * (s + 0.5)) / (2 * std::tanh(a / 2)) - 0.5);
    return eta * (1 + s) + kHc * s + (depth - kHc) * stretching;
  }
  if (coordinate == "ocean_s_coordinate_g1") {
    const double level = kHc * s + (depth - kHc) * c;
    return level + eta * (1 + level / depth);
  }
  const double level = (kHc * s + depth * c) / (kHc + depth);
  return eta + (eta + depth) * level;
}

TEST_P(Netcdf, RomsLevelsFollowTheTerrain) {
  for (const std::string coordinate :
       {"ocean_s_coordinate_g2", "ocean_s_coordinate_g1", "ocean_s_coordinate", "ocean_sigma_coordinate"}) {
    SCOPED_TRACE(coordinate);
    roms::write(path_, GetParam(), coordinate);
    for (const uint32_t step : {0u, 1u}) {
      const auto source = open({}, step);
      EXPECT_EQ(source->description().times, (std::vector<double>{0, 3600}));
      EXPECT_EQ(source->description().time_step, step);
      const auto place = [&](size_t i, size_t j, size_t k) {
        const auto y = static_cast<double>(j), x = static_cast<double>(i);
        return Geographic{roms::longitude(y, x), roms::latitude(y, x),
                          1e-3 * romsHeight(coordinate, roms::sRho(k), roms::csRho(k),
                                            roms::elevation(step, y, x), roms::depth(y, x))};
      };
      expectAll(*source, "temp", [&](size_t i, size_t j, size_t k) {
        return Expected{place(i, j, k), i < 2 && j < 2 ? std::nan("") : roms::value(1, step, k, j, i)};
      });
    }
  }
}

TEST_P(Netcdf, RomsStaggeredPointsHaveCoordinatesOfTheirOwn) {
  const std::string coordinate = "ocean_s_coordinate_g2";
  roms::write(path_, GetParam(), coordinate);
  struct Points {
    const char* name;
    int number;
    double dj, di;
  };
  for (const Points& points : {Points{"u", 3, 0, 0.5}, Points{"v", 4, 0.5, 0}}) {
    SCOPED_TRACE(points.name);
    const auto source = open({points.name}, 1);
    const auto mean = [&](const std::function<double(double, double)>& at, double j, double i) {
      return 0.5 * (at(j, i) + at(j + 2 * points.dj, i + 2 * points.di));
    };
    expectAll(*source, points.name, [&](size_t i, size_t j, size_t k) {
      const auto y = static_cast<double>(j), x = static_cast<double>(i);
      const double eta = mean([](double b, double a) { return roms::elevation(1, b, a); }, y, x);
      const double height =
          romsHeight(coordinate, roms::sRho(k), roms::csRho(k), eta, mean(roms::depth, y, x));
      return Expected{{roms::longitude(y + points.dj, x + points.di),
                       roms::latitude(y + points.dj, x + points.di), 1e-3 * height},
                      roms::value(points.number, 1, k, j, i)};
    });
  }
  const auto source = open({"w"});
  EXPECT_EQ(source->description().blocks.at(0).nk, roms::kLevels + 1);
  expectAll(*source, "w", [&](size_t i, size_t j, size_t k) {
    const auto y = static_cast<double>(j), x = static_cast<double>(i);
    return Expected{{roms::longitude(y, x), roms::latitude(y, x),
                     1e-3 * romsHeight(coordinate, roms::sW(k), roms::csW(k), roms::elevation(0, y, x),
                                       roms::depth(y, x))},
                    roms::value(5, 0, k, j, i)};
  });
}

TEST_P(Netcdf, TheGridIsThatOfTheScalarWanted) {
  roms::write(path_, GetParam(), "ocean_s_coordinate_g2");
  const auto source = open();  // temp and salt are more than u
  const GridDescription& description = source->description();
  EXPECT_EQ(description.blocks.at(0).name, "xi_rho x eta_rho x s_rho");
  EXPECT_EQ(description.blocks[0].ni, roms::kXi);
  EXPECT_EQ(description.blocks[0].nj, roms::kEta);
  EXPECT_EQ(description.blocks[0].nk, roms::kLevels);
  EXPECT_TRUE(description.blocks[0].has_blanking);
  ASSERT_EQ(description.scalars.size(), 2u);
  EXPECT_EQ(description.scalars[0].unit, "unit");
  ASSERT_EQ(description.warnings.size(), 3u);
  EXPECT_NE(description.warnings[0].find("u, on another grid (xi_u x eta_u x s_rho)"), std::string::npos)
      << description.warnings[0];
  EXPECT_EQ(open({"U"})->description().blocks.at(0).ni, roms::kXi - 1);
  EXPECT_EQ(open({"jacobian"})->description().blocks.at(0).ni, roms::kXi);
  EXPECT_NE(errorOf({"temp", "u"}).find("temp and u are on different grids"), std::string::npos)
      << errorOf({"temp", "u"});
}

TEST_P(Netcdf, TheScalarWantedSaysWhichNodesAreThere) {
  roms::write(path_, GetParam(), "ocean_s_coordinate_g2");
  const auto blanked = [&](const std::vector<std::string>& wanted, const std::vector<uint32_t>& read) {
    const auto source = open(wanted);
    NodeArrays nodes;
    source->read(0, {0, roms::kEta, 0, roms::kLevels}, read, nodes);
    return std::count(nodes.blank.begin(), nodes.blank.end(), 1);
  };
  const auto land = static_cast<ptrdiff_t>(4 * roms::kLevels);
  EXPECT_EQ(blanked({}, {}), land);
  EXPECT_EQ(blanked({}, {1}), land);
  EXPECT_EQ(blanked({"temp"}, {0}), land);
  EXPECT_EQ(blanked({"salt"}, {}), 0);
  EXPECT_EQ(blanked({"salt"}, {1}), 0);
}

// -- NEMO

TEST_P(Netcdf, NemoValuesAreUnpackedAndDepthIsDownwards) {
  tolerance_ = 2e-3;  // of single precision, at 6371 km
  for (const bool partial_cells : {false, true}) {
    nemo::write(path_, GetParam(), partial_cells);
    const auto source = open({}, 2);
    ASSERT_EQ(source->description().times, (std::vector<double>{0, 5, 10}));
    EXPECT_EQ(source->description().coordinate_bytes, 4);
    expectAll(*source, "sea_water_potential_temperature", [&](size_t i, size_t j, size_t k) {
      const double depth = partial_cells ? nemo::depth(k, j, i) : nemo::level(k);
      const double value = nemo::packed(2, k, j, i) * nemo::kScale + nemo::kOffset;
      return Expected{{nemo::longitude(j, i), nemo::latitude(j, i), -1e-3 * depth},
                      nemo::land(k, j, i) ? std::nan("") : value};
    });
  }
}

TEST_P(Netcdf, FlatMapsAndScalesAreAsAskedFor) {
  nemo::write(path_, GetParam(), true);
  tolerance_ = 2e-3;
  options_.globe.vertical_scale = 50;
  const ExpectedAt expected = [&](size_t i, size_t j, size_t k) {
    return Expected{
        {nemo::longitude(j, i), nemo::latitude(j, i), -1e-3 * nemo::depth(k, j, i)},
        nemo::land(k, j, i) ? std::nan("") : nemo::packed(0, k, j, i) * nemo::kScale + nemo::kOffset};
  };
  expectAll(*open(), "votemper", expected);
  options_.globe.shape = GlobeOptions::Shape::kSphere;
  options_.globe.radius_km = 1000;
  expectAll(*open(), "votemper", expected);
  options_.globe.radius_km = kRadius;
  options_.globe.shape = GlobeOptions::Shape::kFlat;
  expectAll(*open(), "votemper", expected);
}

// -- WRF

TEST_P(Netcdf, WrfHeightsAreThoseOfTheGeopotential) {
  wrf::write(path_, GetParam());
  tolerance_ = 3e-3;
  const auto geopotential = [](size_t k, size_t j, size_t i) {
    return wrf::geopotentialBase(k, j, i) + wrf::geopotentialPerturbation(1, k, j, i);
  };
  const auto source = open({}, 1);
  EXPECT_EQ(source->description().times, (std::vector<double>{0, 1}));
  expectAll(*source, "T", [&](size_t i, size_t j, size_t k) {
    const double height = 0.5 * (geopotential(k, j, i) + geopotential(k + 1, j, i)) / 9.81;
    const auto y = static_cast<double>(j), x = static_cast<double>(i);
    return Expected{{wrf::longitude(y, x), wrf::latitude(y, x), 1e-3 * height}, wrf::value(1, 1, k, j, i)};
  });

  const auto staggered = open({"U"}, 1);
  ASSERT_EQ(staggered->description().blocks.at(0).ni, wrf::kWest + 1);
  expectAll(*staggered, "U", [&](size_t i, size_t j, size_t k) {
    const auto level = [&](size_t l) {  // half-way between, or beyond the last by as much
      if (i == 0) return 1.5 * geopotential(l, j, 0) - 0.5 * geopotential(l, j, 1);
      if (i == wrf::kWest)
        return 1.5 * geopotential(l, j, wrf::kWest - 1) - 0.5 * geopotential(l, j, wrf::kWest - 2);
      return 0.5 * (geopotential(l, j, i - 1) + geopotential(l, j, i));
    };
    const auto y = static_cast<double>(j), x = static_cast<double>(i) - 0.5;
    return Expected{
        {wrf::longitude(y, x), wrf::latitude(y, x), 1e-3 * 0.5 * (level(k) + level(k + 1)) / 9.81},
        wrf::value(5, 1, k, j, i)};
  });

  // The date line is no edge of the map.
  options_.globe.shape = GlobeOptions::Shape::kFlat;
  tolerance_ = 3e-3;
  expectAll(*open(), "T", [&](size_t i, size_t j, size_t k) {
    const double height =
        0.5 *
        (wrf::geopotentialBase(k, j, i) + wrf::geopotentialPerturbation(0, k, j, i) +
         wrf::geopotentialBase(k + 1, j, i) + wrf::geopotentialPerturbation(0, k + 1, j, i)) /
        9.81;
    const auto y = static_cast<double>(j), x = static_cast<double>(i);
    // The middle, i = 3 and j = 2, is at 181 degrees east: -179.
    return Expected{{wrf::longitude(y, x) - 360, wrf::latitude(y, x), 1e-3 * height},
                    wrf::value(1, 0, k, j, i)};
  });
}

// -- other files

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
    addAxes(file, 300, 301, 2);
    file.variable("value", kSingle, {"alt", "lat", "lon"}, {},
                  [](const Index& n) { return static_cast<double>(n[0] + 2 * n[1] + 700 * n[2]); });
  }
  const auto source = open();
  options_.globe.radius_km = kRadius;
  expectBox(*source, 0, {0, 301, 0, 2}, [](size_t i, size_t j, size_t k) {
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

TEST_P(Netcdf, AGridWithoutAnyValueSaysWhy) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.variable("t", kSingle, {"alt", "lat", "lon"}, {{"valid_min", NetcdfNumberList{200}}},
                  [](const Index&) { return 7.0; });
  }
  const auto source = open();
  const NodeReader reader(*source, {0}, std::nullopt);
  Progress progress;
  try {
    surveyGrid(reader, 1 << 20, nullptr, progress);
    FAIL();
  } catch (const Error& error) {
    const std::string words = error.what();
    EXPECT_NE(words.find("every one of the 24 nodes is blanked"), std::string::npos) << words;
    EXPECT_NE(words.find("t is missing where it is below valid_min 200"), std::string::npos) << words;
  }
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
  EXPECT_NE(errorOf().find("x and y are lengths; --sphere needs degrees"), std::string::npos) << errorOf();
}

TEST_P(Netcdf, WhatIsNoGridIsSaid) {
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.variable("surface", kSingle, {"lat", "lon"}, {}, [](const Index&) { return 1.0; });
  }
  EXPECT_NE(errorOf().find("no variable has three dimensions in space"), std::string::npos) << errorOf();
  {
    NetcdfWriter file(path_, GetParam());
    addAxes(file, 4, 3, 2);
    file.dimension("plev", 2);
    file.variable("plev", kSingle, {"plev"}, {{"units", "kg m-3"}, {"positive", "down"}},
                  [](const Index& n) { return 1e5 - 1e4 * static_cast<double>(n[0]); });
    file.variable("air", kSingle, {"plev", "lat", "lon"}, {}, [](const Index&) { return 1.0; });
  }
  EXPECT_NE(errorOf().find("air: plev has the unit 'kg m-3'; expected a length or a pressure"),
            std::string::npos)
      << errorOf();
  {
    NetcdfWriter file(path_, GetParam());
    file.dimension("a", 4);
    file.dimension("b", 4);
    file.dimension("c", 4);
    file.variable("c", kSingle, {"c"}, {{"units", "1"}}, [](const Index&) { return 1.0; });
    file.variable("bare", kSingle, {"a", "b", "c"}, {}, [](const Index&) { return 1.0; });
  }
  EXPECT_NE(errorOf().find("no longitude and latitude, or x and y, on its dimensions a, b, c"),
            std::string::npos)
      << errorOf();
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
  EXPECT_NE(errorOf().find("do not vary along exactly two of its dimensions alt, more, cell"),
            std::string::npos)
      << errorOf();
}

TEST_P(Netcdf, WrongStepsAndMoreFilesAreRefused) {
  nemo::write(path_, GetParam(), false);
  EXPECT_NE(errorOf({}, 3).find("has 3 time steps; --time-step 3 is out of range"), std::string::npos)
      << errorOf({}, 3);
  std::ofstream(folder_ / "more.q") << "no NetCDF, but longer than a signature";
  options_.solutions = {folder_ / "more.q"};
  EXPECT_NE(errorOf().find("is not a NetCDF file; expected one"), std::string::npos) << errorOf();
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

INSTANTIATE_TEST_SUITE_P(Types, Netcdf,
                         testing::Values(NetcdfFileType::kClassic, NetcdfFileType::kNetcdf4,
                                         NetcdfFileType::kNetcdf4Compressed),
                         [](const auto& type) {
                           return type.param == NetcdfFileType::kClassic   ? "Classic"
                                  : type.param == NetcdfFileType::kNetcdf4 ? "Netcdf4"
                                                                           : "Compressed";
                         });

}  // namespace
}  // namespace curvisplat
