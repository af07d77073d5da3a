#include "preprocess/formats/netcdf/cf_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "preprocess/formats/netcdf/cf_roles.h"

namespace curvisplat {
namespace {

bool isTime(const NetcdfFile& file, size_t dim) {
  const NetcdfDimension& dimension = file.dimensions()[dim];
  const NetcdfVariable* const coordinate = file.find(dimension.name);
  if (coordinate && cfRole(file, *coordinate) == CfRole::kTime) return true;
  return dimension.unlimited || dimension.name == "time" || dimension.name == "Time";
}

/// The three dimensions in space and the time dimension.
std::optional<CfDimensions> dimensionsOf(const NetcdfFile& file, const NetcdfVariable& variable) {
  CfDimensions dims;
  std::vector<size_t> space;
  for (const size_t dim : variable.dims) {
    if (!dims.time && isTime(file, dim))
      dims.time = dim;
    else
      space.push_back(dim);
  }
  // If there are more than three, dimensions of length 1 are dropped.
  for (size_t n = 0; space.size() > 3 && n < space.size();) {
    if (file.dimensions()[space[n]].length == 1)
      space.erase(space.begin() + static_cast<ptrdiff_t>(n));
    else
      ++n;
  }
  if (space.size() != 3 || std::set<size_t>(space.begin(), space.end()).size() != 3) return std::nullopt;
  dims.axes = {space[2], space[1], space[0]};
  return dims;
}

std::string describe(const NetcdfFile& file, const CfDimensions& dims) {
  const auto name = [&](size_t axis) { return file.dimensions()[dims.axes[axis]].name; };
  return fmt::format("{}, {}, {}", name(2), name(1), name(0));
}

/// The variable's coordinate of a role. Candidates in order: variables in its `coordinates` attribute,
/// variables named like its dimensions, all others.
std::optional<CfTerm> coordinateOf(const NetcdfFile& file, const NetcdfVariable& variable,
                                   const CfDimensions& dims, CfRole role) {
  std::vector<const NetcdfVariable*> candidates;
  std::istringstream names(variable.text("coordinates"));
  for (std::string name; names >> name;)
    if (const NetcdfVariable* const named = file.find(name)) candidates.push_back(named);
  for (const size_t dim : variable.dims)
    if (const NetcdfVariable* const named = file.find(file.dimensions()[dim].name))
      candidates.push_back(named);
  for (const NetcdfVariable& other : file.variables()) candidates.push_back(&other);
  for (const NetcdfVariable* candidate : candidates) {
    if (cfRole(file, *candidate) != role) continue;
    const auto term = CfTerm::of(file, *candidate, dims);
    if (term && term->exact() && (term->axes() == 1 || term->axes() == 2)) return term;
  }
  return std::nullopt;
}

class GridFinder {
 public:
  GridFinder(const NetcdfFile& file, size_t time_step) : file_(file), time_step_(time_step) {}

  CfGrids find() {
    std::set<std::string> auxiliary;
    for (const NetcdfVariable& variable : file_.variables())
      for (const char* attribute : {"bounds", "climatology"}) auxiliary.insert(variable.text(attribute));
    // Variables that vary in time come first, since they determine a grid's time dimension. Coordinates of
    // every node can be drawn too, but come last: they are seldom the scalar of interest.
    for (const bool coordinates : {false, true})
      for (const bool steady : {false, true})
        for (const NetcdfVariable& variable : file_.variables())
          if (variable.numeric && !auxiliary.contains(variable.name) &&
              (cfRole(file_, variable) != CfRole::kNone) == coordinates)
            add(variable, steady, coordinates);
    return std::move(found_);
  }

 private:
  void add(const NetcdfVariable& variable, bool steady, bool coordinate) {
    auto dims = dimensionsOf(file_, variable);
    if (!dims || dims->time.has_value() == steady) return;
    dims->time_step = time_step_;
    for (CfGrid& grid : found_.grids) {
      if (grid.dims.axes != dims->axes || (dims->time && dims->time != grid.dims.time)) continue;
      grid.variables.push_back(&variable);
      return;
    }
    std::string reason;
    auto grid = gridOf(variable, *dims, reason);
    if (grid)
      found_.grids.push_back(std::move(*grid));
    else if (!coordinate)
      found_.left_out.push_back({variable.name, reason});
  }

  std::optional<CfGrid> gridOf(const NetcdfVariable& variable, const CfDimensions& dims,
                               std::string& reason) {
    for (const size_t dim : dims.axes)
      if (file_.dimensions()[dim].length < 2) {
        reason = fmt::format("dimension {} has fewer than 2 values", file_.dimensions()[dim].name);
        return std::nullopt;
      }
    CfGrid grid;
    grid.dims = dims;
    grid.variables.push_back(&variable);
    auto longitude = coordinateOf(file_, variable, dims, CfRole::kLongitude);
    auto latitude = coordinateOf(file_, variable, dims, CfRole::kLatitude);
    if (!longitude || !latitude) {
      longitude = coordinateOf(file_, variable, dims, CfRole::kX);
      latitude = coordinateOf(file_, variable, dims, CfRole::kY);
      grid.degrees = false;
    }
    if (!longitude || !latitude) {
      reason =
          fmt::format("no longitude and latitude, or x and y, on its dimensions {}", describe(file_, dims));
      return std::nullopt;
    }
    std::vector<size_t> levels;
    for (size_t axis = 0; axis < 3; ++axis)
      if (!longitude->varies(axis) && !latitude->varies(axis)) levels.push_back(axis);
    if (levels.size() != 1) {
      reason = fmt::format("{} and {} do not vary along exactly two of its dimensions {}",
                           longitude->variable().name, latitude->variable().name, describe(file_, dims));
      return std::nullopt;
    }
    auto [vertical, words] = CfVertical::of(file_, variable, dims, levels[0]);
    if (!vertical) {
      reason = words;
      return std::nullopt;
    }
    grid.longitude = *longitude;
    grid.latitude = *latitude;
    grid.vertical = *vertical;
    return grid;
  }

  const NetcdfFile& file_;
  size_t time_step_;
  CfGrids found_;
};

}  // namespace

CfGrids findCfGrids(const NetcdfFile& file, size_t time_step) {
  return GridFinder(file, time_step).find();
}

std::vector<double> cfTimes(const NetcdfFile& file, const CfGrid& grid) {
  if (!grid.dims.time) return {};
  const NetcdfDimension& time = file.dimensions()[*grid.dims.time];
  std::vector<double> times(time.length);
  for (size_t n = 0; n < times.size(); ++n) times[n] = static_cast<double>(n);
  const NetcdfVariable* const coordinate = file.find(time.name);
  if (coordinate && coordinate->numeric && coordinate->dims == std::vector<size_t>{*grid.dims.time})
    file.read(*coordinate, {{0}, {times.size()}}, times);
  return times;
}

}  // namespace curvisplat
