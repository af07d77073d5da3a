// Trajectories in NetCDF files: each of the ways that the CF conventions have, and what is refused.
#include "preprocess/formats/netcdf/cf_trajectories.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>

#include "stream/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/netcdf_writer.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

using ElementIndex = std::vector<size_t>;
constexpr auto kDoubleNumbers = NetcdfNumbers::kDoublePrecision;
constexpr double kFillNumber = -9999;

/// Line n has n + 2 places.
constexpr std::array<size_t, 3> kLengths{2, 3, 4};
constexpr size_t kPlaces = 9, kLongest = 4;

double longitudeOf(size_t line, size_t n) {
  return 10.0 * static_cast<double>(line) + static_cast<double>(n);
}
double depthOf(size_t line, size_t n) {
  return 100.0 * static_cast<double>(line) + 10.0 * static_cast<double>(n);
}
double timeOf(size_t line, size_t n) {
  return static_cast<double>(line + 2 * n);
}

/// The line and the place along it of each observation, one line after the other.
std::vector<std::pair<size_t, size_t>> observations() {
  std::vector<std::pair<size_t, size_t>> all;
  for (size_t line = 0; line < kLengths.size(); ++line)
    for (size_t n = 0; n < kLengths[line]; ++n) all.emplace_back(line, n);
  return all;
}

using OfPlace = std::function<double(size_t line, size_t n)>;

/// The four variables of each observation; `placed` gives a function of the file's indices.
void addVariables(NetcdfWriter& file, const std::vector<std::string>& dims,
                  const std::function<NetcdfFunction(const OfPlace&)>& placed) {
  const NetcdfDoubleList fill{{kFillNumber}};
  file.variable("time", kDoubleNumbers, dims, {{"units", "hours since 2001-01-01"}, {"_FillValue", fill}},
                placed(timeOf));
  file.variable("lon", kDoubleNumbers, dims, {{"units", "degrees_east"}, {"_FillValue", fill}},
                placed(longitudeOf));
  file.variable("lat", kDoubleNumbers, dims, {{"units", "degrees_north"}, {"_FillValue", fill}},
                placed([](size_t line, size_t) { return 5.0 * static_cast<double>(line); }));
  file.variable("z", kDoubleNumbers, dims,
                {{"standard_name", "depth"}, {"units", "m"}, {"positive", "down"}, {"_FillValue", fill}},
                placed(depthOf));
}

class Trajectories : public testing::TestWithParam<NetcdfFileType> {
 protected:
  void expectAll(const std::string& scalar = "", const OfPlace& value = {}) const {
    const CfTrajectories read = readCfTrajectories(path_, scalar);
    EXPECT_TRUE(read.degrees);
    EXPECT_EQ(read.begins, (std::vector<uint32_t>{0, 2, 5, 9}));
    EXPECT_EQ(read.time_unit.name, "hours since 2001-01-01");
    ASSERT_EQ(read.points.size(), kPlaces);
    ASSERT_EQ(read.times.size(), kPlaces);
    ASSERT_EQ(read.values.size(), scalar.empty() ? 0 : kPlaces);
    size_t at = 0;
    for (const auto& [line, n] : observations()) {
      EXPECT_EQ(read.points[at].x, longitudeOf(line, n)) << at;
      EXPECT_EQ(read.points[at].y, 5.0 * static_cast<double>(line)) << at;
      EXPECT_NEAR(read.points[at].z, -1e-3 * depthOf(line, n), 1e-12) << at;
      EXPECT_EQ(read.times[at], timeOf(line, n)) << at;
      if (!scalar.empty()) {
        EXPECT_EQ(read.values[at], static_cast<float>(value(line, n))) << at;
      }
      ++at;
    }
  }
  std::string refusal(const std::string& scalar = "") const {
    return curvisplat::errorOf([&] { readCfTrajectories(path_, scalar); });
  }

  TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "file.nc";
};

TEST_P(Trajectories, OfIncompleteArrays) {
  for (const bool lines_first : {true, false}) {
    {
      NetcdfWriter file(path_, GetParam());
      file.dimension("trajectory", kLengths.size());
      file.dimension("obs", kLongest);
      file.variable("trajectory", kDoubleNumbers, {"trajectory"}, {{"cf_role", "trajectory_id"}},
                    [](const ElementIndex& n) { return static_cast<double>(n[0]); });
      const std::vector<std::string> dims = lines_first ? std::vector<std::string>{"trajectory", "obs"}
                                                        : std::vector<std::string>{"obs", "trajectory"};
      addVariables(file, dims, [&](const OfPlace& of) {
        return [&, of](const ElementIndex& index) {
          const size_t line = index[lines_first ? 0 : 1], n = index[lines_first ? 1 : 0];
          return n < kLengths[line] ? of(line, n) : kFillNumber;
        };
      });
    }
    expectAll("z", depthOf);
    expectAll("trajectory", [](size_t line, size_t) { return static_cast<double>(line); });
  }
}

