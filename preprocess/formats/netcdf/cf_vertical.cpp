#include "preprocess/formats/netcdf/cf_vertical.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr double kWrfGravity = 9.81;
constexpr double kStandardGravity = 9.80665;
constexpr double kSeaLevelPressure = 101325;
constexpr double kEarthRadius = 6371;  // kilometres

/// "s: s_rho C: Cs_r" as {s: s_rho, C: Cs_r}.
std::map<std::string, std::string> formulaTerms(const std::string& text) {
  std::map<std::string, std::string> terms;
  std::istringstream words(text);
  std::string key, name;
  while (words >> key >> name)
    if (key.size() > 1 && key.back() == ':') terms[key.substr(0, key.size() - 1)] = name;
  return terms;
}

/// Variables that stand for a term whose own variable is in another file: names differ between files of a model.
struct TermNames {
  const char *key, *standard_name;
  std::initializer_list<const char*> names;
};
const TermNames kTermNames[] = {
    {"ps", "surface_air_pressure", {"PS", "ps", "aps", "PSFC", "sp"}},
    {"orog", "surface_altitude", {"orog", "surface_altitude", "HSURF", "topo"}},
    {"depth", "sea_floor_depth_below_geoid", {"h", "bathymetry", "deptho"}},
    {"eta", "sea_surface_height_above_geoid", {"zeta", "ssh", "zos"}},
};

const NetcdfVariable* standIn(const NetcdfFiles& file, const std::string& key, const CfDimensions& block) {
  for (const TermNames& term : kTermNames) {
    if (key != term.key) continue;
    const auto of_columns = [&](const NetcdfVariable& variable) {
      const auto found = variable.numeric ? CfTerm::of(file, variable, block) : std::nullopt;
      return found && found->axes() == 2;
    };
    for (const NetcdfVariable& variable : file.variables())
      if (variable.text("standard_name") == term.standard_name && of_columns(variable)) return &variable;
    for (const char* const name : term.names)
      if (const NetcdfVariable* const variable = file.find(name); variable && of_columns(*variable))
        return variable;
  }
  return nullptr;
}

std::optional<CfTerm> termNamed(const NetcdfFiles& file, const std::map<std::string, std::string>& terms,
                                const char* key, const CfDimensions& block) {
  const auto name = terms.find(key);
  if (name == terms.end()) return std::nullopt;
  const NetcdfVariable* variable = file.find(name->second);
  if (!variable) variable = standIn(file, key, block);
  if (!variable || !variable->numeric) return std::nullopt;
  return CfTerm::of(file, *variable, block);
}

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

/// The value of a scalar term.
double constant(const NetcdfFiles& file, const std::optional<CfTerm>& term) {
  if (!term || term->axes() > 0) return std::nan("");
  return term->read(file, {{0, 0, 0}, {1, 1, 1}}).values.at(0);
}

std::string notALength(const NetcdfVariable& variable) {
  const std::string units = variable.text("units");
  return fmt::format("{0} {1}; expected a length or a pressure: set it (ncatted -a units,{0},o,c,m FILE)",
                     variable.name, units.empty() ? "has no unit" : fmt::format("has the unit '{}'", units));
}

}  // namespace

std::pair<std::optional<CfVertical>, std::string> CfVertical::of(const NetcdfFiles& file,
                                                                 const NetcdfVariable& variable,
                                                                 const CfDimensions& block, size_t axis) {
  const std::string& levels = file.dimensions()[block.axes[axis]].name;
  std::string reason = fmt::format("no depth, height or pressure along {}", levels);
  if (auto found = byNodeGeopotential(file, block)) return {std::move(found), ""};
  const NetcdfVariable* const along = file.find(levels);
  if (along && !along->text("units").empty()) reason = notALength(*along);
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
  if (auto found = byNamesOfTerms(file, block, axis)) return {std::move(found), ""};

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
    if (!pressure) {
      if (auto found = byGeopotential(file, block)) return {std::move(found), ""};
      if (auto found = byInterfaces(file, block, axis)) return {std::move(found), ""};
    }
    if (auto found = byCandidates(file, candidates, variable, block, {axis, false, pressure}, reason))
      return {std::move(found), ""};
  }
  if (auto found = byThickness(file, block, axis)) return {std::move(found), ""};
  if (auto found = byNamesOfFields(file, block, axis)) return {std::move(found), ""};
  if (along && along->numeric && kilometresOf(along->text("units")))
    if (const auto term = CfTerm::of(file, *along, block); term && term->axes() == 1)
      if (auto found = byLevels(file, *along, *term, axis, reason)) return {std::move(found), ""};
  return {std::nullopt, reason};
}

