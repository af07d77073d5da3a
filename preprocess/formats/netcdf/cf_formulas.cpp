// The formulas of CfVertical: which there are, and the variables that their terms are.
#include <fmt/format.h>

#include <cmath>
#include <initializer_list>
#include <map>
#include <sstream>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_vertical.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

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
    {"ps", "surface_air_pressure", {"PS", "ps", "aps", "PSFC", "sp", "pressfc", "lnsp"}},
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
  // CROCO's sc_r, Cs_r and hc are attributes of the file.
  if (!variable)
    if (auto term = CfTerm::ofNumbers(file, file.numbers(name->second.c_str()), block)) return term;
  if (!variable) variable = standIn(file, key, block);
  if (!variable || !variable->numeric) return std::nullopt;
  return CfTerm::of(file, *variable, block);
}

/// The ECMWF's lnsp is the logarithm of the surface's pressure in pascals.
bool isLogarithm(const NetcdfVariable& variable) {
  const std::string name = lowerCase(variable.name);
  return name == "lnsp" || name == "lnps" ||
         lowerCase(variable.text("long_name") + variable.text("standard_name")).find("logarithm") !=
             std::string::npos;
}

/// The value of a scalar term.
double constant(const NetcdfFiles& file, const std::optional<CfTerm>& term) {
  if (!term || term->axes() > 0) return std::nan("");
  return term->read(file, {{0, 0, 0}, {1, 1, 1}}).values.at(0);
}

}  // namespace

/// Formulas without formula_terms, by the names that models give to their terms. `lacking`: what there is, and what is missing.
std::optional<CfVertical> CfVertical::byNamesOfTerms(const NetcdfFiles& file, const CfDimensions& block,
                                                     size_t axis, std::string& lacking) {
  const auto along = [&](std::initializer_list<const char*> names) -> std::string {
    // What is between levels serves, too: GFDL has pk and bk of half levels alone.
    for (const bool exact : {true, false})
      for (const char* const name : names) {
        const NetcdfVariable* const variable = file.find(name);
        const auto term = variable && variable->numeric ? CfTerm::of(file, *variable, block)
                                                        : CfTerm::ofNumbers(file, file.numbers(name), block);
        if (term && (exact ? term->exact() : term->surrounds(axis)) && term->axes() == 1 &&
            term->varies(axis))
          return name;
      }
    return "";
  };
  const auto named = [](std::optional<CfVertical> found, const std::string& terms) {
    if (found) found->description_ = fmt::format("formula of {}{}", terms, found->description_);
    return found;
  };
  std::string reason;
  const std::string s = along({"s_rho", "s_w", "sc_r", "sc_w"}), c = along({"Cs_r", "Cs_w"});
  if (!s.empty() && !c.empty() && (file.find("hc") || file.number("hc")) && standIn(file, "depth", block))
    return named(
        ofTerms(file, Kind::kS, {{"s", s}, {"C", c}, {"eta", "zeta"}, {"depth", "h"}, {"depth_c", "hc"}},
                block, axis, reason),
        s);
  const std::string a = along({"hyam", "hyai", "ap", "A", "a", "pk", "ak"}),
                    b = along({"hybm", "hybi", "b", "B", "bk"});
  if (a.empty() || b.empty()) return std::nullopt;
  if (standIn(file, "ps", block))
    return named(ofTerms(file, Kind::kHybridPressure, {{"a", a}, {"b", b}, {"p0", "P0"}, {"ps", "PS"}}, block,
                         axis, reason),
                 a + " and " + b);
  lacking = fmt::format("there are {} and {}, but no surface pressure (ps)", a, b);
  return std::nullopt;
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
        file.text("VertCoordType") == "NEW" ||
        (transform && transform->numeric && constant(file, CfTerm::of(file, *transform, block)) == 2);
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
  const char* const first = kind_ == Kind::kSigmaPressure    ? "sigma"
                            : kind_ == Kind::kLogPressure    ? "lev"
                            : hybrid && terms.contains("ap") ? "ap"
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
  log_surface_ = depth_ && isLogarithm(depth_->variable());
  a_ = pressure(termNamed(file, terms, kind_ == Kind::kSigmaPressure ? "ptop" : "p0", block),
                kind_ == Kind::kSigmaPressure ? 0 : 1e5);
  // ap is a pressure already, and so is what GEOS-Chem calls a, and numbers beyond 10; else a is a part of p0.
  auto pascals = pascalsOf(s_->variable().text("units"));
  CfRange all{{0, 0, 0}, {1, 1, 1}};
  all.end[axis] = file.dimensions()[block.axes[axis]].length;
  if (hybrid && !pascals && std::ranges::max(s_->read(file, all).values) > 10) pascals = 1;
  if (hybrid && (pascals || terms.contains("ap"))) a_ = pascals.value_or(1);
  return true;
}

}  // namespace curvisplat
