#include "tests/support/earth_files.h"

#include <cmath>

namespace curvisplat {
namespace {

using Index = std::vector<size_t>;

constexpr auto kSingle = NetcdfNumbers::kSinglePrecision;
constexpr auto kDouble = NetcdfNumbers::kDoublePrecision;

}  // namespace

namespace roms {

double longitude(double j, double i) {
  return -10 + 0.5 * i + 0.1 * j;
}

double latitude(double j, double i) {
  return 40 + 0.4 * j - 0.05 * i;
}

double depth(double j, double i) {
  return 60 + 10 * i + 3 * i * j;
}

double elevation(size_t time, double j, double i) {
  return 0.5 * static_cast<double>(time) + 0.1 * j - 0.02 * i;
}

double sRho(size_t k) {
  return (static_cast<double>(k) + 0.5) / static_cast<double>(kLevels) - 1;
}

double sW(size_t k) {
  return static_cast<double>(k) / static_cast<double>(kLevels) - 1;
}

double csRho(size_t k) {
  return -sRho(k) * sRho(k);
}

double csW(size_t k) {
  return -sW(k) * sW(k);
}

double value(int variable, size_t time, size_t k, size_t j, size_t i) {
  return variable + 0.25 * static_cast<double>(time) + 4.0 * static_cast<double>(k) +
         32.0 * static_cast<double>(j) + 256.0 * static_cast<double>(i);
}

void write(const std::filesystem::path& path, NetcdfFileType type, const std::string& coordinate) {
  NetcdfWriter file(path, type);
  file.attribute("type", "ROMS/TOMS history file");
  file.dimension("xi_rho", kXi);
  file.dimension("xi_u", kXi - 1);
  file.dimension("eta_rho", kEta);
  file.dimension("eta_u", kEta);
  file.dimension("eta_v", kEta - 1);
  file.dimension("xi_v", kXi);
  file.dimension("s_rho", kLevels);
  file.dimension("s_w", kLevels + 1);
  file.dimension("ocean_time", kTimes, true);

  const auto scalar = [&](const char* name, double number) {
    file.variable(name, kDouble, {}, {}, [=](const Index&) { return number; });
  };
  scalar("hc", kHc);
  scalar("theta_s", kThetaS);
  scalar("theta_b", kThetaB);
  const std::string letter = coordinate == "ocean_sigma_coordinate" ? "sigma" : "s";
  const auto level = [&](const char* name, const char* curve, double (*s)(size_t), double (*c)(size_t)) {
    std::string terms = letter + ": " + name + " eta: zeta depth: h depth_c: hc";
    terms += coordinate == "ocean_s_coordinate" ? " a: theta_s b: theta_b" : std::string(" C: ") + curve;
    file.variable(name, kDouble, {name},
                  {{"standard_name", coordinate}, {"positive", "up"}, {"formula_terms", terms}},
                  [=](const Index& n) { return s(n[0]); });
    file.variable(curve, kDouble, {name}, {}, [=](const Index& n) { return c(n[0]); });
  };
  level("s_rho", "Cs_r", sRho, csRho);
  level("s_w", "Cs_w", sW, csW);
  file.variable("ocean_time", kDouble, {"ocean_time"}, {{"units", "seconds since 2001-01-01"}},
                [](const Index& n) { return 3600.0 * static_cast<double>(n[0]); });

  const auto horizontal = [&](const std::string& name, const std::vector<std::string>& dims,
                              const NetcdfAttributes& attributes, double (*at)(double, double), double dj,
                              double di) {
    file.variable(name, kDouble, dims, attributes, [=](const Index& n) {
      return at(static_cast<double>(n[0]) + dj, static_cast<double>(n[1]) + di);
    });
  };
  struct Points {
    std::string name, eta, xi;
    double dj, di;
  };
  for (const Points& points : {Points{"rho", "eta_rho", "xi_rho", 0, 0}, Points{"u", "eta_u", "xi_u", 0, 0.5},
                               Points{"v", "eta_v", "xi_v", 0.5, 0}}) {
    horizontal("lon_" + points.name, {points.eta, points.xi}, {{"units", "degree_east"}}, longitude,
               points.dj, points.di);
    horizontal("lat_" + points.name, {points.eta, points.xi}, {{"units", "degree_north"}}, latitude,
               points.dj, points.di);
  }
  horizontal("h", {"eta_rho", "xi_rho"}, {{"units", "meter"}}, depth, 0, 0);
  file.variable(
      "zeta", kDouble, {"ocean_time", "eta_rho", "xi_rho"}, {{"units", "meter"}},
      [](const Index& n) { return elevation(n[0], static_cast<double>(n[1]), static_cast<double>(n[2])); });

  const auto field = [&](const char* name, int number, const std::vector<std::string>& dims,
                         const char* coordinates, bool land) {
    NetcdfAttributes attributes = {{"_FillValue", NetcdfNumberList{kFill}}, {"units", "unit"}};
    if (*coordinates) attributes.emplace_back("coordinates", coordinates);
    file.variable(name, kSingle, dims, attributes, [=](const Index& n) {
      return land && n[2] < 2 && n[3] < 2 ? kFill : value(number, n[0], n[1], n[2], n[3]);
    });
  };
  field("u", 3, {"ocean_time", "s_rho", "eta_u", "xi_u"}, "", false);
  field("temp", 1, {"ocean_time", "s_rho", "eta_rho", "xi_rho"}, "lon_rho lat_rho s_rho ocean_time", true);
  field("salt", 2, {"ocean_time", "s_rho", "eta_rho", "xi_rho"}, "lon_rho lat_rho s_rho ocean_time", false);
  field("v", 4, {"ocean_time", "s_rho", "eta_v", "xi_v"}, "lon_v lat_v s_rho ocean_time", false);
  field("w", 5, {"ocean_time", "s_w", "eta_rho", "xi_rho"}, "lon_rho lat_rho s_w ocean_time", false);
}

}  // namespace roms

namespace nemo {

double longitude(size_t j, size_t i) {
  return 3 + 0.25 * static_cast<double>(i) + 0.125 * static_cast<double>(j);
}

double latitude(size_t j, size_t i) {
  return 55 + 0.25 * static_cast<double>(j) - 0.0625 * static_cast<double>(i);
}

double level(size_t k) {
  return 5.0 * static_cast<double>((k + 1) * (k + 1));
}

double depth(size_t k, size_t j, size_t i) {
  return level(k) - (k + 1 == kLevels ? static_cast<double>(i + j) : 0);
}

double packed(size_t time, size_t k, size_t j, size_t i) {
  return static_cast<double>(100 * time + 10 * k + 3 * j + i) - 200;
}

bool land(size_t k, size_t j, size_t i) {
  return i + j + 2 * k < 4;
}

void write(const std::filesystem::path& path, NetcdfFileType type, bool partial_cells) {
  constexpr double kNone = -32767;
  NetcdfWriter file(path, type);
  file.dimension("x", kX);
  file.dimension("y", kY);
  file.dimension("deptht", kLevels);
  file.dimension("time_counter", kTimes, true);
  file.variable("nav_lon", kSingle, {"y", "x"}, {{"units", "degrees_east"}},
                [](const Index& n) { return longitude(n[0], n[1]); });
  file.variable("nav_lat", kSingle, {"y", "x"}, {{"units", "degrees_north"}},
                [](const Index& n) { return latitude(n[0], n[1]); });
  file.variable("deptht", kSingle, {"deptht"}, {{"units", "m"}, {"positive", "down"}},
                [](const Index& n) { return level(n[0]); });
  file.variable("time_counter", kDouble, {"time_counter"}, {{"units", "days since 1950-01-01"}},
                [](const Index& n) { return 5.0 * static_cast<double>(n[0]); });
  if (partial_cells)
    file.variable("gdept_0", kSingle, {"deptht", "y", "x"}, {{"units", "m"}},
                  [](const Index& n) { return depth(n[0], n[1], n[2]); });
  file.variable("sossheig", kSingle, {"time_counter", "y", "x"}, {{"units", "m"}},
                [](const Index&) { return 0.5; });
  file.variable(
      "votemper", NetcdfNumbers::kInt16, {"time_counter", "deptht", "y", "x"},
      {{"_FillValue", NetcdfNumberList{kNone}},
       {"scale_factor", NetcdfNumberList{kScale}},
       {"add_offset", NetcdfNumberList{kOffset}},
       {"standard_name", "sea_water_potential_temperature"},
       {"units", "degC"},
       {"coordinates", "time_counter deptht nav_lat nav_lon"}},
      [](const Index& n) { return land(n[1], n[2], n[3]) ? kNone : packed(n[0], n[1], n[2], n[3]); });
}

}  // namespace nemo

namespace wrf {

double longitude(double j, double i) {
  return 170 + 4 * i - 0.5 * j;
}

double latitude(double j, double i) {
  return -20 + 2 * j + 0.25 * i;
}

double geopotentialBase(size_t k, size_t j, size_t i) {
  return 9.81 *
         (500.0 * static_cast<double>(k) + 20.0 * static_cast<double>(i) + 5.0 * static_cast<double>(j));
}

double geopotentialPerturbation(size_t time, size_t k, size_t j, size_t i) {
  return 9.81 * (static_cast<double>(time + k) + 0.5 * static_cast<double>(i * j));
}

double value(int variable, size_t time, size_t k, size_t j, size_t i) {
  return variable * 1000 + static_cast<double>(500 * time + 100 * k + 10 * j + i);
}

void write(const std::filesystem::path& path, NetcdfFileType type) {
  NetcdfWriter file(path, type);
  file.dimension("Time", kTimes, true);
  file.dimension("west_east", kWest);
  file.dimension("west_east_stag", kWest + 1);
  file.dimension("south_north", kSouth);
  file.dimension("bottom_top", kBottom);
  file.dimension("bottom_top_stag", kBottom + 1);
  const auto wrapped = [](double degrees) { return degrees > 180 ? degrees - 360 : degrees; };
  const auto place = [&](const char* name, const char* west, const char* units,
                         const std::function<double(double, double)>& at, double di) {
    file.variable(name, kSingle, {"Time", "south_north", west}, {{"units", units}}, [=](const Index& n) {
      return at(static_cast<double>(n[1]), static_cast<double>(n[2]) + di);
    });
  };
  const auto east = [=](double j, double i) { return wrapped(longitude(j, i)); };
  place("XLONG", "west_east", "degree_east", east, 0);
  place("XLAT", "west_east", "degree_north", latitude, 0);
  place("XLONG_U", "west_east_stag", "degree_east", east, -0.5);
  place("XLAT_U", "west_east_stag", "degree_north", latitude, -0.5);
  file.variable("PH", kDouble, {"Time", "bottom_top_stag", "south_north", "west_east"}, {{"units", "m2 s-2"}},
                [](const Index& n) { return geopotentialPerturbation(n[0], n[1], n[2], n[3]); });
  file.variable("PHB", kDouble, {"Time", "bottom_top_stag", "south_north", "west_east"},
                {{"units", "m2 s-2"}}, [](const Index& n) { return geopotentialBase(n[1], n[2], n[3]); });
  const auto field = [&](const char* name, int number, const char* bottom, const char* west,
                         const char* coordinates) {
    file.variable(name, kSingle, {"Time", bottom, "south_north", west},
                  {{"units", "K"}, {"coordinates", coordinates}},
                  [=](const Index& n) { return value(number, n[0], n[1], n[2], n[3]); });
  };
  field("T", 1, "bottom_top", "west_east", "XLONG XLAT XTIME");
  field("QVAPOR", 2, "bottom_top", "west_east", "XLONG XLAT XTIME");
  field("P", 3, "bottom_top", "west_east", "XLONG XLAT XTIME");
  field("PB", 4, "bottom_top", "west_east", "XLONG XLAT XTIME");
  field("U", 5, "bottom_top", "west_east_stag", "XLONG_U XLAT_U XTIME");
}

}  // namespace wrf

}  // namespace curvisplat
