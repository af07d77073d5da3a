// NetCDF files as models of the ocean and the atmosphere write them: every node's place and value, against
// the conventions' formulas written down here once more.
#include <gtest/gtest.h>

#include <cmath>

#include "preprocess/convert/scan.h"
#include "tests/preprocess/netcdf_fixture.h"
#include "tests/support/earth_files.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

class NetcdfModels : public NetcdfFixture {};

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

TEST_P(NetcdfModels, RomsLevelsFollowTheTerrain) {
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

TEST_P(NetcdfModels, RomsStaggeredPointsHaveCoordinatesOfTheirOwn) {
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

TEST_P(NetcdfModels, TheGridIsThatOfTheScalarWanted) {
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
  ASSERT_GE(description.warnings.size(), 3u);  // and one of coarse cells on the sphere
  expectSays(description.warnings[0], "u, on another grid (xi_u, eta_u, s_rho)");
  EXPECT_EQ(open({"U"})->description().blocks.at(0).ni, roms::kXi - 1);
  EXPECT_EQ(open({"jacobian"})->description().blocks.at(0).ni, roms::kXi);
  expectSays(errorOf({"temp", "u"}), "temp and u are on different grids");
}

TEST_P(NetcdfModels, TheScalarWantedSaysWhichNodesAreThere) {
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

TEST_P(NetcdfModels, NemoValuesAreUnpackedAndDepthIsDownwards) {
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

TEST_P(NetcdfModels, FlatMapsAndScalesAreAsAskedFor) {
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

TEST_P(NetcdfModels, WrfHeightsAreThoseOfTheGeopotential) {
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

INSTANTIATE_TEST_SUITE_P(Types, NetcdfModels, kNetcdfTypes, nameOf);

}  // namespace
}  // namespace curvisplat
