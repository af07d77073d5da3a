#include "preprocess/formats/cgns/cgns_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;
// A vector is read in groups of rows of about this many nodes.
constexpr uint64_t kRowsOfNodes = 1 << 16;

/// The PLOT3D names that a field also answers to.
std::vector<std::string> aliasesOf(const std::string& name) {
  if (name == "Density") return {"rho"};
  if (name == "EnergyStagnationDensity") return {"energy", "stagnationenergy", "rhoe"};
  return {};
}

/// The axis if `name` is a component of a vector ("VelocityX"); else nullopt.
std::optional<size_t> componentOf(const std::string& name) {
  if (name.size() < 2) return std::nullopt;
  const size_t axis = std::string_view("XYZ").find(name.back());
  if (axis == std::string_view::npos) return std::nullopt;
  return axis;
}

/// The part of `box` that has samples of the given centring, as a box of the array, with its destination.
CgnsBox boxOf(const CgnsZone& zone, const NodeBox& box, const CgnsArray& array, Centring centring) {
  const uint64_t last = centring == Centring::kCell ? 1 : 0;
  const uint64_t j1 = std::min(box.j1, zone.nodes[1] - last), k1 = std::min(box.k1, zone.nodes[2] - last);
  CgnsBox part;
  part.first = {array.rind[0], array.rind[1] + box.j0, array.rind[2] + box.k0};
  part.count = {zone.nodes[0] - last, j1 - std::min(box.j0, j1), k1 - std::min(box.k0, k1)};
  part.memory = {zone.nodes[0], box.j1 - box.j0};
  return part;
}

bool empty(const CgnsBox& box) {
  return box.count[0] == 0 || box.count[1] == 0 || box.count[2] == 0;
}

}  // namespace

CgnsSource::CgnsSource(const OpenGridOptions& options)
    : file_(options.grid), tree_(readCgnsTree(file_, options.time_step.value_or(0))) {
  description_.files.push_back(options.grid.string());
  description_.times = tree_.times;
  description_.time_step = options.time_step.value_or(0);
  description_.warnings = tree_.warnings;
  description_.notes = tree_.notes;
  description_.coordinate_bytes = 4;
  for (const CgnsZone& zone : tree_.zones) {
    const std::string name = tree_.bases > 1 ? zone.base + "/" + zone.name : zone.name;
    for (GridBoundary boundary : zone.boundaries) {
      boundary.block = static_cast<uint32_t>(description_.blocks.size());
      description_.boundaries.push_back(std::move(boundary));
    }
    description_.blocks.push_back({name, zone.nodes[0], zone.nodes[1], zone.nodes[2], false});
    for (const CgnsArray& axis : zone.coordinates)
      if (axis.shape.type != "R4") description_.coordinate_bytes = 8;
  }
  addScalars();
  addVectors();
  warnOfGaps();

  const size_t zones = tree_.zones.size();
  description_.format = fmt::format("CGNS ({}), {} structured zone{}", file_.hdf5() ? "HDF5" : "ADF", zones,
                                    zones == 1 ? "" : "s");
  if (!tree_.times.empty())
    description_.format += fmt::format(", time step {} of {}", description_.time_step, tree_.times.size());
}

void CgnsSource::addScalars() {
  std::vector<std::pair<std::string, Centring>> keys;  // in the order of the file
  for (size_t z = 0; z < tree_.zones.size(); ++z)
    for (const CgnsField& field : tree_.zones[z].fields) {
      const std::pair key(field.name, field.centring);
      auto found = std::find(keys.begin(), keys.end(), key);
      if (found == keys.end()) {
        found = keys.insert(keys.end(), key);
        description_.scalars.push_back({field.name, field.unit, aliasesOf(field.name), 0, field.centring});
        arrays_.emplace_back(tree_.zones.size());
      }
      Arrays& arrays = arrays_[static_cast<size_t>(found - keys.begin())][z];
      if (arrays.empty()) arrays.push_back(&field.array);
    }
  std::map<std::string, int> centrings;
  for (const auto& [name, centring] : keys) ++centrings[name];
  for (GridScalar& scalar : description_.scalars)
    if (centrings[scalar.name] > 1) {
      scalar.name += scalar.centring == Centring::kCell ? ":cell" : ":node";
      scalar.aliases.clear();
    }
}

