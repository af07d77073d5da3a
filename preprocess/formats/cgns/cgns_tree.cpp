#include "preprocess/formats/cgns/cgns_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "preprocess/formats/cgns/cgns_patches.h"
#include "preprocess/formats/cgns/cgns_solutions.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;
// Largest number of nodes along an axis: 2^31 - 1, the limit of 32-bit sizes.
constexpr double kMaxNodes = 2147483647.0;
constexpr double kMaxPoints = 0x1p53;  // of unstructured zones

using Nodes = std::vector<CgnsNode>;
using Dims = std::vector<uint64_t>;  // three, or one of unstructured zones

std::string describe(const Dims& dims) {
  return fmt::format("{}", fmt::join(dims, "x"));
}

Dims dimsOf(const CgnsZone& zone) {
  if (!zone.sections.empty()) return {zone.nodes[0]};
  return {zone.nodes.begin(), zone.nodes.end()};
}

/// Units apply to all descendants that do not set their own.
struct UnitContext {
  std::string data_class;
  std::vector<std::string> units;
};

class TreeReader {
 public:
  TreeReader(const CgnsFile& file, uint32_t step) : file_(file), step_(step) {}

  CgnsTree read();

 private:
  void readBase(const CgnsNode& base);
  void readZone(const CgnsNode& base, const CgnsNode& node, const UnitContext& units, const CgnsSteps& steps);
  void chooseZones();
  std::array<CgnsArray, 3> readCoordinates(const CgnsNode& grid, const Dims& nodes) const;
  void addSolution(const CgnsNode& solution, UnitContext units, CgnsZone& zone);
  UnitContext below(const Nodes& children, UnitContext units) const;
  CgnsArray arrayOf(const CgnsNode& node, const Dims& dims, const std::vector<uint64_t>& rind) const;
  std::vector<uint64_t> rindOf(const Nodes& children, size_t axes) const;
  bool setSizes(const CgnsNode& node, bool unstructured, CgnsZone& zone);
  void addConditions(const Nodes& children, CgnsZone& zone);
  void addHoles(const CgnsNode& node, CgnsZone& zone);
  void readFamilyType(const CgnsNode& family);
  std::string familyType(const CgnsNode& condition, const Nodes& details) const;
  void writeNotes();
  void warnOfEqualBases();
  void warnOfOmissions();

  const CgnsFile& file_;
  uint32_t step_;
  CgnsTree tree_;
  std::optional<std::vector<double>> stored_times_;          // from BaseIterativeData
  size_t implied_steps_ = 1;                                 // from the order of the solutions
  std::map<std::string, std::vector<std::string>> omitted_;  // reason -> zones
  std::map<std::string, size_t> conditions_;                 // type of boundary condition -> how many
  std::vector<std::string> families_, units_;
  std::map<std::string, std::string> family_types_;  // of the base: family -> type of its boundary condition
  size_t holes_ = 0;                                 // sets of overset holes
};

CgnsTree TreeReader::read() {
  bool any = false;
  for (const CgnsNode& node : file_.children(file_.root())) {
    if (node.label != "CGNSBase_t") continue;
    readBase(node);
    any = true;
  }
  if (!any)
    throw Error("{}: has no CGNSBase_t node; expected a CGNS file with at least one base",
                file_.path().string());
  if (stored_times_) {
    tree_.times = *stored_times_;
  } else if (implied_steps_ > 1) {
    for (size_t n = 0; n < implied_steps_; ++n) tree_.times.push_back(static_cast<double>(n));
  }
  chosenTimeStep(file_.path().string(), tree_.times, step_);
  chooseZones();
  warnOfOmissions();
  warnOfEqualBases();
  writeNotes();
  return std::move(tree_);
}

/// The type of a condition: that of its family where it says so.
std::string TreeReader::familyType(const CgnsNode& condition, const Nodes& details) const {
  std::string type = file_.text(condition);
  if (type != "FamilySpecified") return type;
  for (const CgnsNode& detail : details)
    if (detail.label == "FamilyName_t")
      if (const auto found = family_types_.find(file_.text(detail)); found != family_types_.end())
        type = found->second;
  return type;
}

void TreeReader::readFamilyType(const CgnsNode& family) {
  try {
    for (const CgnsNode& child : file_.children(family))
      if (child.label == "FamilyBC_t") family_types_[family.name] = file_.text(child);
  } catch (const Error&) {
    // The volume does not need the types of families, either.
  }
}