std::optional<CfVertical> CfVertical::byCandidates(const NetcdfFiles& file, const Candidates& candidates,
                                                   const NetcdfVariable& variable, const CfDimensions& block,
                                                   const Wanted& wanted, std::string& reason) {
  for (const bool exact : {true, false})
    for (const NetcdfVariable* candidate : candidates) {
      if (cfRole(file, *candidate) != CfRole::kVertical) continue;
      if (pascalsOf(candidate->text("units")).has_value() != wanted.pressure) continue;
      const auto term = CfTerm::of(file, *candidate, block);
      // Dimensions of other names count in other files only: a file of masks names its levels as it likes.
      if (!term || !term->onNodes() || term->exact() != exact) continue;
      if ((!exact && candidate->file == variable.file) || !term->varies(wanted.axis)) continue;
      if ((term->axes() > 1) != wanted.of_nodes) continue;
      if (auto found = byLevels(file, *candidate, *term, wanted.axis, reason)) return found;
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
                                               const CfTerm& term, size_t axis, std::string& reason) {
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
    warnOfFormula("pressures");
    return vertical;
  }
  const bool vague = lowerCase(coordinate.name).starts_with("lev") ||
                     coordinate.text("standard_name") == "model_level_number";
  if (!kilometres && (!isUnitless(units) || formula || vague)) {
    reason = notALength(coordinate);
    return std::nullopt;
  }
  vertical.scale_ = kilometres.value_or(1e-3) * (growsDownwards(coordinate) ? -1 : 1);
  if (term.axes() == 1)
    if (std::string wrong = vertical.setPlausible(file, coordinate, axis); !wrong.empty()) {
      reason = std::move(wrong);
      return std::nullopt;
    }
  if (!kilometres)
    vertical.warnings_.push_back(fmt::format("{} has no units; metres are assumed", coordinate.name));
  warnOfFormula("heights");
  return vertical;
}

/// Looks at the levels: distances from the Earth's centre become heights, and so do depths that are all negative. Returns
/// why the values are no lengths, or nothing.
std::string CfVertical::setPlausible(const NetcdfFiles& file, const NetcdfVariable& coordinate, size_t axis) {
  const CfTerm& term = terms_[0];
  CfRange all{{0, 0, 0}, {1, 1, 1}};
  all.end[axis] = file.dimension(coordinate, term.dimensionOf(axis)).length;
  const std::vector<double> values = term.read(file, all).values;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  const std::string name = lowerCase(coordinate.name);
  if (!kilometresOf(coordinate.text("units")) &&
      (namesSigma(coordinate) || (std::abs(*least) <= 1 && std::abs(*most) <= 1 && isGeographic(file))))
    return fmt::format(
        "{} has no unit, and its values from {:g} to {:g} are no lengths, but those of a sigma or hybrid "
        "coordinate; "
        "expected its formula_terms, or heights of the nodes, in this file or in one given after it",
        coordinate.name, *least, *most);
  if (scale_ < 0 && *most <= 0) {
    // Depths that fall from 0 are heights, whatever their name.
    scale_ = -scale_;
    if (!coordinate.text("positive").empty())
      warnings_.push_back(fmt::format(
          "{} is positive down, but its values are from {:g} to {:g}; they are taken for heights, "
          "below the surface",
          coordinate.name, *least, *most));
  }
  if (scale_ > 0 && name.starts_with("rad") && scale_ * *least > 0 && isGeographic(file)) {
    offset_ = -kEarthRadius;
    description_ += " (from the Earth's centre)";
  }
  return "";
}

