#include "preprocess/formats/netcdf/cf_coordinates.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "stream/base/text.h"

namespace curvisplat {

bool isOneOf(std::string_view text, std::initializer_list<std::string_view> words) {
  return std::find(words.begin(), words.end(), text) != words.end();
}

namespace {

bool beginsWithOneOf(std::string_view text, std::initializer_list<std::string_view> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](std::string_view word) { return text.starts_with(word); });
}

bool hasOneOf(std::string_view text, std::initializer_list<std::string_view> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](std::string_view word) { return text.find(word) != std::string_view::npos; });
}

bool isVerticalName(std::string_view standard_name) {
  return isOneOf(standard_name, {"depth", "height", "altitude", "geopotential_height", "model_level_number",
                                 "depth_below_geoid", "air_pressure", "hybrid_sigma_pressure",
                                 "mid_layer_heights", "mid_level_pressure"}) ||
         beginsWithOneOf(standard_name, {"height_above_", "ocean_s", "ocean_double_sigma", "atmosphere_"});
}

/// The axis of a customary short name: x, xh, xc, x1, ...; x1, x2, x3 are x, y, z. 0: of none.
char axisOfName(const std::string& name) {
  if (name.empty() || name.size() > 2) return 0;
  if (isOneOf(name, {"x1", "x2", "x3"})) return static_cast<char>('x' + (name[1] - '1'));
  const bool lone = name.size() == 1 || (name[1] >= 'a' && name[1] <= 'z');
  return lone && name[0] >= 'x' && name[0] <= 'z' ? name[0] : '\0';
}

/// Customary variable names of programs that write no attributes. `coordinate`: it has the name of its dimension.
CfRole roleByName(const std::string& name, bool length, bool coordinate) {
  if (beginsWithOneOf(name, {"lon", "nav_lon", "xlong", "glam"})) return CfRole::kLongitude;
  if (beginsWithOneOf(name, {"lat", "nav_lat", "xlat", "gphi"})) return CfRole::kLatitude;
  if (isOneOf(name, {"time", "ocean_time", "time_counter"})) return CfRole::kTime;
  if (!length) return CfRole::kNone;
  const char axis = coordinate || name.size() == 1 ? axisOfName(name) : '\0';
  if (axis == 'x' || name.starts_with("x_")) return CfRole::kX;
  if (axis == 'y' || name.starts_with("y_")) return CfRole::kY;
  if (beginsWithOneOf(name, {"depth", "gdep", "height", "altitude", "z_rho", "z_w", "z_r", "lev"}) ||
      axis == 'z')
    return CfRole::kVertical;
  return CfRole::kNone;
}

}  // namespace

CfRole cfRole(const NetcdfFiles& file, const NetcdfVariable& variable) {
  if (!variable.numeric) return CfRole::kNone;
  const std::string standard_name = lowerCase(variable.text("standard_name")),
                    units = lowerCase(variable.text("units"));
  const std::string axis = lowerCase(variable.text("axis"));
  if (standard_name == "grid_longitude") return CfRole::kGridLongitude;
  if (standard_name == "grid_latitude") return CfRole::kGridLatitude;
  if (isOneOf(units, {"degrees_east", "degree_east", "degree_e", "degrees_e", "degreee", "degreese"}) ||
      isOneOf(standard_name, {"longitude", "geographic_longitude"}))
    return CfRole::kLongitude;
  if (isOneOf(units, {"degrees_north", "degree_north", "degree_n", "degrees_n", "degreen", "degreesn"}) ||
      isOneOf(standard_name, {"latitude", "geographic_latitude"}))
    return CfRole::kLatitude;
  // Angles that only a long_name tells: "longitude", but not "longitude in rotated pole grid".
  if (standard_name.empty() && (degreesOf(units) != 1 || isOneOf(units, {"degrees", "degree", "deg"}))) {
    const std::string long_name = lowerCase(variable.text("long_name"));
    const bool rotated = hasOneOf(long_name, {"rotated"});
    if (!rotated && hasOneOf(long_name, {"longitude"})) return CfRole::kLongitude;
    if (!rotated && hasOneOf(long_name, {"latitude"})) return CfRole::kLatitude;
  }
  if (standard_name == "time" || units.find(" since ") != std::string::npos) return CfRole::kTime;

  const bool length = kilometresOf(units).has_value(), pressure = pascalsOf(units).has_value();
  // A variable with the name of its dimension is a coordinate variable, and may have an `axis`.
  const bool coordinate = variable.dims.size() == 1 && file.dimension(variable, 0).name == variable.name;
  if (isVerticalName(standard_name) || !variable.text("formula_terms").empty() ||
      (coordinate && (axis == "z" || pressure || !variable.text("positive").empty())))
    return CfRole::kVertical;
  const CfRole named = roleByName(lowerCase(variable.name), length || isUnitless(units), coordinate);
  // Simulations without dimensions have coordinates without a unit.
  const bool of_plane =
      length || (isUnitless(units) && named != CfRole::kLongitude && named != CfRole::kLatitude);
  if (isOneOf(standard_name, {"projection_x_coordinate", "plane_x_coordinate"}) || (axis == "x" && of_plane))
    return CfRole::kX;
  if (isOneOf(standard_name, {"projection_y_coordinate", "plane_y_coordinate"}) || (axis == "y" && of_plane))
    return CfRole::kY;
  if (coordinate && axis == "t") return CfRole::kTime;
  if (!standard_name.empty()) return CfRole::kNone;
  if (length && !variable.text("positive").empty()) return CfRole::kVertical;
  return named;
}