void TreeReader::addConditions(const Nodes& children, CgnsZone& zone) {
  for (const CgnsNode& node : children) {
    if (node.label == "ZoneBC_t")
      for (const CgnsNode& condition : file_.children(node)) {
        if (condition.label != "BC_t") continue;
        ++conditions_[file_.text(condition)];
        try {
          const Nodes details = file_.children(condition);
          if (!zone.sections.empty()) continue;
          auto boundary = cgnsBoundary(file_, details, zone.nodes);
          if (!boundary) continue;
          boundary->name = condition.name;
          boundary->type = familyType(condition, details);
          zone.boundaries.push_back(std::move(*boundary));
        } catch (const Error&) {
          // The volume does not need it, and most files are drawn without boundaries.
        }
      }
    if (node.label == "ZoneGridConnectivity_t")
      for (const CgnsNode& connectivity : file_.children(node))
        if (connectivity.label == "OversetHoles_t") addHoles(connectivity, zone);
  }
}

void TreeReader::addHoles(const CgnsNode& node, CgnsZone& zone) {
  if (!zone.sections.empty()) {
    tree_.warnings.push_back(fmt::format("{} is not applied: its zone is unstructured", node.path.substr(1)));
    return;
  }
  try {
    zone.holes.add(file_, node, zone.nodes);
    ++holes_;
  } catch (const Error& error) {
    tree_.warnings.push_back(
        fmt::format("{} is not applied, and its cells are drawn: {}", node.path.substr(1), error.what()));
  }
}

void TreeReader::writeNotes() {
  constexpr size_t kMaxListed = 8;
  std::vector<std::string> conditions;
  for (const auto& [type, count] : conditions_) conditions.push_back(fmt::format("{} {}", type, count));
  if (!conditions.empty()) tree_.notes.push_back("boundary conditions: " + listed(conditions, kMaxListed));
  if (!families_.empty()) tree_.notes.push_back("families: " + listed(families_, kMaxListed));
  if (!units_.empty()) tree_.notes.push_back("units: " + listed(units_, kMaxListed));
  if (holes_ > 0) tree_.notes.push_back("overset holes: " + countText(holes_, "set"));
}

void TreeReader::readBase(const CgnsNode& base) {
  const std::vector<double> dimensions = file_.numbers(base);
  const Nodes children = file_.children(base);
  if (dimensions.size() != 2)
    throw Error("{}: {} has {} numbers; expected 2 (dimensions of cells and of space); the file is damaged",
                file_.path().string(), base.path, dimensions.size());
  if (dimensions[0] != 3 || dimensions[1] != 3) {
    for (const CgnsNode& node : children)
      if (node.label == "Zone_t")
        omitted_[fmt::format("of {}-dimensional cells in {}-dimensional space (volumes are needed)",
                             numberText(dimensions[0]), numberText(dimensions[1]))]
            .push_back(node.path.substr(1));
    return;
  }
  const UnitContext units = below(children, {});
  for (const CgnsNode& node : children)
    if (node.label == "Family_t") {
      families_.push_back(node.name);
      readFamilyType(node);
    }
  if (units_.empty()) units_ = units.units;
  const CgnsSteps steps = readCgnsSteps(file_, children);
  if (steps.count > 0 && !stored_times_) stored_times_ = steps.times;
  const size_t before = tree_.zones.size();
  for (const CgnsNode& node : children)
    if (node.label == "Zone_t" && steps.has(node.name, step_)) readZone(base, node, units, steps);
  if (tree_.zones.size() > before) ++tree_.bases;
}

/// Sets the numbers of nodes and cells. False if the zone is left out.
bool TreeReader::setSizes(const CgnsNode& node, bool unstructured, CgnsZone& zone) {
  const std::vector<double> sizes = file_.numbers(node);
  const size_t expected = unstructured ? 3 : 9;
  if (sizes.size() != expected)
    throw Error("{}: {} has {} sizes; expected {} (nodes, cells and boundary nodes{}); the file is damaged",
                file_.path().string(), node.path, sizes.size(), expected,
                unstructured ? "" : " along i, j, k");
  if (unstructured) {
    if (!(sizes[0] >= 1 && sizes[0] <= kMaxPoints && sizes[1] >= 0 && sizes[1] <= kMaxPoints))
      throw Error("{}: {} declares {} nodes and {} cells; the file is damaged", file_.path().string(),
                  node.path, numberText(sizes[0]), numberText(sizes[1]));
    zone.nodes = {static_cast<uint64_t>(sizes[0]), 1, 1};
    zone.cells = static_cast<uint64_t>(sizes[1]);
    return true;
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!(sizes[axis] >= 1 && sizes[axis] <= kMaxNodes))
      throw Error("{}: {} declares {} nodes along {}; the file is damaged", file_.path().string(), node.path,
                  numberText(sizes[axis]), "ijk"[axis]);
    zone.nodes[axis] = static_cast<uint64_t>(sizes[axis]);
  }
  if (*std::min_element(zone.nodes.begin(), zone.nodes.end()) >= 2) return true;
  omitted_["of a single plane of nodes (volumes are needed)"].push_back(
      fmt::format("{} ({})", node.path.substr(1), describe(dimsOf(zone))));
  return false;
}

