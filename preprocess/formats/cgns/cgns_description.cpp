#include "preprocess/formats/cgns/cgns_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <utility>

#include "stream/base/words.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;
using ArraysOfScalars = std::vector<std::vector<CgnsArrays>>;

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

/// The scalars of all zones' fields.
void addScalars(const CgnsTree& tree, GridDescription& description, ArraysOfScalars& arrays_of) {
  std::vector<std::pair<std::string, Centring>> keys;  // in the order of the file
  for (size_t z = 0; z < tree.zones.size(); ++z)
    for (const CgnsField& field : tree.zones[z].fields) {
      const std::pair key(field.name, field.centring);
      auto found = std::find(keys.begin(), keys.end(), key);
      if (found == keys.end()) {
        found = keys.insert(keys.end(), key);
        description.scalars.push_back({field.name, field.unit, aliasesOf(field.name), 0, field.centring});
        arrays_of.emplace_back(tree.zones.size());
      }
      CgnsArrays& arrays = arrays_of[static_cast<size_t>(found - keys.begin())][z];
      if (arrays.empty()) arrays.push_back(&field.array);
    }
  std::map<std::string, int> centrings;
  for (const auto& [name, centring] : keys) ++centrings[name];
  for (GridScalar& scalar : description.scalars)
    if (centrings[scalar.name] > 1) {
      scalar.name += scalar.centring == Centring::kCell ? ":cell" : ":node";
      scalar.aliases.clear();
    }
}

/// The magnitudes of vectors.
void addVectors(const CgnsTree& tree, GridDescription& description, ArraysOfScalars& arrays_of) {
  std::map<std::pair<std::string, Centring>, std::array<std::optional<size_t>, 3>> vectors;
  for (size_t n = 0; n < description.scalars.size(); ++n) {
    const GridScalar& scalar = description.scalars[n];
    if (const auto axis = componentOf(scalar.name))
      vectors[{scalar.name.substr(0, scalar.name.size() - 1), scalar.centring}][*axis] = n;
  }
  for (const auto& [key, components] : vectors) {
    if (!std::all_of(components.begin(), components.end(), [](const auto& c) { return c.has_value(); }))
      continue;
    GridScalar length{key.first + ":mag", description.scalars[*components[0]].unit, {}, 0, key.second};
    std::vector<CgnsArrays> arrays(tree.zones.size());
    for (size_t axis = 0; axis < 3; ++axis) {
      description.scalars[*components[axis]].aliases.push_back(lowerCase(key.first + ":" + "xyz"[axis]));
      for (size_t z = 0; z < arrays.size(); ++z)
        for (const CgnsArray* array : arrays_of[*components[axis]][z]) arrays[z].push_back(array);
    }
    for (CgnsArrays& zone : arrays)
      if (zone.size() != 3) zone.clear();
    description.scalars.push_back(std::move(length));
    arrays_of.push_back(std::move(arrays));
  }
}

void warnOfGaps(const CgnsTree& tree, const ArraysOfScalars& arrays_of, GridDescription& description) {
  std::map<std::vector<size_t>, std::vector<std::string>> gaps;  // zones -> scalars missing in them
  for (size_t n = 0; n < arrays_of.size(); ++n) {
    std::vector<size_t> lacking;
    for (size_t z = 0; z < tree.zones.size(); ++z)
      if (arrays_of[n][z].empty()) lacking.push_back(z);
    if (!lacking.empty()) gaps[lacking].push_back(description.scalars[n].name);
  }
  for (const auto& [zones, scalars] : gaps) {
    std::string names;
    for (size_t n = 0; n < std::min(kNamesListed, zones.size()); ++n)
      names += (n ? ", " : "") + cgnsZoneName(tree, zones[n]);
    if (zones.size() > kNamesListed) names += fmt::format(" and {} more", zones.size() - kNamesListed);
    description.warnings.push_back(fmt::format("{} of {} zones ({}) have no {}; they are not drawn with it",
                                               zones.size(), tree.zones.size(), names,
                                               fmt::join(scalars, ", ")));
  }
}

}  // namespace

std::string cgnsZoneName(const CgnsTree& tree, size_t zone) {
  return tree.bases > 1 ? tree.zones[zone].base + "/" + tree.zones[zone].name : tree.zones[zone].name;
}

void describeCgns(const CgnsFile& file, const CgnsTree& tree, uint32_t time_step,
                  GridDescription& description) {
  description.files.push_back(file.path().string());
  description.times = tree.times;
  description.time_step = time_step;
  description.warnings = tree.warnings;
  description.notes = tree.notes;
  description.coordinate_bytes = 4;
  for (const CgnsZone& zone : tree.zones)
    for (const CgnsArray& axis : zone.coordinates)
      if (axis.shape.type != "R4") description.coordinate_bytes = 8;
  const size_t zones = tree.zones.size();
  description.format = fmt::format("CGNS ({}), {} {}structured zone{}", file.hdf5() ? "HDF5" : "ADF", zones,
                                   tree.unstructured ? "un" : "", zones == 1 ? "" : "s");
  if (!tree.times.empty())
    description.format += fmt::format(", time step {} of {}", time_step, tree.times.size());
}

std::vector<std::vector<CgnsArrays>> describeCgnsScalars(const CgnsTree& tree, GridDescription& description) {
  ArraysOfScalars arrays_of;
  addScalars(tree, description, arrays_of);
  addVectors(tree, description, arrays_of);
  warnOfGaps(tree, arrays_of, description);
  return arrays_of;
}

}  // namespace curvisplat
