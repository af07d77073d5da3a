#include "preprocess/formats/netcdf/map_projection.h"

#include <fmt/format.h>
#include <proj.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <vector>

#include "preprocess/formats/common/data_libraries.h"
#include "stream/base/mutex.h"

namespace curvisplat {

CURVISPLAT_LIBRARY_FUNCTION(proj_context_create)
CURVISPLAT_LIBRARY_FUNCTION(proj_context_destroy)
CURVISPLAT_LIBRARY_FUNCTION(proj_context_set_enable_network)
CURVISPLAT_LIBRARY_FUNCTION(proj_coord)
CURVISPLAT_LIBRARY_FUNCTION(proj_create)
CURVISPLAT_LIBRARY_FUNCTION(proj_destroy)
CURVISPLAT_LIBRARY_FUNCTION(proj_log_func)
CURVISPLAT_LIBRARY_FUNCTION(proj_log_level)
CURVISPLAT_LIBRARY_FUNCTION(proj_trans)

namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// How a grid mapping becomes a definition for PROJ: its name there, and for each parameter the attributes
/// that may hold it, the first one that exists.
struct Parameter {
  const char* proj;
  std::vector<const char*> attributes;
};
struct Mapping {
  const char* name;
  const char* proj;
  std::vector<Parameter> parameters;
};

const Parameter kLatitudeOfOrigin{"lat_0", {"latitude_of_projection_origin"}};
const Parameter kLongitudeOfOrigin{"lon_0",
                                   {"longitude_of_projection_origin", "longitude_of_central_meridian"}};
const Parameter kCentralMeridian{"lon_0",
                                 {"longitude_of_central_meridian", "longitude_of_projection_origin"}};
const Parameter kEasting{"x_0", {"false_easting"}};
const Parameter kNorthing{"y_0", {"false_northing"}};
const Parameter kScale{"k_0", {"scale_factor_at_projection_origin", "scale_factor_at_central_meridian"}};
const Parameter kTrueLatitude{"lat_ts", {"standard_parallel"}};

const std::vector<Mapping>& mappings() {
  static const std::vector<Mapping> all = {
      {"transverse_mercator", "tmerc", {kLatitudeOfOrigin, kCentralMeridian, kScale}},
      {"lambert_conformal_conic", "lcc", {kLatitudeOfOrigin, kCentralMeridian}},
      {"albers_conical_equal_area", "aea", {kLatitudeOfOrigin, kCentralMeridian}},
      {"polar_stereographic",
       "stere",
       {kLatitudeOfOrigin,
        {"lon_0", {"straight_vertical_longitude_from_pole", "longitude_of_projection_origin"}},
        kScale,
        kTrueLatitude}},
      {"stereographic", "stere", {kLatitudeOfOrigin, kLongitudeOfOrigin, kScale}},
      {"mercator", "merc", {kLongitudeOfOrigin, kScale, kTrueLatitude}},
      {"lambert_azimuthal_equal_area", "laea", {kLatitudeOfOrigin, kLongitudeOfOrigin}},
      {"lambert_cylindrical_equal_area", "cea", {kCentralMeridian, kTrueLatitude}},
      {"azimuthal_equidistant", "aeqd", {kLatitudeOfOrigin, kLongitudeOfOrigin}},
      {"orthographic", "ortho", {kLatitudeOfOrigin, kLongitudeOfOrigin}},
      {"sinusoidal", "sinu", {kLongitudeOfOrigin}},
  };
  return all;
}

std::optional<double> numberOf(const NetcdfVariable& mapping, const char* attribute, size_t n = 0) {
  const auto found = mapping.attributes.find(attribute);
  if (found == mapping.attributes.end() || found->second.numbers.size() <= n) return std::nullopt;
  const double value = found->second.numbers[n];
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// PROJ's words for the figure of the Earth; a sphere of 6371 km where nothing is said.
std::string figure(const NetcdfVariable& mapping) {
  if (const auto radius = numberOf(mapping, "earth_radius")) return fmt::format(" +R={:.17g}", *radius);
  const auto major = numberOf(mapping, "semi_major_axis"), minor = numberOf(mapping, "semi_minor_axis");
  const auto flattening = numberOf(mapping, "inverse_flattening");
  if (major && minor) return fmt::format(" +a={:.17g} +b={:.17g}", *major, *minor);
  if (major && flattening && *flattening > 0)
    return fmt::format(" +a={:.17g} +rf={:.17g}", *major, *flattening);
  return fmt::format(" +R={:.17g}", major.value_or(6371000));
}

std::string definition(const Mapping& form, const NetcdfVariable& mapping) {
  std::string text = fmt::format("+proj={}", form.proj);
  std::vector<Parameter> parameters = form.parameters;
  parameters.push_back(kEasting);
  parameters.push_back(kNorthing);
  for (const Parameter& parameter : parameters)
    for (const char* attribute : parameter.attributes)
      if (const auto value = numberOf(mapping, attribute)) {
        text += fmt::format(" +{}={:.17g}", parameter.proj, *value);
        break;
      }
  // Conic projections have one standard parallel or two.
  if (form.proj == std::string_view("lcc") || form.proj == std::string_view("aea")) {
    const auto first = numberOf(mapping, "standard_parallel"),
               second = numberOf(mapping, "standard_parallel", 1);
    if (first) text += fmt::format(" +lat_1={:.17g} +lat_2={:.17g}", *first, second.value_or(*first));
  }
  return text + figure(mapping);
}

/// The grid mapping variable; "crs" of "crs: x y" in the longer form.
const NetcdfVariable* mappingOf(const NetcdfFiles& files, const NetcdfVariable& variable) {
  std::istringstream words(variable.text("grid_mapping"));
  std::string name;
  if (!(words >> name)) return nullptr;
  if (name.back() == ':') name.pop_back();
  return files.find(name);
}

}  // namespace

/// PROJ's objects, which one thread at a time may use.
struct MapProjection::Proj {
  mutable Mutex mutex;
  PJ_CONTEXT* context = nullptr;
  PJ* projection PT_GUARDED_BY(mutex) = nullptr;

