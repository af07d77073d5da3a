#include "preprocess/formats/netcdf/cf_vertical.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <sstream>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_dimensions.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr double kWrfGravity = 9.81;
constexpr double kStandardGravity = 9.80665;
constexpr double kMaxAirPressure = 2e5;  // pascals
// These are kilometres. Distances beyond kMinRadius may be those from a planet's centre, levels up to kMaxTide those of the sea
// above the mean; ranges below kMinExtent are no heights.
constexpr double kEarthRadius = 6371, kMinRadius = 1000, kMaxTide = 0.02, kMinExtent = 1e-6;
constexpr std::array kHeightsOfNodes{"GHT", "ght", "gh", "zg", "height", "zc", "z_mc"};
constexpr std::array kPressuresOfNodes{"PRES", "pres", "pressure"};

/// Whether any variable is a longitude: then lengths are those of the Earth's.
bool isGeographic(const NetcdfFiles& file) {
  return std::any_of(file.variables().begin(), file.variables().end(), [&](const NetcdfVariable& variable) {
    return cfRole(file, variable) == CfRole::kLongitude;
  });
}

/// Terrain-following coordinates by their names: sigma, eta, ZNU, s_rho.
bool namesSigma(const NetcdfVariable& coordinate) {
  for (const std::string& words :
       {coordinate.name, coordinate.text("standard_name"), coordinate.text("long_name")}) {
    const std::string text = lowerCase(words);
    for (const char* const word : {"sigma", "eta", "znu", "znw", "s_rho", "s_w", "hybrid"})
      if (text.starts_with(word) || text.find(std::string(" ") + word) != std::string::npos) return true;
    if (text.find("sigma") != std::string::npos || text.starts_with("ocean_s_")) return true;
  }
  return false;
}

/// Coordinates that number the levels.
bool namesNumbers(const NetcdfVariable& coordinate) {
  const std::string standard_name = coordinate.text("standard_name");
  return standard_name == "model_level_number" || standard_name.ends_with("_index") ||
         lowerCase(coordinate.text("long_name")).starts_with("generalized");
}

/// Lengths that are no heights.
bool namesSize(const NetcdfVariable& coordinate) {
  const std::string words = lowerCase(fmt::format(
      "{} {} {}", coordinate.name, coordinate.text("standard_name"), coordinate.text("long_name")));
  return std::ranges::any_of(std::array{"wavelength", "wave length", "diameter", "particle", "drop radius"},
                             [&](const char* word) { return words.find(word) != std::string::npos; });
}

/// Whether a variable is a field of the sea or of the soil, so that its levels lie below the surface. `kilometres`: the
/// highest level; levels of the sea may be up to kMaxTide above the mean surface.
bool liesBelow(const NetcdfVariable& variable, double kilometres) {
  const std::string name = variable.text("standard_name");
  return (kilometres > kMaxTide && name.find("sea_water") != std::string::npos) ||
         name.find("soil") != std::string::npos;
}

/// Describes a level that has no place among the others: it is a fill value.
std::string wrongLevel(const NetcdfVariable& coordinate, const std::vector<double>& values,
                       double kilometres) {
  double before = 0;
  for (size_t n = 0; n < values.size(); ++n) {
    const bool far = std::abs(values[n]) * kilometres > kMaxHeight;
    const double step = n > 0 ? values[n] - values[n - 1] : 0;
    if (far || step * before < 0)
      return fmt::format(
          "{0} is {1:g} at level {2}, counted from 0, {3}: leave such levels out (ncks -d {0},FIRST,LAST "
          "FILE "
          "OUT)",
          coordinate.name, values[n], n, far ? "which is no height" : "but levels only rise or only fall");
    if (step != 0 && !std::isnan(step)) before = step;
  }
  return "";
}

std::string notALength(const NetcdfVariable& variable) {
  const std::string units = variable.text("units");
  if (units.empty() && namesNumbers(variable))
    return fmt::format(
        "{} numbers the levels; expected a length or a pressure: give heights of the levels or of the nodes, "
        "in this file or in one after it",
        variable.name);
  if (units.empty())
    return fmt::format(
        "{0} has no unit; expected a length or a pressure: if its values are metres, say so (ncatted -a "
        "units,{0},o,c,m FILE)",
        variable.name);
  return fmt::format(
      "{} has the unit '{}'; expected a length or a pressure: give heights of the levels or of the nodes, in "
      "this file or in one after it",
      variable.name, units);
}

}  // namespace