void TreeReader::readZone(const CgnsNode& base, const CgnsNode& node, const UnitContext& base_units,
                          const CgnsSteps& steps) {
  const Nodes children = file_.children(node);
  const auto type = std::find_if(children.begin(), children.end(),
                                 [](const CgnsNode& child) { return child.label == "ZoneType_t"; });
  const std::string kind = type == children.end() ? "Structured" : file_.text(*type);
  const bool unstructured = kind == "Unstructured";
  if (!unstructured && kind != "Structured") {
    omitted_[fmt::format("of type {} (expected Structured or Unstructured)", kind)].push_back(
        node.path.substr(1));
    return;
  }
  CgnsZone zone;
  zone.base = base.name;
  zone.name = node.name;
  if (!setSizes(node, unstructured, zone)) return;
  for (const CgnsNode& child : children)
    if (unstructured && child.label == "Elements_t") zone.sections.push_back(child);
  if (unstructured && zone.sections.empty()) {
    omitted_["without elements"].push_back(node.path.substr(1));
    return;
  }

  const CgnsZoneStep step = readCgnsZoneStep(file_, children, steps, step_);
  implied_steps_ = std::max(implied_steps_, step.implied_steps);
  if (!step.grid) {
    omitted_["without coordinates"].push_back(node.path.substr(1));
    return;
  }
  zone.coordinates = readCoordinates(*step.grid, dimsOf(zone));
  const UnitContext units = below(children, base_units);
  for (const CgnsNode& solution : step.solutions) addSolution(solution, units, zone);
  addConditions(children, zone);
  tree_.zones.push_back(std::move(zone));
}

std::array<CgnsArray, 3> TreeReader::readCoordinates(const CgnsNode& grid, const Dims& nodes) const {
  const Nodes children = file_.children(grid);
  const std::vector<uint64_t> rind = rindOf(children, nodes.size());
  std::array<CgnsArray, 3> coordinates;
  std::string found;
  int known = 0;
  for (const CgnsNode& child : children) {
    if (child.label != "DataArray_t") continue;
    found += (found.empty() ? "" : ", ") + child.name;
    for (size_t axis = 0; axis < 3; ++axis)
      if (child.name == std::string("Coordinate") + "XYZ"[axis]) {
        coordinates[axis] = arrayOf(child, nodes, rind);
        ++known;
      }
  }
  if (known != 3)
    throw Error(
        "{}: {} has the coordinates {}; expected CoordinateX, CoordinateY and CoordinateZ (only Cartesian "
        "coordinates are read): convert them with the program that wrote the file",
        file_.path().string(), grid.path, found.empty() ? "(none)" : found);
  return coordinates;
}

void TreeReader::addSolution(const CgnsNode& solution, UnitContext units, CgnsZone& zone) {
  const Nodes children = file_.children(solution);
  Centring centring = Centring::kNode;
  for (const CgnsNode& child : children) {
    if (child.label == "GridLocation_t") {
      const std::string location = file_.text(child);
      if (location == "CellCenter") {
        centring = Centring::kCell;
      } else if (location != "Vertex") {
        tree_.warnings.push_back(
            fmt::format("{} is left out: its GridLocation is {}; expected Vertex or CellCenter",
                        solution.path.substr(1), location));
        return;
      }
    } else if (child.name == "PointList" || child.name == "PointRange") {
      tree_.warnings.push_back(
          fmt::format("{} is left out: it covers only a part of its zone", solution.path.substr(1)));
      return;
    }
  }
  units = below(children, units);
  Dims dims = dimsOf(zone);
  const std::vector<uint64_t> rind = rindOf(children, dims.size());
  if (centring == Centring::kCell) {
    if (dims.size() == 1)
      dims[0] = zone.cells;
    else
      for (uint64_t& n : dims) --n;
  }
  for (const CgnsNode& child : children) {
    if (child.label != "DataArray_t") continue;
    const Nodes details = file_.children(child);
    const UnitContext own = below(details, units);
    std::vector<double> exponents;
    for (const CgnsNode& detail : details)
      if (detail.label == "DimensionalExponents_t") exponents = file_.numbers(detail);
    const bool dimensional = own.data_class.empty() || own.data_class == "Dimensional";
    zone.fields.push_back({child.name, dimensional ? cgnsUnit(own.units, exponents, child.name) : "",
                           centring, arrayOf(child, dims, rind)});
  }
}

UnitContext TreeReader::below(const Nodes& children, UnitContext units) const {
  for (const CgnsNode& child : children) {
    if (child.label == "DataClass_t") units.data_class = file_.text(child);
    if (child.label == "DimensionalUnits_t") units.units = file_.texts(child);
  }
  return units;
}