  explicit Proj(const std::string& text) {
    context = proj_context_create();
    proj_log_level(context, PJ_LOG_NONE);
    // Whatever its level, it prints that proj.db is missing, as it may be in a bundle. These definitions do not need it.
    proj_log_func(context, nullptr, [](void*, int, const char*) {});
    proj_context_set_enable_network(context, 0);
    projection = proj_create(context, text.c_str());
  }
  ~Proj() {
    proj_destroy(projection);
    proj_context_destroy(context);
  }
  Proj(const Proj&) = delete;
  Proj& operator=(const Proj&) = delete;
};

std::pair<std::optional<MapProjection>, std::string> MapProjection::of(const NetcdfFiles& files,
                                                                       const NetcdfVariable& variable) {
  const NetcdfVariable* const mapping = mappingOf(files, variable);
  if (!mapping) return {std::nullopt, "no grid_mapping"};
  MapProjection result;
  result.name_ = mapping->text("grid_mapping_name");
  if (result.name_ == "rotated_latitude_longitude") {
    const auto longitude = numberOf(*mapping, "grid_north_pole_longitude"),
               latitude = numberOf(*mapping, "grid_north_pole_latitude");
    if (!longitude || !latitude)
      return {std::nullopt, fmt::format("{} has no grid_north_pole_longitude and latitude", mapping->name)};
    result.degrees_ = true;
    result.pole_longitude_ = *longitude;
    result.pole_latitude_ = *latitude;
    result.grid_longitude_ = numberOf(*mapping, "north_pole_grid_longitude").value_or(0);
    return {std::move(result), ""};
  }
  for (const Mapping& form : mappings()) {
    if (result.name_ != form.name) continue;
    result.proj_ = std::make_shared<const Proj>(definition(form, *mapping));
    if (!result.proj_->projection)
      return {std::nullopt, fmt::format("{} does not define the projection {}", mapping->name, result.name_)};
    return {std::move(result), ""};
  }
  return {std::nullopt, fmt::format("{} has the grid_mapping_name '{}', which is not supported",
                                    mapping->name, result.name_)};
}

/// Source: rotation of the sphere that takes the grid's pole to the pole; north_pole_grid_longitude is the
/// grid's longitude of the true pole.
void MapProjection::unrotate(double& longitude, double& latitude) const {
  const double x = (longitude - grid_longitude_) * kRadiansPerDegree, y = latitude * kRadiansPerDegree;
  const double pole_x = pole_longitude_ * kRadiansPerDegree, pole_y = pole_latitude_ * kRadiansPerDegree;
  const double along = std::cos(pole_y) * std::sin(y) - std::sin(pole_y) * std::cos(y) * std::cos(x);
  const double across = std::cos(y) * std::sin(x);
  const double up = std::cos(pole_y) * std::cos(y) * std::cos(x) + std::sin(pole_y) * std::sin(y);
  latitude = std::asin(std::fmin(1.0, std::fmax(-1.0, up))) / kRadiansPerDegree;
  longitude = std::atan2(std::sin(pole_x) * along - std::cos(pole_x) * across,
                         std::cos(pole_x) * along + std::sin(pole_x) * across) /
              kRadiansPerDegree;
}

void MapProjection::toGeographic(std::span<double> x, std::span<double> y) const {
  if (degrees_) {
    for (size_t n = 0; n < x.size(); ++n) unrotate(x[n], y[n]);
    return;
  }
  const MutexLock lock(proj_->mutex);
  for (size_t n = 0; n < x.size(); ++n) {
    const PJ_COORD from = proj_coord(x[n], y[n], 0, 0);
    const PJ_COORD to = std::isfinite(x[n]) && std::isfinite(y[n])
                            ? proj_trans(proj_->projection, PJ_INV, from)
                            : proj_coord(kNone, kNone, 0, 0);
    const bool there = std::isfinite(to.lp.lam) && std::isfinite(to.lp.phi);
    x[n] = there ? to.lp.lam / kRadiansPerDegree : kNone;
    y[n] = there ? to.lp.phi / kRadiansPerDegree : kNone;
  }
}

Globe globeWith(const GlobeOptions& options, bool degrees, double middle_longitude) {
  Globe globe;
  globe.shape = !degrees                                      ? Globe::Shape::kLengths
                : options.shape == GlobeOptions::Shape::kFlat ? Globe::Shape::kFlat
                                                              : Globe::Shape::kSphere;
  globe.radius_km = options.radius_km;
  globe.vertical_scale = options.vertical_scale;
  globe.middle_longitude = std::isfinite(middle_longitude) ? middle_longitude : 0;
  return globe;
}

std::string warningOfSagitta(double sagitta_km, double thickness_km) {
  if (!(thickness_km > 0 && std::isfinite(thickness_km) && 2 * sagitta_km > thickness_km)) return "";
  return fmt::format(
      "cells are flat, and their middles lie up to {:.3g} km below the sphere, {:.3g} times the thickness of "
      "the thinnest layer: there splats of one layer lie among those of others, and values mix; --flat keeps "
      "layers apart",
      sagitta_km, sagitta_km / thickness_km);
}

}  // namespace curvisplat