bool isTimeAlong(const NetcdfFiles& file, const NetcdfVariable& variable, size_t dim) {
  return variable.dims == std::vector{dim} && cfRole(file, variable) == CfRole::kTime &&
         isOneOf(lowerCase(variable.text("standard_name")), {"", "time"});
}

bool isUnitless(const std::string& unit) {
  return isOneOf(lowerCase(unit), {"", "1", "-", "none", "unitless", "dimensionless", "nondimensional",
                                   "non-dimensional", "nondim", "[-]"});
}

double degreesOf(const std::string& unit) {
  return isOneOf(lowerCase(unit), {"radian", "radians", "rad"}) ? 180 / std::numbers::pi : 1;
}

namespace {

/// A unit without capitals, brackets and the factor before it: "[hPa]", "1000 m".
struct Unit {
  std::string word;
  double factor = 1;
};

Unit unitOf(const std::string& text) {
  std::string word = lowerCase(text);
  if (word.size() > 2 && (word[0] == '[' || word[0] == '(')) word = word.substr(1, word.size() - 2);
  std::replace(word.begin(), word.end(), '_', ' ');
  double factor = 1;
  const auto read = std::from_chars(word.data(), word.data() + word.size(), factor);
  if (read.ec != std::errc() || !std::isfinite(factor) || factor <= 0) return {word, 1};
  return {std::string(trimmed(read.ptr)), factor};
}

}  // namespace

std::optional<double> kilometresOf(const std::string& unit) {
  auto [word, factor] = unitOf(unit);
  // "meters MSL", "m above sea level"; but not "m s-1"
  if (const size_t blank = word.find(' '); blank != std::string::npos)
    if (beginsWithOneOf(std::string_view(word).substr(blank + 1),
                        {"msl", "amsl", "asl", "agl", "above ", "below "}))
      word.resize(blank);
  if (isOneOf(word, {"ft", "foot", "feet"})) return factor * 0.3048e-3;
  if (isOneOf(word, {"fathom", "fathoms"})) return factor * 1.8288e-3;
  if (isOneOf(word, {"mile", "miles"})) return factor * 1.609344;
  if (unit == "Mm") return 1e3;
  constexpr std::pair<std::string_view, double> kPrefixes[] = {
      {"kilo", 1},     {"hecto", 0.1},  {"deca", 1e-2}, {"deka", 1e-2}, {"deci", 1e-4},
      {"centi", 1e-5}, {"milli", 1e-6}, {"k", 1},       {"h", 0.1},     {"da", 1e-2},
      {"d", 1e-4},     {"c", 1e-5},     {"m", 1e-6},    {"", 1e-3}};
  for (const auto& [prefix, kilometres] : kPrefixes) {
    if (!word.starts_with(prefix)) continue;
    const std::string_view rest = std::string_view(word).substr(prefix.size());
    if (prefix.size() <= 2 && isOneOf(rest, {"m"})) return factor * kilometres;
    if ((prefix.size() > 2 || prefix.empty()) && isOneOf(rest, {"meter", "meters", "metre", "metres"}))
      return factor * kilometres;
  }
  // Geopotential metres
  if (isOneOf(word, {"gpm"})) return factor * 1e-3;
  if (isOneOf(word, {"gpdm", "gpdam", "dagpm"})) return factor * 1e-2;
  if (isOneOf(word, {"gpkm"})) return factor;
  return std::nullopt;
}

std::optional<double> pascalsOf(const std::string& unit) {
  const auto [word, factor] = unitOf(unit);
  if (isOneOf(word, {"pa", "pascal", "pascals"})) return factor;
  if (isOneOf(word, {"hpa", "mb", "mbar", "millibar", "millibars", "hectopascal", "hectopascals"}))
    return factor * 100;
  if (isOneOf(word, {"kpa", "cb", "centibar"})) return factor * 1000;
  if (isOneOf(word, {"dbar", "decibar", "decibars"})) return factor * 1e4;
  if (isOneOf(word, {"bar", "bars"})) return factor * 1e5;
  return std::nullopt;
}

