// A NetCDF file of each type, opened as a grid, and every node's place and value against what is expected.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

inline constexpr double kRadius = 6371;

struct Geographic {
  double longitude, latitude, height_km;
};

struct Expected {
  Geographic place;
  double value;  // NaN: none
};

using ExpectedAt = std::function<Expected(size_t i, size_t j, size_t k)>;

inline double radians(double degrees) {
  return degrees * std::numbers::pi / 180;
}

class NetcdfFixture : public testing::TestWithParam<NetcdfFileType> {
 protected:
  std::unique_ptr<GridSource> open(const std::vector<std::string>& scalars = {}, uint32_t step = 0) const {
    OpenGridOptions options = options_;
    options.grid = path_;
    options.scalars = scalars;
    if (step > 0) options.time_step = step;
    return openGrid(options);
  }

  std::string errorOf(const std::vector<std::string>& scalars = {}, uint32_t step = 0) const {
    return curvisplat::errorOf([&] { open(scalars, step); });
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
    expectPartsOfRows(source, std::span(&position, 1));
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "file.nc";
  OpenGridOptions options_;
  double tolerance_ = 1e-9;  // kilometres; single precision has less
};

inline std::string nameOf(const testing::TestParamInfo<NetcdfFileType>& type) {
  return type.param == NetcdfFileType::kClassic   ? "Classic"
         : type.param == NetcdfFileType::kNetcdf4 ? "Netcdf4"
                                                  : "Compressed";
}

/// Every type of file.
inline const auto kNetcdfTypes =
    testing::Values(NetcdfFileType::kClassic, NetcdfFileType::kNetcdf4, NetcdfFileType::kNetcdf4Compressed);

}  // namespace curvisplat
