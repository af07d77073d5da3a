#include "preprocess/formats/columns/columns_scalars.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "preprocess/formats/columns/columns_heights.h"
#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"

namespace curvisplat {
namespace {

/// Whether the variable is the bounds of another: corners of faces, not layers.
bool isBounds(const NetcdfFiles& file, const NetcdfVariable& variable) {
  return std::any_of(file.variables().begin(), file.variables().end(),
                     [&](const NetcdfVariable& other) { return other.text("bounds") == variable.name; });
}

/// Sides and corners of MPAS' faces: no layers.
bool isOfMapAlone(std::string_view dimension) {
  constexpr std::string_view kNames[] = {"maxEdges", "maxEdges2", "vertexDegree", "TWO"};
  return std::find(std::begin(kNames), std::end(kNames), dimension) != std::end(kNames);
}

using Variables = std::vector<const NetcdfVariable*>;

std::vector<std::string> namesOf(const Variables& variables) {
  std::vector<std::string> names;
  for (const NetcdfVariable* const variable : variables) names.push_back(variable->name);
  return names;
}

/// Fields over the map without layers, which have no volume. Says that they are left out where nothing else of their file is read,
/// since they are what its user wants to see. Throws Error if one of them is wanted.
void leaveOutFlat(const NetcdfFiles& file, const Variables& flat, const std::vector<ColumnsScalars>& groups,
                  const std::vector<std::string>& wanted, std::vector<std::string>& warnings) {
  std::vector<std::string> names;
  for (const NetcdfVariable* const one : flat) {
    if (std::ranges::find(wanted, one->name) != wanted.end())
      throw Error("{}: {} has no layers, and so no volume that can be drawn; choose another scalar",
                  file.paths().at(one->file), one->name);
    const bool is_read = std::ranges::any_of(groups, [&](const ColumnsScalars& group) {
      return std::ranges::any_of(group.variables, [&](const auto* v) { return v->file == one->file; });
    });
    if (!is_read) names.push_back(one->name);
  }
  if (!names.empty())
    warnings.push_back(fmt::format("left out: {}, without layers, and so without a volume that can be drawn",
                                   listed(names, 3)));
}

}  // namespace

ColumnsScalars chooseColumnsScalars(const NetcdfFiles& file, const ColumnsMap& map,
                                    const std::vector<std::string>& wanted,
                                    std::vector<std::string>& warnings) {
  std::vector<ColumnsScalars> groups;
  Variables flat;
  std::set<size_t> timed;  // dimensions of times
  for (const NetcdfVariable& variable : file.variables())
    if (variable.dims.size() == 1 && isTimeAlong(file, variable, variable.dims[0]))
      timed.insert(variable.dims[0]);
  for (const size_t dim : {map.face_dim, map.node_dim}) timed.erase(dim);
  for (const NetcdfVariable& variable : file.variables()) {
    if (!variable.numeric || !variable.text("cf_role").empty()) continue;
    const bool faces = hasDimension(variable, map.face_dim);
    if (faces == hasDimension(variable, map.node_dim)) continue;
    const size_t across = faces ? map.face_dim : map.node_dim;
    // The other dimensions: time, and those of length 1.
    std::vector<size_t> others;
    std::optional<size_t> time;
    for (size_t axis = 0; axis < variable.dims.size(); ++axis) {
      const NetcdfDimension& dimension = file.dimension(variable, axis);
      const bool is_time = dimension.unlimited || dimension.name == "time" || dimension.name == "Time" ||
                           timed.contains(variable.dims[axis]);
      if (is_time)
        time = variable.dims[axis];
      else if (variable.dims[axis] != across && dimension.length != 1)
        others.push_back(variable.dims[axis]);
    }
    if (isBounds(file, variable)) continue;
    if (isHeightsOfColumns(file, variable)) continue;
    if (others.size() == 1 && isOfMapAlone(file.dimensions()[others[0]].name)) continue;
    const uint64_t layers = others.size() == 1 ? file.dimensions()[others[0]].length : 0;
    if (others.empty() && time && &variable != map.nodes_of_face) flat.push_back(&variable);
    if (layers < 2 || layers > kMaxColumnsLevels || &variable == map.nodes_of_face) continue;
    const Centring centring = faces ? Centring::kCell : Centring::kNode;
    auto group = std::find_if(groups.begin(), groups.end(), [&](const ColumnsScalars& g) {
      return g.centring == centring && g.layer_dim == others[0] && g.time_dim == time;
    });
    if (group == groups.end()) {
      const auto place = [&](size_t dim) {
        return std::find(variable.dims.begin(), variable.dims.end(), dim);
      };
      groups.push_back({centring, others[0], layers, place(others[0]) > place(across), {}, time});
      group = groups.end() - 1;
    }
    group->variables.push_back(&variable);
  }
  leaveOutFlat(file, flat, groups, wanted, warnings);
  // Thicknesses come last, since they are seldom the scalar of interest.
  for (ColumnsScalars& group : groups)
    std::stable_partition(group.variables.begin(), group.variables.end(),
                          [](const auto* v) { return !isThicknessOfColumns(*v); });
  // What has three dimensions but is of the map itself (edgesOnCell, ...) are integers without layers' heights.
  std::string lacking;  // the heights of the largest group
  size_t largest = 0;
  std::erase_if(groups, [&](const ColumnsScalars& g) {
    try {
      findColumnsHeights(file, map, g);
      return false;
    } catch (const Error& error) {
      if (g.variables.size() > largest) lacking = error.what();
      largest = std::max(largest, g.variables.size());
      return true;
    }
  });
  if (groups.empty() && !lacking.empty()) throw Error("{}", lacking);
  if (groups.empty() && flat.empty())
    throw Error(
        "{}: is a grid of {}, and no scalar lies at its faces or nodes; give the file with its scalars "
        "before "
        "it (convert DATA GRID)",
        file.path().string(), map.format);
  if (groups.empty())
    throw Error("{}: is a grid of {}, but no scalar has layers: no part of it has a volume (found {})",
                file.path().string(), map.format, listed(namesOf(flat), 3));
  auto chosen = std::max_element(groups.begin(), groups.end(), [](const auto& a, const auto& b) {
    return a.variables.size() < b.variables.size();
  });
  for (auto group = groups.begin(); group != groups.end() && !wanted.empty(); ++group)
    for (const NetcdfVariable* const variable : group->variables)
      if (variable->name == wanted[0]) chosen = group;
  for (auto group = groups.begin(); group != groups.end(); ++group)
    if (group != chosen)
      warnings.push_back(fmt::format("{} is on other layers or points than {}; choose it with --scalar",
                                     group->variables[0]->name, chosen->variables[0]->name));
  return *chosen;
}

}  // namespace curvisplat