bool namesHeight(const NetcdfVariable& variable) {
  const std::string standard_name = lowerCase(variable.text("standard_name")),
                    long_name = lowerCase(variable.text("long_name"));
  return beginsWithOneOf(standard_name, {"height", "altitude", "geopotential_height"}) ||
         hasOneOf(long_name, {"above", "height", "altitude", "elevation"});
}

bool namesDepth(const NetcdfVariable& variable) {
  const std::string standard_name = lowerCase(variable.text("standard_name")),
                    long_name = lowerCase(variable.text("long_name")), name = lowerCase(variable.name);
  if (!standard_name.empty()) return standard_name.starts_with("depth");
  return beginsWithOneOf(name, {"dep", "gdep", "nav_lev"}) || name.ends_with("_depth") ||
         (!namesHeight(variable) && (beginsWithOneOf(name, {"levgrnd", "levsoi", "levlak", "soil"}) ||
                                     hasOneOf(long_name, {"depth", "ground level", "soil l"})));
}

bool growsDownwards(const NetcdfVariable& variable) {
  const std::string positive = lowerCase(variable.text("positive"));
  return positive.empty() ? namesDepth(variable) : positive == "down";
}

double depthOfSeaPressure(double decibar) {
  constexpr double kLinear = 8.545e-3, kSquare = 2.21e-6;
  return (1 - kLinear) * decibar - kSquare * decibar * decibar;
}

namespace {

constexpr double kGravity = 9.80665, kGasConstant = 287.05287;  // of dry air, J/(kg K)
constexpr double kGeopotentialRadius = 6356766;                 // metres

/// A layer from `height` (geopotential metres) up, with the temperature at its foot and its lapse in K/m.
struct Layer {
  double height, temperature, lapse;
};
constexpr Layer kLayers[] = {
    {0, 288.15, -0.0065}, {11000, 216.65, 0},       {20000, 216.65, 0.001},  {32000, 228.65, 0.0028},
    {47000, 270.65, 0},   {51000, 270.65, -0.0028}, {71000, 214.65, -0.002},
};

double pressureAbove(const Layer& layer, double foot, double height) {
  const double rise = height - layer.height;
  if (layer.lapse == 0) return foot * std::exp(-kGravity * rise / (kGasConstant * layer.temperature));
  return foot *
         std::pow(1 + layer.lapse * rise / layer.temperature, -kGravity / (kGasConstant * layer.lapse));
}

/// A geometric height in kilometres and its pressure in pascals, above the layers of the standard atmosphere.
/// Source: U.S. Standard Atmosphere, 1976, table I.
struct ThinAir {
  double height, pressure;
};
constexpr ThinAir kThinAir[] = {
    {86, 0.37338},    {90, 0.18359},    {95, 7.5966e-2},   {100, 3.2011e-2}, {105, 1.4477e-2},
    {110, 7.1042e-3}, {115, 4.0096e-3}, {120, 2.5382e-3},  {130, 1.2505e-3}, {140, 7.2028e-4},
    {150, 4.5422e-4}, {160, 3.0395e-4}, {180, 1.5271e-4},  {200, 8.4736e-5}, {250, 2.4767e-5},
    {300, 8.7704e-6}, {400, 1.4518e-6}, {500, 3.0236e-7},  {600, 8.2130e-8}, {700, 3.1908e-8},
    {800, 1.7036e-8}, {900, 1.0873e-8}, {1000, 7.5138e-9},
};

double heightInThinAir(double pascals) {
  const ThinAir* above = kThinAir + 1;
  while (above + 1 != std::end(kThinAir) && pascals < above->pressure) ++above;
  const ThinAir& below = above[-1];
  const double part = std::log(pascals / below.pressure) / std::log(above->pressure / below.pressure);
  return 1e3 * (below.height + part * (above->height - below.height));
}

double heightOf(const Layer& layer, double foot, double pascals) {
  if (layer.lapse == 0)
    return layer.height - kGasConstant * layer.temperature / kGravity * std::log(pascals / foot);
  const double ratio = std::pow(pascals / foot, -kGasConstant * layer.lapse / kGravity);
  return layer.height + layer.temperature / layer.lapse * (ratio - 1);
}

}  // namespace

double standardAltitude(double pascals) {
  if (!(pascals > 0)) return std::numeric_limits<double>::quiet_NaN();
  if (pascals < kThinAir->pressure) return heightInThinAir(pascals);
  double foot = kSeaLevelPressure;
  const Layer* layer = kLayers;
  for (; layer + 1 != std::end(kLayers); ++layer) {
    const double next = pressureAbove(*layer, foot, (layer + 1)->height);
    if (pascals > next) break;
    foot = next;
  }
  const double geopotential = heightOf(*layer, foot, pascals);
  return kGeopotentialRadius * geopotential / (kGeopotentialRadius - geopotential);
}

}  // namespace curvisplat