std::pair<std::optional<CfVertical>, std::string> CfVertical::of(const NetcdfFiles& file,
                                                                 const NetcdfVariable& variable,
                                                                 const CfDimensions& given, size_t axis) {
  CfDimensions block = given;
  block.levels = axis;
  const std::string& levels = file.dimensions()[block.axes[axis]].name;
  std::string reason = fmt::format("no depth, height or pressure along {}", levels);
  if (auto found = byNodeGeopotential(file, block)) return {std::move(found), ""};
  const NetcdfVariable* const along = file.find(levels);
  if (along && !along->text("units").empty() && !hasUnitOfTime(*along)) reason = notALength(*along);
  // The formula may be that of the dimension's coordinate, or of another one along it (the levels' heights beside their numbers).
  std::vector<const NetcdfVariable*> formulas;
  if (along) formulas.push_back(along);
  for (const NetcdfVariable& other : file.variables()) formulas.push_back(&other);
  for (const NetcdfVariable* const coordinate : formulas) {
    if (coordinate->text("formula_terms").empty() || !coordinate->numeric) continue;
    const auto term = CfTerm::of(file, *coordinate, block);
    if (coordinate != along && !(term && term->exact() && term->axes() == 1 && term->varies(axis))) continue;
    if (auto found = byFormula(file, *coordinate, block, axis, reason)) return {std::move(found), ""};
  }
  std::string lacking;
  if (auto found = byNamesOfTerms(file, block, axis, lacking)) return {std::move(found), ""};

  // Variables in its own `coordinates` attribute come first.
  Candidates candidates;
  std::istringstream names(variable.text("coordinates"));
  for (std::string name; names >> name;)
    if (const NetcdfVariable* const named = file.find(name)) candidates.push_back(named);
  if (along) candidates.push_back(along);
  // Where the levels have a unit, a field without one is data, even if its name is z.
  const bool levels_known = along && (kilometresOf(along->text("units")) || pascalsOf(along->text("units")));
  for (const NetcdfVariable& other : file.variables())
    if (!levels_known || other.dims.size() < 3 || !other.text("units").empty() ||
        !other.text("standard_name").empty() || !other.text("positive").empty() ||
        !other.text("axis").empty())
      candidates.push_back(&other);

  // Lengths before pressures, whose heights are the standard atmosphere's.
  for (const bool pressure : {false, true}) {
    if (auto found = byCandidates(file, candidates, variable, block, {axis, true, pressure}, reason))
      return {std::move(found), ""};
    if (auto found = bySums(file, block, pressure)) return {std::move(found), ""};
    if (!pressure)
      if (auto found = byInterfaces(file, block, axis)) return {std::move(found), ""};
    if (auto found = byCandidates(file, candidates, variable, block, {axis, false, pressure}, reason)) {
      if (pressure && !lacking.empty() && found->warnings().empty())
        found->addWarning(lacking + "; the nominal pressures are taken");
      return {std::move(found), ""};
    }
  }
  if (auto found = byThickness(file, block, axis)) return {std::move(found), ""};
  if (auto found = byNamesOfFields(file, block, axis)) return {std::move(found), ""};
  if (along && along->numeric && kilometresOf(along->text("units")))
    if (const auto term = CfTerm::of(file, *along, block); term && term->axes() == 1)
      if (auto found = byLevels(file, *along, variable, *term, axis, reason)) return {std::move(found), ""};
  return {std::nullopt, reason};
}

