#include "preprocess/formats/cgns/cgns_solutions.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr double kMaxSteps = 1 << 20;

const CgnsNode* named(const std::vector<CgnsNode>& nodes, const char* name) {
  const auto found =
      std::find_if(nodes.begin(), nodes.end(), [&](const CgnsNode& node) { return node.name == name; });
  return found == nodes.end() ? nullptr : &*found;
}

const CgnsNode* labelled(const std::vector<CgnsNode>& nodes, const char* label) {
  const auto found =
      std::find_if(nodes.begin(), nodes.end(), [&](const CgnsNode& node) { return node.label == label; });
  return found == nodes.end() ? nullptr : &*found;
}

void checkCount(const CgnsFile& file, const CgnsNode& node, size_t found, size_t expected) {
  if (found != expected)
    throw Error("{}: {} has {} entries; expected {}, one per time step; the file is damaged",
                file.path().string(), node.path, found, expected);
}

/// The names of zones, one row per time step.
std::vector<std::vector<std::string>> zonesOfSteps(const CgnsFile& file, const CgnsNode& pointers,
                                                   size_t steps) {
  const std::vector<std::string> names = file.texts(pointers);
  if (names.size() % steps != 0) checkCount(file, pointers, names.size(), steps);
  const size_t most = names.size() / steps;
  std::vector<std::vector<std::string>> zones(steps);
  for (size_t n = 0; n < names.size(); ++n) zones[n / most].push_back(names[n]);
  return zones;
}

bool isNull(const std::string& name) {
  return name.empty() || name == "Null";
}

/// The node that a table of names, one per time step, names for `step`; null where the entry is "Null".
const CgnsNode* pointedAt(const CgnsFile& file, const std::vector<CgnsNode>& zone, const CgnsNode& pointers,
                          size_t steps, uint32_t step) {
  const std::vector<std::string> names = file.texts(pointers);
  checkCount(file, pointers, names.size(), steps);
  if (step >= names.size() || isNull(names[step])) return nullptr;
  const CgnsNode* const node = named(zone, names[step].c_str());
  if (!node)
    throw Error("{}: {} names {} for time step {}, but the zone has no such node", file.path().string(),
                pointers.path, names[step], step);
  return node;
}

struct StepOf {
  size_t steps;
  uint32_t step;
};

/// Assigns each solution to the first time step that has none of its fields yet.
std::vector<std::vector<CgnsNode>> inOrder(const CgnsFile& file, const std::vector<CgnsNode>& zone) {
  std::vector<std::vector<CgnsNode>> steps;
  std::vector<std::set<std::string>> taken;
  for (const CgnsNode& solution : zone) {
    if (solution.label != "FlowSolution_t") continue;
    std::string location = "Vertex";
    std::vector<std::string> fields;
    for (const CgnsNode& child : file.children(solution)) {
      if (child.label == "GridLocation_t") location = file.text(child);
      if (child.label == "DataArray_t") fields.push_back(child.name);
    }
    for (std::string& field : fields) field = location + "/" + field;
    size_t step = 0;
    while (step < steps.size() && std::any_of(fields.begin(), fields.end(), [&](const std::string& field) {
             return taken[step].contains(field);
           }))
      ++step;
    if (step == steps.size()) {
      steps.emplace_back();
      taken.emplace_back();
    }
    steps[step].push_back(solution);
    taken[step].insert(fields.begin(), fields.end());
  }
  return steps;
}

/// The step that IOSS writes into a solution, from 1: as a descriptor, and at the end of its name. Its files
/// have no pointers if the run has not come to its end.
std::optional<size_t> stepOfIoss(const CgnsFile& file, const CgnsNode& solution) {
  static const std::string at_step = "AtStep";
  std::string text;
  for (const CgnsNode& child : file.children(solution))
    if (child.label == "Descriptor_t" && (child.name == "Step" || child.name == "step"))
      text = file.text(child);
  if (const size_t found = solution.name.rfind(at_step); text.empty() && found != std::string::npos)
    text = solution.name.substr(found + at_step.size());
  size_t step = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), step);
  if (error != std::errc{} || end != text.data() + text.size() || step < 1 || step > kMaxSteps)
    return std::nullopt;
  return step;
}

/// Numbers nodes by the steps of IOSS, the first of `count` or, where there is no count, the first that there
/// is; empty if a solution has none.
std::vector<std::vector<CgnsNode>> asIossNumbers(const CgnsFile& file, const std::vector<CgnsNode>& zone,
                                                 size_t count) {
  std::map<size_t, std::vector<CgnsNode>> numbered;
  for (const CgnsNode& solution : zone) {
    if (solution.label != "FlowSolution_t") continue;
    const auto step = stepOfIoss(file, solution);
    if (!step) return {};
    numbered[*step].push_back(solution);
  }
  if (numbered.empty()) return {};
  std::vector<std::vector<CgnsNode>> steps;
  if (numbered.rbegin()->first <= count) {
    steps.resize(count);
    for (auto& [step, solutions] : numbered) steps[step - 1] = std::move(solutions);
  } else {
    for (auto& [step, solutions] : numbered) steps.push_back(std::move(solutions));
  }
  return steps;
}