/// Formulas without formula_terms, by the names that models give to their terms.
std::optional<CfVertical> CfVertical::byNamesOfTerms(const NetcdfFiles& file, const CfDimensions& block,
                                                     size_t axis) {
  const auto along = [&](std::initializer_list<const char*> names) -> std::string {
    for (const char* const name : names) {
      const NetcdfVariable* const variable = file.find(name);
      const auto term = variable && variable->numeric ? CfTerm::of(file, *variable, block) : std::nullopt;
      if (term && term->exact() && term->axes() == 1 && term->varies(axis)) return name;
    }
    return "";
  };
  const auto named = [](std::optional<CfVertical> found, const std::string& terms) {
    if (found) found->description_ = fmt::format("formula of {}{}", terms, found->description_);
    return found;
  };
  std::string reason;
  const std::string s = along({"s_rho", "s_w", "sc_r", "sc_w"}), c = along({"Cs_r", "Cs_w"});
  if (!s.empty() && !c.empty() && file.find("hc") && standIn(file, "depth", block))
    return named(
        ofTerms(file, Kind::kS, {{"s", s}, {"C", c}, {"eta", "zeta"}, {"depth", "h"}, {"depth_c", "hc"}},
                block, axis, reason),
        s);
  const std::string a = along({"hyam", "hyai", "ap", "A", "a"}), b = along({"hybm", "hybi", "b", "B"});
  if (!a.empty() && !b.empty() && standIn(file, "ps", block))
    return named(
        ofTerms(
            file, Kind::kHybridPressure,
            {{pascalsOf(file.find(a)->text("units")) ? "ap" : "a", a}, {"b", b}, {"p0", "P0"}, {"ps", "PS"}},
            block, axis, reason),
        a + " and " + b);
  return std::nullopt;
}