void CgnsSource::addVectors() {
  std::map<std::pair<std::string, Centring>, std::array<std::optional<size_t>, 3>> vectors;
  for (size_t n = 0; n < description_.scalars.size(); ++n) {
    const GridScalar& scalar = description_.scalars[n];
    if (const auto axis = componentOf(scalar.name))
      vectors[{scalar.name.substr(0, scalar.name.size() - 1), scalar.centring}][*axis] = n;
  }
  for (const auto& [key, components] : vectors) {
    if (!std::all_of(components.begin(), components.end(), [](const auto& c) { return c.has_value(); }))
      continue;
    GridScalar length{key.first + ":mag", description_.scalars[*components[0]].unit, {}, 0, key.second};
    std::vector<Arrays> arrays(tree_.zones.size());
    for (size_t axis = 0; axis < 3; ++axis) {
      std::string alias = key.first + ":" + "xyz"[axis];
      for (char& c : alias)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
      description_.scalars[*components[axis]].aliases.push_back(alias);
      for (size_t z = 0; z < arrays.size(); ++z)
        for (const CgnsArray* array : arrays_[*components[axis]][z]) arrays[z].push_back(array);
    }
    for (Arrays& zone : arrays)
      if (zone.size() != 3) zone.clear();
    description_.scalars.push_back(std::move(length));
    arrays_.push_back(std::move(arrays));
  }
}

void CgnsSource::warnOfGaps() {
  std::map<std::vector<size_t>, std::vector<std::string>> gaps;  // zones -> scalars missing in them
  for (size_t n = 0; n < arrays_.size(); ++n) {
    std::vector<size_t> lacking;
    for (size_t z = 0; z < tree_.zones.size(); ++z)
      if (arrays_[n][z].empty()) lacking.push_back(z);
    if (!lacking.empty()) gaps[lacking].push_back(description_.scalars[n].name);
  }
  for (const auto& [zones, scalars] : gaps) {
    std::string names;
    for (size_t n = 0; n < std::min(kNamesListed, zones.size()); ++n)
      names += (n ? ", " : "") + description_.blocks[zones[n]].name;
    if (zones.size() > kNamesListed) names += fmt::format(" and {} more", zones.size() - kNamesListed);
    description_.warnings.push_back(fmt::format("{} of {} zones ({}) have no {}; they are not drawn with it",
                                                zones.size(), tree_.zones.size(), names,
                                                fmt::join(scalars, ", ")));
  }
}

void CgnsSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, <, tree_.zones.size());
  const CgnsZone& zone = tree_.zones[block];
  const size_t nodes = zone.nodes[0] * (box.j1 - box.j0) * (box.k1 - box.k0);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(nodes);
    const CgnsArray& array = zone.coordinates[axis];
    const CgnsBox part = boxOf(zone, box, array, Centring::kNode);
    if (!empty(part)) file_.read(array.node, array.shape, part, axes[axis]->data());
  }
  out.blank.assign(nodes, 0);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, arrays_.size());
    out.scalars[n].assign(nodes, std::numeric_limits<float>::quiet_NaN());
    readScalar(zone, box, arrays_[scalars[n]][block], description_.scalars[scalars[n]].centring,
               out.scalars[n]);
  }
}

void CgnsSource::readScalar(const CgnsZone& zone, const NodeBox& box, const Arrays& arrays, Centring centring,
                            std::vector<float>& to) const {
  if (arrays.empty()) return;
  const CgnsBox part = boxOf(zone, box, *arrays[0], centring);
  if (empty(part)) return;
  if (arrays.size() == 1) return file_.read(arrays[0]->node, arrays[0]->shape, part, to.data());
  // A few rows at a time, so that the buffers of the components stay small.
  const uint64_t ni = part.memory[0];
  const uint64_t rows = std::clamp<uint64_t>(kRowsOfNodes / ni, 1, part.count[1]);
  std::vector<double> squares;
  std::vector<float> component;
  for (uint64_t k = 0; k < part.count[2]; ++k)
    for (uint64_t j = 0; j < part.count[1]; j += rows) {
      const uint64_t count = std::min(rows, part.count[1] - j);
      squares.assign(ni * count, 0.0);
      component.assign(ni * count, std::numeric_limits<float>::quiet_NaN());
      for (const CgnsArray* array : arrays) {
        CgnsBox piece = boxOf(zone, box, *array, centring);
        piece.first = {piece.first[0], piece.first[1] + j, piece.first[2] + k};
        piece.count = {piece.count[0], count, 1};
        piece.memory = {ni, count};
        file_.read(array->node, array->shape, piece, component.data());
        for (size_t n = 0; n < component.size(); ++n) squares[n] += double{component[n]} * component[n];
      }
      float* const first = to.data() + ni * (j + part.memory[1] * k);
      std::transform(squares.begin(), squares.end(), first,
                     [](double square) { return static_cast<float>(std::sqrt(square)); });
    }
}

}  // namespace curvisplat