std::optional<CfVertical> CfVertical::byCandidates(const NetcdfFiles& file, const Candidates& candidates,
                                                   const NetcdfVariable& variable, const CfDimensions& block,
                                                   const Wanted& wanted, std::string& reason) {
  for (const auto& [exact, unit] : {std::pair(true, true), {true, false}, {false, true}, {false, false}})
    for (const NetcdfVariable* candidate : candidates) {
      if (cfRole(file, *candidate) != CfRole::kVertical) continue;
      // Numbers of levels, too, come after metres.
      if (isUnitless(candidate->text("units")) == unit) continue;
      if (pascalsOf(candidate->text("units")).has_value() != wanted.pressure) continue;
      const auto term = CfTerm::of(file, *candidate, block);
      // Dimensions of other names count in other files only: a file of masks names its levels as it likes.
      if (!term || !term->onNodes() || term->exact() != exact) continue;
      if ((!exact && candidate->file == variable.file) || !term->varies(wanted.axis)) continue;
      if ((term->axes() > 1) != wanted.of_nodes) continue;
      if (auto found = byLevels(file, *candidate, variable, *term, wanted.axis, reason)) return found;
    }
  return std::nullopt;
}

CfVertical CfVertical::ofIndex(size_t axis) {
  CfVertical vertical;
  vertical.terms_.push_back(CfTerm::ofIndex(axis, 1000));
  vertical.scale_ = 1e-3;
  vertical.description_ = "index";
  return vertical;
}

std::optional<CfVertical> CfVertical::byLevels(const NetcdfFiles& file, const NetcdfVariable& coordinate,
                                               const NetcdfVariable& variable, const CfTerm& term,
                                               size_t axis, std::string& reason) {
  const std::string units = coordinate.text("units");
  const auto kilometres = kilometresOf(units), pascals = pascalsOf(units);
  CfVertical vertical;
  vertical.terms_.push_back(term);
  vertical.description_ = coordinate.name;
  // The levels of a formula have pressures as nominal values; ROMS' and sigma levels have no unit.
  const bool formula = !coordinate.text("formula_terms").empty();
  const auto warnOfFormula = [&](const char* nominal) {
    if (formula) vertical.warnings_.push_back(fmt::format("{}; its nominal {} are taken", reason, nominal));
  };
  if (pascals) {
    const bool of_sea =
        *pascals == pascalsOf("dbar") || coordinate.text("standard_name") == "sea_water_pressure";
    vertical.kind_ = of_sea ? Kind::kSeaPressure : Kind::kPressure;
    vertical.scale_ = *pascals / (of_sea ? 1e4 : 1);
    vertical.description_ +=
        of_sea ? " (pressure of sea water)" : " (pressure, at heights of the standard atmosphere)";
  } else {
    const bool vague = lowerCase(coordinate.name).starts_with("lev") || namesNumbers(coordinate);
    if (!kilometres && (!isUnitless(units) || formula || vague)) {
      if (!formula) reason = notALength(coordinate);  // else what the formula lacks
      return std::nullopt;
    }
    vertical.scale_ = kilometres.value_or(1e-3) * (growsDownwards(coordinate) ? -1 : 1);
  }
  if (term.axes() == 1)
    if (std::string wrong = vertical.setPlausible(file, coordinate, variable, axis); !wrong.empty()) {
      reason = std::move(wrong);
      return std::nullopt;
    }
  if (!pascals && !kilometres)
    vertical.warnings_.push_back(fmt::format("{} has no units; metres are assumed", coordinate.name));
  warnOfFormula(pascals ? "pressures" : "heights");
  return vertical;
}