/// Heights and pressures of nodes that only their names tell, beside numbered levels: met_em's GHT and PRES.
std::optional<CfVertical> CfVertical::byNamesOfFields(const NetcdfFiles& file, const CfDimensions& block,
                                                      size_t axis) {
  for (const bool pressure : {false, true})
    for (const char* const name : {"GHT", "ght", "gh", "zg", "height", "PRES", "pres", "pressure"}) {
      const NetcdfVariable* const variable = file.find(name);
      if (!variable || !variable->numeric) continue;
      const std::string unit = variable->text("units");
      const auto kilometres = kilometresOf(unit), pascals = pascalsOf(unit);
      const auto term = CfTerm::of(file, *variable, block);
      if (!(pressure ? pascals : kilometres) || !term || !term->exact() || term->axes() != 3 ||
          !term->varies(axis))
        continue;
      CfVertical vertical;
      vertical.terms_.push_back(*term);
      vertical.kind_ = pressure ? Kind::kPressure : Kind::kLevels;
      vertical.scale_ = pressure ? *pascals : *kilometres;
      vertical.description_ = name;
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

std::optional<CfVertical> CfVertical::byGeopotential(const NetcdfFiles& file, const CfDimensions& block) {
  CfVertical vertical;
  for (const char* name : {"PHB", "PH"}) {
    const NetcdfVariable* const variable = file.find(name);
    if (!variable || variable->text("units") != "m2 s-2") return std::nullopt;
    const auto term = CfTerm::of(file, *variable, block);
    if (!term || term->axes() != 3) return std::nullopt;
    vertical.terms_.push_back(*term);
  }
  vertical.kind_ = Kind::kGeopotential;
  vertical.scale_ = 1e-3 / kWrfGravity;
  vertical.description_ = "geopotential PH + PHB";
  return vertical;
}

std::optional<CfVertical> CfVertical::byFormula(const NetcdfFiles& file, const NetcdfVariable& coordinate,
                                                const CfDimensions& block, size_t axis, std::string& reason) {
  static const std::map<std::string, Kind> kinds = {
      {"ocean_sigma_coordinate", Kind::kSigma},
      {"ocean_s_coordinate", Kind::kS},
      {"ocean_s_coordinate_g1", Kind::kSG1},
      {"ocean_s_coordinate_g2", Kind::kSG2},
      {"ocean_sigma_z_coordinate", Kind::kSigmaZ},
      {"ocean_double_sigma_coordinate", Kind::kDoubleSigma},
      {"atmosphere_sleve_coordinate", Kind::kSleve},
      {"atmosphere_hybrid_height_coordinate", Kind::kHybridHeight},
      {"atmosphere_ln_pressure_coordinate", Kind::kLogPressure},
      {"atmosphere_sigma_coordinate", Kind::kSigmaPressure},
      {"atmosphere_hybrid_sigma_pressure_coordinate", Kind::kHybridPressure},
      {"hybrid_sigma_pressure", Kind::kHybridPressure}};
  const std::string name = coordinate.text("standard_name");
  const auto kind = kinds.find(name);
  if (kind == kinds.end()) {
    reason = fmt::format("{} has the formula of {}, which is not supported", coordinate.name,
                         name.empty() ? "no standard_name" : name);
    return std::nullopt;
  }
  std::string lacking;
  auto found =
      ofTerms(file, kind->second, formulaTerms(coordinate.text("formula_terms")), block, axis, lacking);
  if (!found)
    reason = fmt::format("the formula of {} has no term '{}' on these dimensions", coordinate.name, lacking);
  else
    found->description_ = fmt::format("{} of {}{}", name, coordinate.name, found->description_);
  return found;
}

std::optional<CfVertical> CfVertical::ofTerms(const NetcdfFiles& file, Kind kind, const Terms& terms,
                                              const CfDimensions& block, size_t axis, std::string& lacking) {
  CfVertical vertical;
  vertical.kind_ = kind;
  // ROMS and CROCO call theirs ocean_s_coordinate too; the stretching C tells them apart.
  if (vertical.kind_ == Kind::kS && terms.contains("C") && !terms.contains("a")) {
    const NetcdfVariable* const transform = file.find("Vtransform");
    const bool second =
        transform && transform->numeric && constant(file, CfTerm::of(file, *transform, block)) == 2;
    vertical.kind_ = second ? Kind::kSG2 : Kind::kSG1;
  }
  const bool air = vertical.kind_ == Kind::kHybridHeight || vertical.ofPressure();
  if (vertical.ofPressure()) vertical.description_ = " (pressure, at heights of the standard atmosphere)";
  const char* lacks = "";
  if (vertical.kind_ == Kind::kSleve ? !vertical.setSleveTerms(file, terms, block, axis, lacks)
      : air                          ? !vertical.setAirTerms(file, terms, block, axis, lacks)
                                     : !vertical.setOceanTerms(file, terms, block, axis, lacks)) {
    lacking = lacks;
    return std::nullopt;
  }
  return vertical;
}

bool CfVertical::setOceanTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block,
                               size_t axis, const char*& lacking) {
  const auto lacks = [&](const char* key) {
    lacking = key;
    return false;
  };
  const bool sigma = kind_ == Kind::kSigma || kind_ == Kind::kSigmaZ || kind_ == Kind::kDoubleSigma;
  s_ = termNamed(file, terms, sigma ? "sigma" : "s", block);
  eta_ = termNamed(file, terms, "eta", block);
  depth_ = termNamed(file, terms, "depth", block);
  if (!s_ || !s_->varies(axis)) return lacks(sigma ? "sigma" : "s");
  if (!depth_ || depth_->varies(axis)) return lacks("depth");
  scale_ = kilometresOf(depth_->variable().text("units")).value_or(1e-3);
  axis_ = axis;
  if (kind_ == Kind::kDoubleSigma) return setDoubleSigmaTerms(file, terms, block, lacking);
  if (!eta_) warnings_.push_back("no surface elevation (eta); 0 is assumed");
  if (kind_ == Kind::kSigma) return true;

  depth_c_ = constant(file, termNamed(file, terms, "depth_c", block));
  if (!std::isfinite(depth_c_)) return lacks("depth_c");
  if (kind_ == Kind::kSigmaZ) {
    levels_of_sigma_ = constant(file, termNamed(file, terms, "nsigma", block));
    if (!std::isfinite(levels_of_sigma_)) levels_of_sigma_ = INFINITY;
    c_ = termNamed(file, terms, "zlev", block);
    return (c_ && c_->varies(axis)) || lacks("zlev");
  }
  if (kind_ == Kind::kS) {
    a_ = constant(file, termNamed(file, terms, "a", block));
    b_ = constant(file, termNamed(file, terms, "b", block));
    if (!std::isfinite(a_) || a_ == 0) return lacks("a");
    return std::isfinite(b_) || lacks("b");
  }
  c_ = termNamed(file, terms, "C", block);
  return (c_ && c_->varies(axis)) || lacks("C");
}

bool CfVertical::setDoubleSigmaTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block,
                                     const char*& lacking) {
  const struct {
    const char* key;
    double* value;
  } constants[] = {{"z1", &z1_}, {"z2", &z2_}, {"a", &a_}, {"href", &depth_c_}, {"k_c", &levels_of_sigma_}};
  for (const auto& [key, value] : constants) {
    *value = constant(file, termNamed(file, terms, key, block));
    if (std::isfinite(*value)) continue;
    lacking = key;
    return false;
  }
  return true;
}