TEST_P(Trajectories, OfOneTimeForAll) {
  // As OpenDrift writes them: what has not begun, and what has ended, is missing.
  {
    NetcdfWriter file(path_, GetParam());
    file.dimension("trajectory", 2);
    file.dimension("time", 4);
    file.variable("time", kDoubleNumbers, {"time"}, {{"units", "seconds since 2001-01-01"}},
                  [](const ElementIndex& n) { return 3600.0 * static_cast<double>(n[0]); });
    const NetcdfDoubleList fill{{kFillNumber}};
    const auto where = [](double missing_at) {
      return [=](const ElementIndex& n) {
        const bool missing = n[0] == 0 ? n[1] == 0 : static_cast<double>(n[1]) == missing_at;
        return missing ? kFillNumber : static_cast<double>(10 * n[0] + n[1]);
      };
    };
    file.variable("lon", kDoubleNumbers, {"trajectory", "time"},
                  {{"standard_name", "longitude"}, {"_FillValue", fill}}, where(2));
    file.variable("lat", kDoubleNumbers, {"trajectory", "time"},
                  {{"standard_name", "latitude"}, {"_FillValue", fill}}, where(2));
    file.variable("z", kDoubleNumbers, {"trajectory", "time"},
                  {{"standard_name", "z"}, {"units", "m"}, {"positive", "up"}},
                  [](const ElementIndex&) { return -20.0; });
  }
  const CfTrajectories read = readCfTrajectories(path_, "");
  EXPECT_EQ(read.begins, (std::vector<uint32_t>{0, 3, 5, 6})) << "a gap ends a line";
  EXPECT_EQ(read.times, (std::vector<double>{3600, 7200, 10800, 0, 3600, 10800}));
  EXPECT_EQ(read.points[0], glm::dvec3(1, 1, -0.02));
}

TEST_P(Trajectories, OfContiguousRaggedArrays) {
  {
    NetcdfWriter file(path_, GetParam());
    file.dimension("drifter", kLengths.size());
    file.dimension("obs", kPlaces);
    file.variable("rowsize", NetcdfNumbers::kInt32, {"drifter"}, {{"sample_dimension", "obs"}},
                  [](const ElementIndex& n) { return static_cast<double>(kLengths[n[0]]); });
    file.variable("mass", kDoubleNumbers, {"drifter"}, {},
                  [](const ElementIndex& n) { return 1.5 * static_cast<double>(n[0]); });
    addVariables(file, {"obs"}, [](const OfPlace& of) {
      return [of](const ElementIndex& index) {
        const auto [line, n] = observations()[index[0]];
        return of(line, n);
      };
    });
  }
  expectAll("lon", longitudeOf);
  expectAll("mass", [](size_t line, size_t) { return 1.5 * static_cast<double>(line); });
  EXPECT_EQ(refusal("mas"), path_.string() +
                                ": has no variable 'mas' (did you mean mass?) along its trajectories; "
                                "it has rowsize, mass, time, lon, lat, z");
}

TEST_P(Trajectories, MayHaveOneDepthEach) {
  for (const size_t lines : {kLengths.size(), kPlaces + 1}) {  // fewer than observations, and more
    {
      NetcdfWriter file(path_, GetParam());
      file.dimension("drifter", lines);
      file.dimension("obs", kPlaces);
      file.variable("rowsize", NetcdfNumbers::kInt32, {"drifter"}, {{"sample_dimension", "obs"}},
                    [](const ElementIndex& n) {
                      return n[0] < kLengths.size() ? static_cast<double>(kLengths[n[0]]) : 0;
                    });
      file.variable("lon", kDoubleNumbers, {"obs"}, {{"units", "degrees_east"}},
                    [](const ElementIndex&) { return 1.0; });
      file.variable("lat", kDoubleNumbers, {"obs"}, {{"units", "degrees_north"}},
                    [](const ElementIndex&) { return 1.0; });
      file.variable("z", kDoubleNumbers, {"drifter"}, {{"units", "m"}, {"positive", "down"}},
                    [](const ElementIndex& n) { return depthOf(n[0], 0); });
    }
    const CfTrajectories read = readCfTrajectories(path_, "");
    ASSERT_EQ(read.points.size(), kPlaces);
    for (size_t at = 0; at < kPlaces; ++at)
      EXPECT_NEAR(read.points[at].z, -1e-3 * depthOf(observations()[at].first, 0), 1e-12) << at;
  }
}

