#include "preprocess/formats/netcdf/cf_vertical.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <sstream>

#include "preprocess/formats/netcdf/cf_roles.h"

namespace curvisplat {
namespace {

constexpr double kGravity = 9.81;  // WRF's

/// "s: s_rho C: Cs_r" as {s: s_rho, C: Cs_r}.
std::map<std::string, std::string> formulaTerms(const std::string& text) {
  std::map<std::string, std::string> terms;
  std::istringstream words(text);
  std::string key, name;
  while (words >> key >> name)
    if (key.size() > 1 && key.back() == ':') terms[key.substr(0, key.size() - 1)] = name;
  return terms;
}

std::optional<CfTerm> termNamed(const NetcdfFile& file, const std::map<std::string, std::string>& terms,
                                const char* key, const CfDimensions& block) {
  const auto name = terms.find(key);
  const NetcdfVariable* const variable = name == terms.end() ? nullptr : file.find(name->second);
  if (!variable || !variable->numeric) return std::nullopt;
  return CfTerm::of(file, *variable, block);
}

/// The value of a scalar term.
double constant(const NetcdfFile& file, const std::optional<CfTerm>& term) {
  if (!term || term->axes() > 0) return std::nan("");
  return term->read(file, {{0, 0, 0}, {1, 1, 1}}).values.at(0);
}

}  // namespace

std::pair<std::optional<CfVertical>, std::string> CfVertical::of(const NetcdfFile& file,
                                                                 const NetcdfVariable& variable,
                                                                 const CfDimensions& block, size_t axis) {
  const std::string& levels = file.dimensions()[block.axes[axis]].name;
  std::string reason = fmt::format("no depth or height along {}", levels);
  const NetcdfVariable* const along = file.find(levels);
  if (along && !along->text("formula_terms").empty())
    if (auto found = byFormula(file, *along, block, axis, reason)) return {std::move(found), ""};

  // Variables in its own `coordinates` attribute come first.
  std::vector<const NetcdfVariable*> candidates;
  std::istringstream names(variable.text("coordinates"));
  for (std::string name; names >> name;)
    if (const NetcdfVariable* const named = file.find(name)) candidates.push_back(named);
  if (along) candidates.push_back(along);
  for (const NetcdfVariable& other : file.variables()) candidates.push_back(&other);

  for (const bool of_nodes : {true, false}) {
    for (const NetcdfVariable* candidate : candidates) {
      if (cfRole(file, *candidate) != CfRole::kVertical) continue;
      const auto term = CfTerm::of(file, *candidate, block);
      if (!term || !term->exact() || !term->varies(axis) || (term->axes() > 1) != of_nodes) continue;
      if (auto found = byLevels(file, *candidate, block, axis, reason)) return {std::move(found), ""};
    }
    if (of_nodes)
      if (auto found = byGeopotential(file, block)) return {std::move(found), ""};
  }
  return {std::nullopt, reason};
}

std::optional<CfVertical> CfVertical::byLevels(const NetcdfFile& file, const NetcdfVariable& coordinate,
                                               const CfDimensions& block, size_t axis, std::string& reason) {
  const auto kilometres = kilometresOf(coordinate.text("units"));
  const auto term = CfTerm::of(file, coordinate, block);
  if (!term || !term->varies(axis)) return std::nullopt;
  if (!kilometres && (!coordinate.text("units").empty() || !coordinate.text("formula_terms").empty())) {
    reason =
        fmt::format("{} has the unit '{}'; expected a length", coordinate.name, coordinate.text("units"));
    return std::nullopt;
  }
  CfVertical vertical;
  vertical.scale_ = kilometres.value_or(1e-3) * (growsDownwards(coordinate) ? -1 : 1);
  vertical.terms_.push_back(*term);
  vertical.description_ = coordinate.name;
  if (!kilometres)
    vertical.warnings_.push_back(fmt::format("{} has no units; metres are assumed", coordinate.name));
  return vertical;
}

std::optional<CfVertical> CfVertical::byGeopotential(const NetcdfFile& file, const CfDimensions& block) {
  CfVertical vertical;
  for (const char* name : {"PHB", "PH"}) {
    const NetcdfVariable* const variable = file.find(name);
    if (!variable || variable->text("units") != "m2 s-2") return std::nullopt;
    const auto term = CfTerm::of(file, *variable, block);
    if (!term || term->axes() != 3) return std::nullopt;
    vertical.terms_.push_back(*term);
  }
  vertical.kind_ = Kind::kGeopotential;
  vertical.scale_ = 1e-3 / kGravity;
  vertical.description_ = "geopotential PH + PHB";
  return vertical;
}

std::optional<CfVertical> CfVertical::byFormula(const NetcdfFile& file, const NetcdfVariable& coordinate,
                                                const CfDimensions& block, size_t axis, std::string& reason) {
  static const std::map<std::string, Kind> kinds = {{"ocean_sigma_coordinate", Kind::kSigma},
                                                    {"ocean_s_coordinate", Kind::kS},
                                                    {"ocean_s_coordinate_g1", Kind::kSG1},
                                                    {"ocean_s_coordinate_g2", Kind::kSG2}};
  const std::string name = coordinate.text("standard_name");
  const auto kind = kinds.find(name);
  if (kind == kinds.end()) {
    reason = fmt::format("{} has the formula of {}, which is not supported", coordinate.name,
                         name.empty() ? "no standard_name" : name);
    return std::nullopt;
  }
  const std::map<std::string, std::string> terms = formulaTerms(coordinate.text("formula_terms"));
  CfVertical vertical;
  vertical.kind_ = kind->second;
  vertical.description_ = name + " of " + coordinate.name;
  vertical.s_ = termNamed(file, terms, kind->second == Kind::kSigma ? "sigma" : "s", block);
  vertical.eta_ = termNamed(file, terms, "eta", block);
  vertical.depth_ = termNamed(file, terms, "depth", block);
  const auto lacks = [&](const char* key) {
    reason = fmt::format("the formula of {} has no term '{}' on these dimensions", coordinate.name, key);
    return std::nullopt;
  };
  if (!vertical.s_ || !vertical.s_->varies(axis)) return lacks("s");
  if (!vertical.depth_ || vertical.depth_->varies(axis)) return lacks("depth");
  vertical.scale_ = kilometresOf(vertical.depth_->variable().text("units")).value_or(1e-3);
  if (!vertical.eta_) vertical.warnings_.push_back("no surface elevation (eta); 0 is assumed");
  if (kind->second == Kind::kSigma) return vertical;

  vertical.depth_c_ = constant(file, termNamed(file, terms, "depth_c", block));
  if (!std::isfinite(vertical.depth_c_)) return lacks("depth_c");
  if (kind->second == Kind::kS) {
    vertical.a_ = constant(file, termNamed(file, terms, "a", block));
    vertical.b_ = constant(file, termNamed(file, terms, "b", block));
    if (!std::isfinite(vertical.a_) || vertical.a_ == 0) return lacks("a");
    if (!std::isfinite(vertical.b_)) return lacks("b");
    return vertical;
  }
  vertical.c_ = termNamed(file, terms, "C", block);
  if (!vertical.c_ || !vertical.c_->varies(axis)) return lacks("C");
  return vertical;
}

/// Source: CF conventions 1.10, appendix D.
double CfVertical::formula(double s, double c, double eta, double depth, double depth_c) const {
  switch (kind_) {
    case Kind::kSigma:
      return eta + s * (depth + eta);
    case Kind::kS: {
      const double stretched = (1 - b_) * std::sinh(a_ * s) / std::sinh(a_) +
                               b_ * (std::tanh(a_ * (s + 0.5)) / (2 * std::tanh(0.5 * a_)) - 0.5);
      return eta * (1 + s) + depth_c * s + (depth - depth_c) * stretched;
    }
    case Kind::kSG1: {
      const double level = depth_c * s + (depth - depth_c) * c;
      return level + eta * (1 + level / depth);
    }
    default: {
      const double level = (depth_c * s + depth * c) / (depth_c + depth);
      return eta + (eta + depth) * level;
    }
  }
}

bool CfVertical::readNodes(const NetcdfFile& file, const CfRange& range, std::span<double> to) const {
  if (kind_ != Kind::kLevels || !terms_[0].ofNodes()) return false;
  const NetcdfBox box = terms_[0].boxOf(range);
  file.read(terms_[0].variable(), box, to);
  for (double& value : to.first(box.values())) value *= scale_;
  return true;
}

CfValues CfVertical::heights(const NetcdfFile& file, const CfRange& range) const {
  CfValues heights;
  if (!terms_.empty()) {
    heights = terms_[0].read(file, range);
    for (size_t n = 1; n < terms_.size(); ++n) {
      const CfValues more = terms_[n].read(file, range);
      for (size_t v = 0; v < heights.values.size(); ++v) heights.values[v] += more.values[v];
    }
    for (double& value : heights.values) value *= scale_;
    return heights;
  }
  const CfValues none{{1, 1, 1}, {0.0}};
  const CfValues s = s_->read(file, range), depth = depth_->read(file, range);
  const CfValues c = c_ ? c_->read(file, range) : none, eta = eta_ ? eta_->read(file, range) : none;
  for (size_t axis = 0; axis < 3; ++axis) heights.count[axis] = range.end[axis] - range.begin[axis];
  for (uint64_t k = 0; k < heights.count[2]; ++k)
    for (uint64_t j = 0; j < heights.count[1]; ++j)
      for (uint64_t i = 0; i < heights.count[0]; ++i) {
        // On land the elevation is missing, but the depth may be known.
        const double elevation = eta.at(i, j, k);
        heights.values.push_back(scale_ * formula(s.at(i, j, k), c.at(i, j, k),
                                                  std::isfinite(elevation) ? elevation : 0, depth.at(i, j, k),
                                                  depth_c_));
      }
  return heights;
}

}  // namespace curvisplat