/// Whether a table names nodes, and the zone has none of them.
bool namesWhatIsNotThere(const CgnsFile& file, const std::vector<CgnsNode>& zone, const CgnsNode& pointers) {
  std::vector<std::string> names = file.texts(pointers);
  std::erase_if(names, [](const std::string& name) { return isNull(name); });
  return !names.empty() && std::none_of(names.begin(), names.end(), [&](const std::string& name) {
    return named(zone, name.c_str()) != nullptr;
  });
}

/// Adds the solutions of a step that FlowSolutionPointers names. IOSS has a table of its own for each
/// location besides (VertexSolutionPointers, CellCenterSolutionPointers), and FlowSolutionPointers may then
/// name nothing that exists; without those tables, its numbers tell the steps. False if there is no such
/// table.
bool pointedSolutions(const CgnsFile& file, const std::vector<CgnsNode>& zone,
                      const std::vector<CgnsNode>& data, const StepOf& at, std::vector<CgnsNode>& solutions) {
  const CgnsNode* const standard = named(data, "FlowSolutionPointers");
  bool other = false;
  for (const CgnsNode& pointers : data) {
    if (!pointers.name.ends_with("SolutionPointers") || &pointers == standard) continue;
    other = true;
    if (const CgnsNode* const solution = pointedAt(file, zone, pointers, at.steps, at.step))
      solutions.push_back(*solution);
  }
  if (!standard) return other;
  if (other) {
    const std::vector<std::string> names = file.texts(*standard);
    const bool known = at.step < names.size() && named(zone, names[at.step].c_str());
    if (!known) return true;
  } else if (at.step < at.steps && namesWhatIsNotThere(file, zone, *standard)) {
    std::vector<std::vector<CgnsNode>> numbered = asIossNumbers(file, zone, at.steps);
    if (numbered.size() == at.steps) {
      solutions = std::move(numbered[at.step]);
      return true;
    }
  }
  const CgnsNode* const solution = pointedAt(file, zone, *standard, at.steps, at.step);
  const auto listed = [&](const CgnsNode& one) { return one.path == solution->path; };
  if (solution && std::none_of(solutions.begin(), solutions.end(), listed)) solutions.push_back(*solution);
  return true;
}

}  // namespace

bool CgnsSteps::has(const std::string& zone, uint32_t step) const {
  if (step >= zones.size()) return true;
  return std::find(zones[step].begin(), zones[step].end(), zone) != zones[step].end();
}

CgnsSteps readCgnsSteps(const CgnsFile& file, const std::vector<CgnsNode>& base) {
  CgnsSteps steps;
  const CgnsNode* const data = labelled(base, "BaseIterativeData_t");
  if (!data) return steps;
  const std::vector<double> count = file.numbers(*data);
  if (count.size() != 1 || !(count[0] >= 1 && count[0] <= kMaxSteps))
    throw Error("{}: {} has {} time steps; expected 1 to {}", file.path().string(), data->path,
                numberText(count[0]), kMaxSteps);
  steps.count = static_cast<size_t>(count[0]);
  const std::vector<CgnsNode> children = file.children(*data);
  const CgnsNode* times = named(children, "TimeValues");
  if (!times) times = named(children, "IterationValues");
  if (times) {
    steps.times = file.numbers(*times);
    checkCount(file, *times, steps.times.size(), steps.count);
  } else {
    for (size_t n = 0; n < steps.count; ++n) steps.times.push_back(static_cast<double>(n));
  }
  if (const CgnsNode* const pointers = named(children, "ZonePointers"))
    steps.zones = zonesOfSteps(file, *pointers, steps.count);
  return steps;
}

CgnsZoneStep readCgnsZoneStep(const CgnsFile& file, const std::vector<CgnsNode>& zone, const CgnsSteps& steps,
                              uint32_t step) {
  CgnsZoneStep result;
  const CgnsNode* grid = named(zone, "GridCoordinates");
  if (!grid) grid = labelled(zone, "GridCoordinates_t");
  std::vector<CgnsNode> data;
  if (steps.count > 0)
    if (const CgnsNode* const node = labelled(zone, "ZoneIterativeData_t")) data = file.children(*node);
  if (const CgnsNode* const pointers = named(data, "GridCoordinatesPointers"))
    if (const CgnsNode* const moved = pointedAt(file, zone, *pointers, steps.count, step)) grid = moved;
  if (grid) result.grid = *grid;

  if (pointedSolutions(file, zone, data, {steps.count, step}, result.solutions)) return result;
  std::vector<std::vector<CgnsNode>> order = asIossNumbers(file, zone, steps.count);
  if (order.empty()) order = inOrder(file, zone);
  result.implied_steps = std::max<size_t>(1, order.size());
  if (order.size() == 1)
    result.solutions = std::move(order[0]);
  else if (step < order.size())
    result.solutions = std::move(order[step]);
  return result;
}

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
