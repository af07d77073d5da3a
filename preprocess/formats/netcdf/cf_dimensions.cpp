#include "preprocess/formats/netcdf/cf_dimensions.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxFaces = 512;

/// Whether a dimension numbers the faces of a grid: by its name, if longitude (or x) differs between them.
bool numbersFaces(const NetcdfFiles& file, size_t dim) {
  static const std::set<std::string> names{"nf",   "face",  "faces", "nface", "nfaces",
                                           "tile", "tiles", "ntile", "ntiles"};
  const NetcdfDimension& dimension = file.dimensions()[dim];
  if (dimension.length < 2 || dimension.length > kMaxFaces || !names.contains(lowerCase(dimension.name)))
    return false;
  return std::any_of(file.variables().begin(), file.variables().end(), [&](const NetcdfVariable& variable) {
    if (variable.dims.size() < 2 ||
        std::find(variable.dims.begin(), variable.dims.end(), dim) == variable.dims.end())
      return false;
    const CfRole role = cfRole(file, variable);
    return role == CfRole::kLongitude || role == CfRole::kX;
  });
}

}  // namespace

bool isTime(const NetcdfFiles& file, size_t dim, size_t rank) {
  const NetcdfDimension& dimension = file.dimensions()[dim];
  const NetcdfVariable* const coordinate = file.find(dimension.name);
  const CfRole role = coordinate ? cfRole(file, *coordinate) : CfRole::kNone;
  if (role != CfRole::kNone) return role == CfRole::kTime;
  const std::string name = lowerCase(dimension.name);
  if (name.starts_with("time") || name.ends_with("_time") || name == "t") return true;
  return dimension.unlimited && rank > 3;
}

bool hasUnitOfTime(const NetcdfVariable& coordinate) {
  static const std::set<std::string> units{"hours", "hour", "h", "days", "day", "minutes", "seconds", "s"};
  return units.contains(lowerCase(coordinate.text("units")));
}

bool isLeadTime(const NetcdfFiles& file, size_t dim) {
  static const std::set<std::string> names{"step",         "lead", "lead_time", "leadtime", "forecast_period",
                                           "forecast_hour"};
  const NetcdfVariable* const coordinate = file.find(file.dimensions()[dim].name);
  return coordinate && coordinate->numeric && hasUnitOfTime(*coordinate) &&
         (coordinate->text("standard_name") == "forecast_period" ||
          names.contains(lowerCase(coordinate->name)));
}

std::optional<CfDimensions> dimensionsOf(const NetcdfFiles& file, const NetcdfVariable& variable) {
  CfDimensions dims;
  std::vector<size_t> space;
  for (const size_t dim : variable.dims) {
    if (!dims.time && isTime(file, dim, variable.dims.size()))
      dims.time = dim;
    else
      space.push_back(dim);
  }
  // The start of a single forecast is no series of times.
  if (!dims.time || file.dimensions()[*dims.time].length == 1)
    if (const auto lead =
            std::find_if(space.begin(), space.end(), [&](size_t dim) { return isLeadTime(file, dim); });
        lead != space.end()) {
      const std::optional<size_t> start = std::exchange(dims.time, *lead);
      space.erase(lead);
      if (start) space.insert(space.begin(), *start);
    }
  // If there are more than three, dimensions of length 1 are dropped.
  for (size_t n = 0; space.size() > 3 && n < space.size();) {
    if (file.dimensions()[space[n]].length == 1)
      space.erase(space.begin() + static_cast<ptrdiff_t>(n));
    else
      ++n;
  }
  const auto face =
      std::find_if(space.begin(), space.end(), [&](size_t dim) { return numbersFaces(file, dim); });
  if (face != space.end()) {
    dims.face = *face;
    space.erase(face);
  }
  // Months or members, which come first: steps of a kind, if there is a single time.
  if (space.size() == 4 && (!dims.time || file.dimensions()[*dims.time].length == 1)) {
    const NetcdfVariable* const coordinate = file.find(file.dimensions()[space[0]].name);
    if (!coordinate || cfRole(file, *coordinate) == CfRole::kNone) {
      dims.time = space[0];
      space.erase(space.begin());
    }
  }
  if (space.size() != 3 || std::set<size_t>(space.begin(), space.end()).size() != 3) return std::nullopt;
  dims.axes = {space[2], space[1], space[0]};
  return dims;
}

}  // namespace curvisplat