TEST_P(Trajectories, OfIndexedRaggedArraysInAnyOrder) {
  // The places of all lines by turns, the last ones first.
  for (const char* const attribute : {"instance_dimension", "cf_role"}) {
    {
      NetcdfWriter file(path_, GetParam());
      file.dimension("obs", kPlaces);
      file.dimension("drifter", kLengths.size());
      auto order = observations();
      std::stable_sort(order.begin(), order.end(),
                       [](const auto& a, const auto& b) { return a.second > b.second; });
      const auto placed = [order](const OfPlace& of) {
        return [of, order](const ElementIndex& index) {
          return of(order[index[0]].first, order[index[0]].second);
        };
      };
      addVariables(file, {"obs"}, placed);
      file.variable("number", NetcdfNumbers::kInt32, {"obs"},
                    {{attribute, attribute == std::string("cf_role") ? "trajectory_id" : "drifter"}},
                    placed([](size_t line, size_t) { return static_cast<double>(line); }));
    }
    expectAll();
  }
}

TEST_P(Trajectories, WhatIsNoneIsRefused) {
  {
    NetcdfWriter file(path_, GetParam());
    file.dimension("obs", 2);
    file.variable("lon", kDoubleNumbers, {"obs"}, {{"units", "degrees_east"}},
                  [](const ElementIndex&) { return 1.0; });
  }
  EXPECT_EQ(
      refusal(),
      path_.string() +
          ": has no trajectories: no longitude and latitude, or x and y, of one or two common dimensions");
  {
    NetcdfWriter file(path_, GetParam());
    file.dimension("obs", 2);
    file.dimension("drifter", 1);
    file.variable("rowsize", kDoubleNumbers, {"drifter"}, {{"sample_dimension", "obs"}},
                  [](const ElementIndex&) { return 3.0; });
    file.variable("lon", kDoubleNumbers, {"obs"}, {{"units", "degrees_east"}},
                  [](const ElementIndex&) { return 1.0; });
    file.variable("lat", kDoubleNumbers, {"obs"}, {{"units", "degrees_north"}},
                  [](const ElementIndex&) { return 1.0; });
  }
  EXPECT_EQ(refusal(), path_.string() + ": rowsize is 3 for a trajectory; expected up to 2 observations");
  std::ofstream(path_) << "none";
  EXPECT_FALSE(isTrajectoryFile(path_));
}

TEST_P(Trajectories, AlongOneDimensionTwiceAreNone) {
  const auto number = [](const ElementIndex& n) { return static_cast<double>(n[0]); };
  const auto write = [&](const std::vector<std::string>& of_places,
                         const std::vector<std::string>& of_times) {
    NetcdfWriter file(path_, GetParam());
    file.dimension("obs", 3);
    file.variable("lon", kDoubleNumbers, of_places, {{"units", "degrees_east"}}, number);
    file.variable("lat", kDoubleNumbers, of_places, {{"units", "degrees_north"}}, number);
    file.variable("time", kDoubleNumbers, of_times, {{"units", "hours since 2001-01-01"}}, number);
  };
  write({"obs", "obs"}, {"obs"});
  EXPECT_EQ(
      refusal(),
      path_.string() +
          ": has no trajectories: no longitude and latitude, or x and y, of one or two common dimensions");
  write({"obs"}, {"obs", "obs"});
  EXPECT_TRUE(readCfTrajectories(path_, "").times.empty());
}

INSTANTIATE_TEST_SUITE_P(Files, Trajectories,
                         testing::Values(NetcdfFileType::kClassic, NetcdfFileType::kNetcdf4,
                                         NetcdfFileType::kNetcdf4Compressed),
                         [](const auto& type) {
                           return type.param == NetcdfFileType::kClassic   ? "Classic"
                                  : type.param == NetcdfFileType::kNetcdf4 ? "Netcdf4"
                                                                           : "Compressed";
                         });

}  // namespace
}  // namespace curvisplat