CgnsArray TreeReader::arrayOf(const CgnsNode& node, const Dims& dims,
                              const std::vector<uint64_t>& rind) const {
  CgnsArray array{node, file_.shape(node), {}};
  Dims expected = dims;
  for (size_t axis = 0; axis < dims.size(); ++axis) {
    array.rind[axis] = rind[2 * axis];
    expected[axis] += rind[2 * axis] + rind[2 * axis + 1];
  }
  if (array.shape.dims != expected)
    throw Error(
        "{}: {} has {} values; expected {} (the zone's size plus its rind planes); the file is damaged",
        file_.path().string(), node.path, array.shape.dims.empty() ? "no" : describe(array.shape.dims),
        describe(expected));
  if (!array.shape.number())
    throw Error("{}: {} has values of type '{}'; expected R4, R8, I4 or I8", file_.path().string(), node.path,
                array.shape.type);
  return array;
}

/// Planes at the lower and upper end of each axis; of an unstructured zone samples before and after its own.
std::vector<uint64_t> TreeReader::rindOf(const Nodes& children, size_t axes) const {
  std::vector<uint64_t> rind(2 * axes);
  for (const CgnsNode& child : children) {
    if (child.label != "Rind_t") continue;
    const std::vector<double> planes = file_.numbers(child);
    if (planes.size() != rind.size())
      throw Error("{}: {} has {} numbers; expected {} (planes at the lower and upper end of {})",
                  file_.path().string(), child.path, planes.size(), rind.size(),
                  axes == 3 ? "i, j, k" : "its list");
    for (size_t n = 0; n < rind.size(); ++n) {
      if (!(planes[n] >= 0 && planes[n] <= kMaxNodes))
        throw Error("{}: {} declares {} planes; the file is damaged", file_.path().string(), child.path,
                    numberText(planes[n]));
      rind[n] = static_cast<uint64_t>(planes[n]);
    }
  }
  return rind;
}

/// Structured zones where there are any.
void TreeReader::chooseZones() {
  const auto is_mesh = [](const CgnsZone& zone) { return !zone.sections.empty(); };
  const auto meshes = std::count_if(tree_.zones.begin(), tree_.zones.end(), is_mesh);
  tree_.unstructured = meshes > 0 && meshes == std::ssize(tree_.zones);
  if (meshes == 0 || tree_.unstructured) return;
  for (const CgnsZone& zone : tree_.zones)
    if (is_mesh(zone))
      omitted_["unstructured (a cache holds structured or unstructured zones; the structured ones are read)"]
          .push_back(zone.base + "/" + zone.name);
  std::erase_if(tree_.zones, is_mesh);
  std::set<std::string> bases;
  for (const CgnsZone& zone : tree_.zones) bases.insert(zone.base);
  tree_.bases = bases.size();
}

/// Warns of bases that may be states of one grid, which CGNS writes as steps of one base (BaseIterativeData_t).
void TreeReader::warnOfEqualBases() {
  using Sizes = std::tuple<std::string, std::array<uint64_t, 3>, uint64_t>;
  std::map<std::string, std::vector<Sizes>> zones_of;
  for (const CgnsZone& zone : tree_.zones)
    zones_of[zone.base].emplace_back(zone.name, zone.nodes, zone.cells);
  std::map<std::vector<Sizes>, std::vector<std::string>> bases_of;
  for (const CgnsZone& zone : tree_.zones) {
    std::vector<std::string>& bases = bases_of[zones_of[zone.base]];
    if (std::ranges::find(bases, zone.base) == bases.end()) bases.push_back(zone.base);
  }
  for (const auto& [zones, bases] : bases_of)
    if (bases.size() > 1)
      tree_.warnings.push_back(fmt::format(
          "{} bases have the same zones ({}), and all of them are read: if they are time steps, their "
          "values are mixed; write each base to a file of its own",
          bases.size(), listed(bases, kNamesListed)));
}

void TreeReader::warnOfOmissions() {
  for (const auto& [reason, zones] : omitted_) {
    std::string names;
    for (size_t n = 0; n < std::min(kNamesListed, zones.size()); ++n) names += (n ? ", " : "") + zones[n];
    if (zones.size() > kNamesListed) names += fmt::format(" and {} more", zones.size() - kNamesListed);
    const std::string words = fmt::format("{} {}: {}", countText(zones.size(), "zone"), reason, names);
    if (tree_.zones.empty()) throw Error("{}: has nothing to draw: {}", file_.path().string(), words);
    tree_.warnings.push_back("left out: " + words);
  }
  if (tree_.zones.empty()) throw Error("{}: has nothing to draw: it has no zones", file_.path().string());
}

}  // namespace

CgnsTree readCgnsTree(const CgnsFile& file, uint32_t step) {
  return TreeReader(file, step).read();
}

}  // namespace curvisplat