/// Looks at the levels of `variable`: distances from the Earth's centre become heights, and so do depths that are all
/// negative; what has the levels of the sea or the soil lies below the surface. Returns why the values are no levels, or nothing.
std::string CfVertical::setPlausible(const NetcdfFiles& file, const NetcdfVariable& coordinate,
                                     const NetcdfVariable& variable, size_t axis) {
  const CfTerm& term = terms_[0];
  CfRange all{{0, 0, 0}, {1, 1, 1}};
  all.end[axis] = file.dimension(coordinate, term.dimensionOf(axis)).length;
  const std::vector<double> values = term.read(file, all).values;
  if (std::string wrong = wrongLevel(coordinate, values, std::abs(scale_)); !wrong.empty()) return wrong;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  const std::string name = lowerCase(coordinate.name), positive = lowerCase(coordinate.text("positive")),
                    unit = coordinate.text("units");
  const std::string range = fmt::format("{} is {:g} .. {:g} {}", coordinate.name, *least, *most, unit);
  if (kind_ == Kind::kPressure) {
    if (scale_ * *most < kMaxAirPressure) return "";
    return fmt::format(
        "{}, more than the pressure of any air on the Earth: correct its unit (ncatted -a units,{},o,c,Pa "
        "FILE), or give pressures of sea water the standard_name sea_water_pressure",
        range, coordinate.name);
  }
  if (kind_ == Kind::kSeaPressure) return "";
  const bool geographic = isGeographic(file);
  if (!kilometresOf(unit) &&
      (namesSigma(coordinate) || (std::abs(*least) <= 1 && std::abs(*most) <= 1 && geographic)))
    return fmt::format(
        "{} has no unit, and its values from {:g} to {:g} are no lengths, but those of a sigma or hybrid "
        "coordinate; "
        "expected its formula_terms, or heights of the nodes, in this file or in one given after it",
        coordinate.name, *least, *most);
  if (scale_ < 0 && *most <= 0) {
    // Depths that fall from 0 are heights, whatever their name.
    scale_ = -scale_;
    if (!positive.empty())
      warnings_.push_back(fmt::format(
          "{} is positive down, but its values are from {:g} to {:g}; they are taken for heights, "
          "below the surface",
          coordinate.name, *least, *most));
  } else if (scale_ > 0 && *least >= 0 && !namesHeight(coordinate) &&
             (namesDepth(coordinate) || liesBelow(variable, scale_ * *most))) {
    scale_ = -scale_;
    warnings_.push_back(fmt::format(
        "{} {}, but is {}; its values from {:g} to {:g} are taken for depths", coordinate.name,
        positive.empty() ? "has no attribute `positive`" : "is positive up",
        namesDepth(coordinate) ? "a depth" : "a coordinate of " + variable.name + ", below the surface",
        *least, *most));
  }
  const bool radius = name.starts_with("rad"), from_centre = radius && scale_ * *least > kMinRadius;
  if (geographic && scale_ > 0 && from_centre) {
    offset_ = -kEarthRadius;
    description_ += " (from the Earth's centre)";
  } else if (geographic && positive.empty() &&
             (radius || namesSize(coordinate) || std::abs(scale_) * (*most - *least) < kMinExtent)) {
    return fmt::format("{}, which are no heights", range);
  } else if (geographic && std::min(scale_ * *least, scale_ * *most) < -kEarthRadius) {
    return fmt::format("{}, below the Earth's centre", range);
  }
  return "";
}

bool CfVertical::isNamedForNodes(const NetcdfVariable& variable) {
  const auto is = [&](const char* name) { return variable.name == name; };
  const std::string unit = variable.text("units");
  // GETM: "z-coordinate at layer centers"
  const std::string words = lowerCase(variable.text("long_name"));
  const bool called = words.starts_with("z-coordinate") || words.starts_with("vertical coordinate");
  return ((called || std::ranges::any_of(kHeightsOfNodes, is)) && kilometresOf(unit)) ||
         (std::ranges::any_of(kPressuresOfNodes, is) && pascalsOf(unit));
}

/// Heights and pressures of nodes that only their names tell, beside numbered levels: met_em's GHT and PRES.
std::optional<CfVertical> CfVertical::byNamesOfFields(const NetcdfFiles& file, const CfDimensions& block,
                                                      size_t axis) {
  for (const bool pressure : {false, true})
    for (const NetcdfVariable& variable : file.variables()) {
      const std::string unit = variable.text("units");
      const auto scale = pressure ? pascalsOf(unit) : kilometresOf(unit);
      if (!variable.numeric || !scale || !isNamedForNodes(variable)) continue;
      const auto term = CfTerm::of(file, variable, block);
      if (!term || !term->exact() || term->axes() != 3 || !term->varies(axis)) continue;
      CfVertical vertical;
      vertical.terms_.push_back(*term);
      vertical.kind_ = pressure ? Kind::kPressure : Kind::kLevels;
      vertical.scale_ = *scale * (!pressure && growsDownwards(variable) ? -1 : 1);
      vertical.description_ = variable.name;
      if (pressure) vertical.description_ += " (pressure, at heights of the standard atmosphere)";
      return vertical;
    }
  return std::nullopt;
}