/// s_: a; c_, c2_: b1, b2; depth_, depth2_: the large and the small scales of the ground; a_: ztop. Lengths as stored.
bool CfVertical::setSleveTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block,
                               size_t axis, const char*& lacking) {
  const struct {
    const char* key;
    std::optional<CfTerm>* term;
    bool of_levels;
  } wanted[] = {{"a", &s_, true},
                {"b1", &c_, true},
                {"b2", &c2_, true},
                {"zsurf1", &depth_, false},
                {"zsurf2", &depth2_, false}};
  for (const auto& [key, term, of_levels] : wanted) {
    lacking = key;
    *term = termNamed(file, terms, key, block);
    if (!*term || (*term)->varies(axis) != of_levels) return false;
  }
  lacking = "ztop";
  const auto top = termNamed(file, terms, "ztop", block);
  a_ = constant(file, top);
  if (!std::isfinite(a_)) return false;
  scale_ = kilometresOf(depth_->variable().text("units")).value_or(1e-3);
  a_ *= kilometresOf(top->variable().text("units")).value_or(1e-3) / scale_;
  return true;
}

/// s_: a, ap, sigma or lev; c_: b; depth_: the surface's pressure or height; a_: p0 or ptop, in pascals.
bool CfVertical::setAirTerms(const NetcdfFiles& file, const Terms& terms, const CfDimensions& block,
                             size_t axis, const char*& lacking) {
  const auto lacks = [&](const char* key) {
    lacking = key;
    return false;
  };
  const auto pressure = [&](const std::optional<CfTerm>& term, double otherwise) {
    const double value = constant(file, term);
    return std::isfinite(value) ? value * pascalsOf(term->variable().text("units")).value_or(1) : otherwise;
  };
  const bool hybrid = kind_ == Kind::kHybridPressure, height = kind_ == Kind::kHybridHeight;
  const bool scaled = hybrid && !terms.contains("ap");
  const char* const first = kind_ == Kind::kSigmaPressure ? "sigma"
                            : kind_ == Kind::kLogPressure ? "lev"
                            : hybrid && !scaled           ? "ap"
                                                          : "a";
  s_ = termNamed(file, terms, first, block);
  if (!s_ || !s_->varies(axis)) return lacks(first);
  if (kind_ == Kind::kLogPressure) {
    a_ = pressure(termNamed(file, terms, "p0", block), kSeaLevelPressure);
    return true;
  }
  if (hybrid || height) {
    c_ = termNamed(file, terms, "b", block);
    if (!c_ || !c_->varies(axis)) return lacks("b");
  }
  depth_ = termNamed(file, terms, height ? "orog" : "ps", block);
  if (depth_ && depth_->varies(axis)) return lacks(height ? "orog" : "ps");
  if (height) {
    if (!depth_) warnings_.push_back("no height of the ground (orog); 0 is assumed");
    scale_ = kilometresOf(s_->variable().text("units")).value_or(1e-3);
    return true;
  }
  if (!depth_) warnings_.push_back("no surface pressure (ps); 1013.25 hPa is assumed");
  depth_c_ = depth_ ? pascalsOf(depth_->variable().text("units")).value_or(1) : 1;
  a_ = pressure(termNamed(file, terms, kind_ == Kind::kSigmaPressure ? "ptop" : "p0", block),
                kind_ == Kind::kSigmaPressure ? 0 : 1e5);
  // ap is a pressure already; a is a part of p0.
  if (hybrid && !scaled) a_ = pascalsOf(s_->variable().text("units")).value_or(1);
  return true;
}

}  // namespace curvisplat
