#include "preprocess/formats/cgns/cgns_units.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

namespace curvisplat {
namespace {

constexpr size_t kUnits = 5;  // mass, length, time, temperature, angle
using Exponents = std::array<double, kUnits>;

struct UnitSymbol {
  std::string_view name, symbol;
};

constexpr UnitSymbol kSymbols[] = {
    {"Kilogram", "kg"},  {"Gram", "g"},          {"Slug", "slug"},     {"PoundMass", "lbm"},
    {"Meter", "m"},      {"Centimeter", "cm"},   {"Millimeter", "mm"}, {"Foot", "ft"},
    {"Inch", "in"},      {"Second", "s"},        {"Kelvin", "K"},      {"Celsius", "degC"},
    {"Rankine", "degR"}, {"Fahrenheit", "degF"}, {"Degree", "deg"},    {"Radian", "rad"},
};

struct NamedExponents {
  std::string_view prefix;  // of the name of the array
  Exponents exponents;
};

// The first match counts, so a longer prefix precedes a shorter one.
constexpr NamedExponents kStandard[] = {
    {"Density", {1, -3, 0, 0, 0}},
    {"EnergyStagnationDensity", {1, -1, -2, 0, 0}},
    {"EnergyInternal", {0, 2, -2, 0, 0}},
    {"EnergyKinetic", {0, 2, -2, 0, 0}},
    {"EnergyStagnation", {0, 2, -2, 0, 0}},
    {"EnthalpyStagnation", {0, 2, -2, 0, 0}},
    {"Enthalpy", {0, 2, -2, 0, 0}},
    {"Entropy", {1, -1, -2, -1, 0}},
    {"Momentum", {1, -2, -1, 0, 0}},
    {"Pressure", {1, -1, -2, 0, 0}},
    {"Temperature", {0, 0, 0, 1, 0}},
    {"TurbulentDissipationRate", {0, 0, -1, 0, 0}},
    {"TurbulentDissipation", {0, 2, -3, 0, 0}},
    {"TurbulentEnergyKinetic", {0, 2, -2, 0, 0}},
    {"TurbulentSANuTilde", {0, 2, -1, 0, 0}},
    {"VelocitySound", {0, 1, -1, 0, 0}},
    {"Velocity", {0, 1, -1, 0, 0}},
    {"ViscosityMolecular", {1, -1, -1, 0, 0}},
    {"ViscosityEddyKinematic", {0, 2, -1, 0, 0}},
    {"ViscosityEddy", {1, -1, -1, 0, 0}},
    {"ViscosityKinematic", {0, 2, -1, 0, 0}},
    {"Vorticity", {0, 0, -1, 0, 0}},
};

std::string_view symbolOf(std::string_view name) {
  for (const UnitSymbol& unit : kSymbols)
    if (unit.name == name) return unit.symbol;
  return {};
}

std::optional<Exponents> exponentsOf(const std::vector<double>& told, std::string_view array_name) {
  if (!told.empty()) {
    Exponents exponents{};
    std::copy_n(told.begin(), std::min(told.size(), kUnits), exponents.begin());
    return exponents;
  }
  for (const NamedExponents& standard : kStandard)
    if (array_name.starts_with(standard.prefix)) return standard.exponents;
  return std::nullopt;
}

}  // namespace

std::string cgnsUnit(const std::vector<std::string>& units, const std::vector<double>& exponents,
                     const std::string& array_name) {
  const auto powers = exponentsOf(exponents, array_name);
  if (!powers || units.size() < kUnits) return "";
  std::string unit;
  for (size_t n = 0; n < kUnits; ++n) {
    const double power = (*powers)[n];
    if (power == 0) continue;
    const std::string_view symbol = symbolOf(units[n]);
    if (symbol.empty() || !std::isfinite(power)) return "";
    unit += fmt::format("{}{}", unit.empty() ? "" : " ", symbol);
    if (power != 1) unit += fmt::format("{:g}", power);
  }
  return unit;
}

}  // namespace curvisplat