std::optional<CfVertical> CfVertical::byNodeGeopotential(const NetcdfFiles& file, const CfDimensions& block) {
  for (const NetcdfVariable& variable : file.variables()) {
    if (variable.text("standard_name") != "geopotential" || !variable.numeric) continue;
    const auto term = CfTerm::of(file, variable, block);
    if (!term || !term->exact() || term->axes() != 3) continue;
    CfVertical vertical;
    vertical.terms_.push_back(*term);
    vertical.scale_ = 1e-3 / kStandardGravity;
    vertical.description_ = "geopotential " + variable.name;
    return vertical;
  }
  return std::nullopt;
}

/// MOM6's `e`, COSMO's HHL and other heights of every node at the layers' interfaces: there is one more than layers.
std::optional<CfVertical> CfVertical::byInterfaces(const NetcdfFiles& file, const CfDimensions& block,
                                                   size_t axis) {
  for (const NetcdfVariable& variable : file.variables()) {
    const auto kilometres = kilometresOf(variable.text("units"));
    const std::string words = lowerCase(variable.text("long_name"));
    if (!variable.numeric || !kilometres) continue;
    const bool named = variable.name == "e" || words.find("interface height") != std::string::npos;
    if (!named && cfRole(file, variable) != CfRole::kVertical) continue;
    const auto term = CfTerm::of(file, variable, block);
    if (!term || term->axes() != 3 || !term->varies(axis) || !(named || term->surrounds(axis))) continue;
    CfVertical vertical;
    vertical.terms_.push_back(*term);
    vertical.scale_ = *kilometres * (!named && growsDownwards(variable) ? -1 : 1);
    vertical.description_ = "interface height " + variable.name;
    return vertical;
  }
  return std::nullopt;
}

/// Layers of isopycnal models: their thicknesses add up from the surface, which is taken at 0.
std::optional<CfVertical> CfVertical::byThickness(const NetcdfFiles& file, const CfDimensions& block,
                                                  size_t axis) {
  for (const NetcdfVariable& variable : file.variables()) {
    const auto kilometres = kilometresOf(variable.text("units"));
    const std::string words = lowerCase(variable.text("long_name"));
    if (!variable.numeric || !kilometres) continue;
    if (variable.text("standard_name") != "cell_thickness" &&
        words.find("layer thickness") == std::string::npos)
      continue;
    const auto term = CfTerm::of(file, variable, block);
    if (!term || !term->exact() || term->axes() != 3) continue;
    CfVertical vertical;
    vertical.kind_ = Kind::kThickness;
    vertical.terms_.push_back(*term);
    vertical.scale_ = *kilometres;
    vertical.axis_ = axis;
    vertical.layers_ = file.dimensions()[block.axes[axis]].length;
    const NetcdfVariable* const along = file.find(file.dimensions()[block.axes[axis]].name);
    vertical.from_bottom_ = along && lowerCase(along->text("positive")) == "up";
    vertical.description_ = "layer thickness " + variable.name;
    return vertical;
  }
  return std::nullopt;
}

/// WRF's geopotential, or its pressure: a base state and what departs from it.
std::optional<CfVertical> CfVertical::bySums(const NetcdfFiles& file, const CfDimensions& block,
                                             bool pressure) {
  CfVertical vertical;
  for (const char* name : pressure ? std::array{"PB", "P"} : std::array{"PHB", "PH"}) {
    const NetcdfVariable* const variable = file.find(name);
    if (!variable || variable->text("units") != (pressure ? "Pa" : "m2 s-2")) return std::nullopt;
    const auto term = CfTerm::of(file, *variable, block);
    if (!term || term->axes() != 3) return std::nullopt;
    vertical.terms_.push_back(*term);
  }
  vertical.kind_ = pressure ? Kind::kPressure : Kind::kGeopotential;
  vertical.scale_ = pressure ? 1 : 1e-3 / kWrfGravity;
  vertical.description_ =
      pressure ? "P + PB (pressure, at heights of the standard atmosphere)" : "geopotential PH + PHB";
  return vertical;
}

}  // namespace curvisplat
