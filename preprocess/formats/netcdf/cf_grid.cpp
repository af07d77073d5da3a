#include "preprocess/formats/netcdf/cf_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_dimensions.h"
#include "preprocess/formats/netcdf/fms_mosaic.h"
#include "preprocess/formats/netcdf/netcdf_files.h"
#include "stream/base/calendar.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

std::string describe(const NetcdfFiles& file, const CfDimensions& dims) {
  const auto name = [&](size_t axis) { return file.dimensions()[dims.axes[axis]].name; };
  return fmt::format("{}, {}, {}", name(2), name(1), name(0));
}

/// The variable's coordinate of a role. Candidates in order: variables in its `coordinates` attribute,
/// variables named like its dimensions, all others; last those of other files whose dimensions have other
/// names and the same lengths. In files of tiles (FV3), 1-D coordinates hold indices or are for GrADS: those of two
/// dimensions come first, at the nodes or at the corners of the cells around them. A supergrid in another file comes before
/// any of one dimension.
std::optional<CfTerm> coordinateOf(const NetcdfFiles& file, const NetcdfVariable& variable,
                                   const CfDimensions& dims, CfRole role) {
  std::vector<const NetcdfVariable*> candidates;
  std::istringstream names(variable.text("coordinates"));
  for (std::string name; names >> name;)
    if (const NetcdfVariable* const named = file.find(name)) candidates.push_back(named);
  for (const size_t dim : variable.dims)
    if (const NetcdfVariable* const named = file.find(file.dimensions()[dim].name))
      candidates.push_back(named);
  for (const NetcdfVariable& other : file.variables()) candidates.push_back(&other);
  if (tileNumber(file.path()))
    for (const bool corners : {false, true})
      for (const NetcdfVariable* candidate : candidates) {
        if (cfRole(file, *candidate) != role) continue;
        const auto term = CfTerm::of(file, *candidate, dims);
        if (term && term->axes() == 2 && (corners ? term->ofCorners() : term->onNodes())) return term;
      }
  const bool geographic = role == CfRole::kLongitude || role == CfRole::kLatitude;
  const std::optional<CfTerm> supergrid =
      geographic && !dims.face ? supergridOf(file, variable, dims, role) : std::nullopt;
  for (const bool exact : {true, false})
    for (const NetcdfVariable* candidate : candidates) {
      if (cfRole(file, *candidate) != role || (!exact && candidate->file == variable.file)) continue;
      const auto term = CfTerm::of(file, *candidate, dims);
      if (!term || !(exact ? term->exact() : term->onNodes())) continue;
      if (dims.face && !term->ofFaces()) continue;  // GEOS' Xdim, "for GrADS"
      if (term->axes() == 2 || (term->axes() == 1 && !supergrid)) return term;
    }
  return supergrid;
}

/// Distance of nodes along `axis` (0 or 1) in metres where the files have no coordinates: WRF's DX and DY.
double indexSpacing(const NetcdfFiles& file, size_t axis) {
  const double spacing = file.number(axis == 0 ? "DX" : "DY").value_or(1000);
  return std::isfinite(spacing) && spacing > 0 ? spacing : 1000;
}

/// Whether the first level is that of the ground, as met_em's is, and lies above the second somewhere.
bool beginsWithSurface(const NetcdfFiles& file, const CfGrid& grid) {
  const NetcdfDimension& levels = file.dimensions()[grid.dims.axes[grid.levels]];
  if (levels.name != "num_metgrid_levels" || levels.length < 3) return false;
  constexpr uint64_t kColumns = 4;
  for (uint64_t n = 0; n < kColumns * kColumns; ++n) {
    CfRange two{{}, {2, 2, 2}};
    uint64_t part = n;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (axis == grid.levels) continue;
      two.begin[axis] =
          (file.dimensions()[grid.dims.axes[axis]].length - 1) * (part % kColumns) / (kColumns - 1);
      two.end[axis] = two.begin[axis] + 1;
      part /= kColumns;
    }
    const std::vector<double> heights = grid.vertical.heights(file, two).values;
    if (heights.size() == 2 && heights[0] > heights[1]) return true;
  }
  return false;
}

/// The standard atmosphere has 2,000 hPa here, in kilometres.
constexpr double kLowestAir = -6;

/// The lowest and the highest node of a column, or of the surface if all are missing. Looks half, a quarter and three
/// quarters along: some columns may be land, without a depth.
std::vector<double> columnOf(const NetcdfFiles& file, const CfGrid& grid) {
  for (const uint64_t part : {2, 1, 3}) {
    CfRange column;
    for (size_t axis = 0; axis < 3; ++axis) {
      const uint64_t length = file.dimensions()[grid.dims.axes[axis]].length;
      column.begin[axis] = axis == grid.levels ? 0 : length * part / 4;
      column.end[axis] = axis == grid.levels ? length : column.begin[axis] + 1;
    }
    double lowest = 0, highest = 0;
    for (const double height : grid.vertical.heights(file, column).values) {
      lowest = std::fmin(lowest, height);
      highest = std::fmax(highest, height);
    }
    if (lowest != highest) return {lowest, highest};
  }
  return {0, 0};
}

class GridFinder {
 public:
  GridFinder(const NetcdfFiles& file, size_t time_step) : file_(file), time_step_(time_step) {}

  CfGrids find() {
    std::set<std::string> auxiliary;
    for (const NetcdfVariable& variable : file_.variables())
      for (const char* attribute : {"bounds", "climatology"}) auxiliary.insert(variable.text(attribute));
    addAll(auxiliary);
    // Without coordinates, indices take their place: but not in files of unstructured meshes, and only if
    // there is nothing better.
    if (found_.grids.empty() && !foreignNetcdf(file_)) {
      const std::vector<CfLeftOut> left_out = std::exchange(found_.left_out, {});
      by_index_ = true;
      addAll(auxiliary);
      if (found_.grids.empty()) found_.left_out = left_out;
    }
    return std::move(found_);
  }

 private:
  void addAll(const std::set<std::string>& auxiliary) {
    // Variables that vary in time come first, since they determine a grid's time dimension. Coordinates of
    // every node and masks can be drawn too, but come last: they are seldom the scalar of interest.
    for (const bool coordinates : {false, true})
      for (const bool steady : {false, true})
        for (const NetcdfVariable& variable : file_.variables())
          if (variable.numeric && !auxiliary.contains(variable.name) &&
              (cfRole(file_, variable) != CfRole::kNone || CfMask::isMask(variable)) == coordinates)
            add(variable, steady, coordinates);
  }

  void add(const NetcdfVariable& variable, bool steady, bool coordinate) {
    auto dims = dimensionsOf(file_, variable);
    if (!dims && !steady && !coordinate) noteRank(variable);
    if (!dims || dims->time.has_value() == steady) return;
    dims->time_step = time_step_;
    for (CfGrid& grid : found_.grids) {
      if (grid.dims.axes != dims->axes || grid.dims.face != dims->face || !hasPointsOf(grid, variable))
        continue;
      if (dims->time && dims->time != grid.dims.time) continue;
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

  /// Members of an ensemble, ERA5's experiments: more dimensions than a grid has.
  void noteRank(const NetcdfVariable& variable) {
    std::vector<std::string> names;
    for (const size_t dim : variable.dims)
      if (file_.dimensions()[dim].length > 1 && !isTime(file_, dim, variable.dims.size()))
        names.push_back(file_.dimensions()[dim].name);
    if (names.size() <= 3) return;
    // The remedy chooses a member or a month, not a place.
    const auto other = std::ranges::find_if_not(
        names, [&](const std::string& name) { return dimensionsOfPlaces().contains(name); });
    const std::string& chosen = other == names.end() ? names.front() : *other;
    const NetcdfVariable* const values = file_.find(chosen);
    double first = 0;
    if (values && values->numeric && values->dims.size() == 1)
      file_.read(*values, {{0}, {1}}, std::span(&first, 1));
    found_.left_out.push_back(
        {variable.name,
         fmt::format("{} dimensions besides time ({}); expected 3: choose one value of the others, such as "
                     "--select {}={:g}",
                     names.size(), listed(names), chosen, first)});
  }

  /// Names of the dimensions on which there are coordinates of space.
  const std::set<std::string>& dimensionsOfPlaces() {
    if (dimensions_of_places_.empty())
      for (const NetcdfVariable& variable : file_.variables())
        if (const CfRole role = cfRole(file_, variable); role != CfRole::kNone && role != CfRole::kTime)
          for (const size_t dim : variable.dims) dimensions_of_places_.insert(file_.dimensions()[dim].name);
    return dimensions_of_places_;
  }

  /// Whether a variable with the grid's dimensions is at its points: not if its `coordinates` name another longitude (POP's
  /// ULONG beside TLONG).
  bool hasPointsOf(const CfGrid& grid, const NetcdfVariable& variable) const {
    const NetcdfVariable& own = grid.longitude.variable();
    if (grid.indices) return true;
    std::istringstream names(variable.text("coordinates"));
    for (std::string name; names >> name;)
      if (const NetcdfVariable* const named = file_.find(name);
          named && named != &own && cfRole(file_, *named) == cfRole(file_, own)) {
        const auto term = CfTerm::of(file_, *named, grid.dims);
        if (term && term->exact() && term->axes() == grid.longitude.axes()) return false;
      } else if (named == &own) {
        return true;
      }
    return true;
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
    if (dims.time && !isTime(file_, *dims.time, variable.dims.size()) && !isLeadTime(file_, *dims.time))
      grid.steps_of = file_.dimensions()[*dims.time].name;
    grid.variables.push_back(&variable);
    if (!setHorizontal(grid, variable, reason)) return std::nullopt;
    std::vector<size_t> levels;
    for (size_t axis = 0; axis < 3; ++axis)
      if (!grid.longitude.varies(axis) && !grid.latitude.varies(axis)) levels.push_back(axis);
    if (levels.size() != 1) {
      reason =
          fmt::format("{} and {} do not vary along exactly two of its dimensions {}",
                      grid.longitude.variable().name, grid.latitude.variable().name, describe(file_, dims));
      return std::nullopt;
    }
    grid.levels = levels[0];
    auto [vertical, words] = CfVertical::of(file_, variable, dims, grid.levels);
    if (!vertical && grid.indices && !file_.find(file_.dimensions()[dims.axes[grid.levels]].name))
      vertical = CfVertical::ofIndex(grid.levels);
    if (!vertical) {
      reason = words;
      return std::nullopt;
    }
    grid.vertical = *vertical;
    if (grid.vertical.ofPressure() && std::ranges::min(columnOf(file_, grid)) < kLowestAir) {
      reason = fmt::format(
          "the pressures of {} are more than those of any air on the Earth: correct the units of its terms",
          grid.vertical.description());
      return std::nullopt;
    }
    setNowhere(grid);
    grid.surface_first = beginsWithSurface(file_, grid);
    grid.mask = CfMask::of(file_, variable, dims, grid.levels, isOcean(file_, grid));
    return grid;
  }

  /// Longitude and latitude; or x and y, with their projection if they have one; or indices.
  bool setHorizontal(CfGrid& grid, const NetcdfVariable& variable, std::string& reason) const {
    const auto set = [&](CfRole east, CfRole north) {
      const auto longitude = coordinateOf(file_, variable, grid.dims, east),
                 latitude = coordinateOf(file_, variable, grid.dims, north);
      if (!longitude || !latitude) return false;
      grid.longitude = *longitude;
      grid.latitude = *latitude;
      if (east != CfRole::kX)
        for (CfTerm* const term : {&grid.longitude, &grid.latitude}) term->setDegrees();
      return true;
    };
    Implausible implausible;
    if (set(CfRole::kLongitude, CfRole::kLatitude)) {
      if (stacksFaces(grid, reason)) return false;
      implausible = implausibleDegrees(grid);
      if (implausible.words.empty()) return true;
    }
    auto [projection, words] = MapProjection::of(file_, variable);
    if (set(CfRole::kGridLongitude, CfRole::kGridLatitude)) {
      if (projection && projection->degrees()) {
        grid.projection = std::move(projection);
        return true;
      }
      reason =
          fmt::format("{} and {} are degrees from a rotated pole, but {}", grid.longitude.variable().name,
                      grid.latitude.variable().name, projection ? "the grid mapping is a map's" : words);
      return false;
    }
    if (set(CfRole::kX, CfRole::kY)) {
      grid.degrees = false;
      if (projection && !projection->degrees()) grid.projection = std::move(projection);
      return true;
    }
    reason = implausible.words.empty()
                 ? fmt::format("no longitude and latitude, or x and y, on its dimensions {}",
                               describe(file_, grid.dims))
                 : implausible.words + implausible.remedy;
    if (!by_index_ || grid.dims.face || !implausible.usable_indices) return false;
    for (size_t axis = 0; axis < 2; ++axis)
      if (file_.find(file_.dimensions()[grid.dims.axes[axis]].name)) return false;
    grid.degrees = false;
    grid.indices = true;
    grid.implausible = implausible.words;
    grid.unused = horizontalOfNodes(grid.dims);
    grid.longitude = CfTerm::ofIndex(0, indexSpacing(file_, 0));
    grid.latitude = CfTerm::ofIndex(1, indexSpacing(file_, 1));
    return true;
  }

  /// `usable_indices`: false if the numbers are positions in another unit, and the files do not state the
  /// distance of nodes either.
  struct Implausible {
    std::string words, remedy;
    bool usable_indices = true;
  };

  /// Describes what is implausible about longitude and latitude: values that no place on the Earth has at
  /// most of the nodes, or all nodes alike, as idealised runs of WRF write them, or latitudes counted from a
  /// pole; no words if nothing is. Looks at five rows.
  Implausible implausibleDegrees(const CfGrid& grid) const {
    CfRange row{{0, 0, 0}, {1, 1, 1}};
    std::vector<size_t> varying;
    for (size_t axis = 0; axis < 3; ++axis)
      if (grid.longitude.varies(axis) || grid.latitude.varies(axis)) varying.push_back(axis);
    if (varying.size() != 2) return {};
    const auto lengthAlong = [&](size_t axis) { return file_.dimensions()[grid.dims.axes[axis]].length; };
    row.end[varying[0]] = lengthAlong(varying[0]);
    std::array<std::vector<double>, 2> values;  // longitudes, latitudes
    uint64_t wrong = 0, all = 0, missing = 0;
    for (uint64_t part = 0; part < 5; ++part) {
      row.begin[varying[1]] = part * (lengthAlong(varying[1]) - 1) / 4;
      row.end[varying[1]] = row.begin[varying[1]] + 1;
      const CfValues east = grid.longitude.read(file_, row), north = grid.latitude.read(file_, row);
      for (uint64_t n = 0; n < lengthAlong(varying[0]); ++n) {
        std::array<uint64_t, 3> at{};
        at[varying[0]] = n;
        const double longitude = east.at(at[0], at[1], at[2]), latitude = north.at(at[0], at[1], at[2]);
        if (!std::isfinite(longitude) || !std::isfinite(latitude)) {
          ++missing;
          continue;
        }
        values[0].push_back(longitude);
        values[1].push_back(latitude);
        wrong += !isOnEarth(longitude, latitude);
        ++all;
      }
    }
    if (all < 2 || missing > all) return {};
    const auto describeRange = [&](const CfTerm& term, const std::vector<double>& of) {
      const auto [least, most] = std::minmax_element(of.begin(), of.end());
      return fmt::format("{} is {:g} .. {:g}", term.variable().name, *least, *most);
    };
    const auto isConstant = [](const std::vector<double>& of) {
      return std::all_of(of.begin(), of.end(), [&](double value) { return value == of[0]; });
    };
    const bool constant = isConstant(values[0]) && isConstant(values[1]);
    const auto [south, north] = std::minmax_element(values[1].begin(), values[1].end());
    if (*south >= 0 && *north > 135 && *north <= 181)
      return {describeRange(grid.latitude, values[1]) + ", which are degrees from a pole",
              fmt::format("; expected degrees_north: write them (ncap2 -s '{0}=90-{0}' FILE OUT)",
                          grid.latitude.variable().name),
              false};
    if (!constant && 2 * wrong <= all) return {};
    return {fmt::format("{} and {}, which are no longitudes and latitudes of a grid in degrees",
                        describeRange(grid.longitude, values[0]), describeRange(grid.latitude, values[1])),
            ": lengths need a unit of length and the standard_name projection_x_coordinate (or y)",
            constant || file_.number("DX")};
  }

  /// Finds a place at which four neighbours lie, as nodes do that a model did not compute: NEMO's at 0, 0 where
  /// a processor would have had land alone.
  void setNowhere(CfGrid& grid) const {
    if (!grid.degrees || grid.projection || grid.dims.face || grid.longitude.axes() != 2) return;
    constexpr uint64_t kNodesAtOnce = 1 << 18;
    std::array<size_t, 2> axes{grid.levels == 0 ? size_t{1} : 0, grid.levels == 2 ? size_t{1} : 2};
    const auto lengthOf = [&](size_t axis) { return file_.dimensions()[grid.dims.axes[axis]].length; };
    const uint64_t row = lengthOf(axes[0]), rows = lengthOf(axes[1]);
    const uint64_t rows_at_once = std::max<uint64_t>(kNodesAtOnce / row, 1);
    CfRange range{{0, 0, 0}, {1, 1, 1}};
    range.end[axes[0]] = row;
    for (uint64_t first = 0; first + 1 < rows; first += rows_at_once) {
      range.begin[axes[1]] = first;
      range.end[axes[1]] = std::min(first + rows_at_once + 1, rows);
      const std::vector<double> east = grid.longitude.read(file_, range).values,
                                north = grid.latitude.read(file_, range).values;
      if (east.size() != north.size()) return;
      for (size_t n = 0; n + row + 1 < east.size(); ++n) {
        const auto same = [&](size_t other) { return east[n] == east[other] && north[n] == north[other]; };
        if (n % row + 1 == row || !same(n + 1) || !same(n + row) || !same(n + row + 1)) continue;
        if (!isOnEarth(east[n], north[n])) continue;
        grid.nowhere = {east[n], north[n]};
        grid.vertical.addWarning(
            fmt::format("{} and {} are {:g} and {:g} at neighbouring nodes, as where nothing is computed; "
                        "nodes there are "
                        "left out",
                        grid.longitude.variable().name, grid.latitude.variable().name, east[n], north[n]));
        return;
      }
    }
  }

  /// Names of horizontal coordinates that differ from level to level.
  std::vector<std::string> horizontalOfNodes(const CfDimensions& dims) const {
    std::vector<std::string> names;
    for (const NetcdfVariable& variable : file_.variables()) {
      const CfRole role = cfRole(file_, variable);
      if (role != CfRole::kX && role != CfRole::kY && role != CfRole::kLongitude && role != CfRole::kLatitude)
        continue;
      const auto term = CfTerm::of(file_, variable, dims);
      if (term && term->axes() == 3) names.push_back(variable.name);
    }
    return names;
  }

  /// GCHP's restart files: lat is six times lon, and both count from 1.
  bool stacksFaces(const CfGrid& grid, std::string& reason) const {
    if (grid.longitude.axes() != 1 || grid.latitude.axes() != 1) return false;
    const NetcdfVariable& latitude = grid.latitude.variable();
    const uint64_t rows = file_.dimension(latitude, 0).length;
    if (rows != 6 * file_.dimension(grid.longitude.variable(), 0).length) return false;
    double last = 0;
    file_.read(latitude, {{rows - 1}, {1}}, std::span<double>(&last, 1));
    if (!(last > 90 || last == static_cast<double>(rows))) return false;
    reason = fmt::format(
        "{} is six times {} and has no latitudes: the faces of a cubed sphere are stacked along it; write "
        "them with "
        "a dimension of faces (nf) and their lons and lats, as GEOS' and GCHP's history files have them",
        latitude.name, grid.longitude.variable().name);
    return true;
  }

  const NetcdfFiles& file_;
  size_t time_step_;
  bool by_index_ = false;
  std::set<std::string> dimensions_of_places_;
  CfGrids found_;
};

}  // namespace

void CfGrid::setFace(uint64_t number) {
  face = number;
  longitude.setFace(number);
  latitude.setFace(number);
  vertical.setFace(number);
  if (mask) mask->setFace(number);
}

bool isField(const NetcdfFiles& file, const NetcdfVariable& variable, const CfGrids& found) {
  if (cfRole(file, variable) != CfRole::kNone || CfMask::isMask(variable)) return false;
  if (std::any_of(found.grids.begin(), found.grids.end(),
                  [&](const CfGrid& grid) { return grid.vertical.uses(variable); }))
    return false;
  if (CfVertical::isNamedForNodes(variable)) return false;
  // NEMO's meshes: sizes and depths of cells at the points t, u, v, w and f.
  const std::string name = lowerCase(variable.name);
  const bool of_point = name.size() > 2 && std::string_view("tuvwf").find(name[2]) != std::string_view::npos;
  if (of_point && (name.starts_with("e1") || name.starts_with("e2") || name.starts_with("e3"))) return false;
  if (name.starts_with("gdep")) return false;
  // Sizes of cells, and flags: regions, quality.
  static const std::set<std::string> names{"cell_thickness", "cell_area", "ocean_volume", "region",
                                           "area_type"};
  const std::string standard_name = variable.text("standard_name");
  const std::string long_name = lowerCase(variable.text("long_name"));
  if (long_name.starts_with("cell thickness") || long_name.starts_with("layer thickness") ||
      long_name.starts_with("cell volume") || names.contains(standard_name) ||
      standard_name.ends_with("status_flag") || variable.attributes.contains("flag_values") ||
      variable.attributes.contains("flag_masks"))
    return false;
  return !found.parts.contains(variable.name);
}

CfGrids findCfGrids(const NetcdfFiles& file, size_t time_step) {
  CfGrids found = GridFinder(file, time_step).find();
  for (const NetcdfVariable& variable : file.variables())
    for (const char* const attribute : {"cell_measures", "formula_terms", "ancillary_variables"}) {
      const std::string text = variable.text(attribute);
      for (const std::string_view word : wordsOf(text)) found.parts.emplace(word);
    }
  for (CfGrid& grid : found.grids)
    std::stable_partition(grid.variables.begin(), grid.variables.end(),
                          [&](const NetcdfVariable* variable) { return isField(file, *variable, found); });
  return found;
}

bool isOcean(const NetcdfFiles& file, const CfGrid& grid) {
  const std::vector<double> column = columnOf(file, grid);
  return column.front() + column.back() < 0;
}

namespace {

CfTimes numbersOfSteps(uint64_t count) {
  CfTimes times;
  for (uint64_t n = 0; n < count; ++n) times.values.push_back(static_cast<double>(n));
  return times;
}

bool increase(const std::vector<double>& times) {
  return std::ranges::adjacent_find(times, [](double a, double b) { return !(a < b); }) == times.end();
}

CfTimes timesIn(const NetcdfFiles& file, const NetcdfVariable& variable, uint64_t count) {
  CfTimes times{std::vector<double>(count), variable.text("units"), lowerCase(variable.text("calendar"))};
  file.read(variable, {{0}, {count}}, times.values);
  return times;
}

/// Seconds since the first of the dates in WRF's Times or MPAS' xtime; without values if there are none.
CfTimes timesInDates(const NetcdfFiles& file, size_t dim) {
  const size_t count = file.dimensions()[dim].length;
  const NetcdfVariable* dates = file.find("Times");
  if (!dates) dates = file.find("xtime");
  if (!dates || dates->dims.size() != 2 || dates->dims[0] != dim || count == 0) return {};
  const std::string text = file.readText(*dates);
  const size_t length = text.size() / count;
  if (length == 0) return {};
  const std::string of_mpas = lowerCase(file.text("config_calendar_type"));
  CfTimes times;
  times.calendar = of_mpas.find("noleap") != std::string::npos ? "noleap"
                   : of_mpas.starts_with("360")                ? "360_day"
                                                               : "proleptic_gregorian";
  for (size_t n = 0; n < count; ++n) {
    std::string date = text.substr(n * length, length);
    date.resize(std::min(date.find('\0'), date.size()));
    std::ranges::replace(date, '_', ' ');
    const std::string unit = "seconds since " + date.substr(0, date.find_last_not_of(' ') + 1);
    if (n == 0) times.unit = unit;
    const auto since = timeInUnit(0, {unit, times.calendar}, {times.unit, times.calendar});
    if (!since) return {};
    times.values.push_back(*since);
  }
  return times;
}

}  // namespace

CfTimes cfTimes(const NetcdfFiles& file, size_t dim, const NetcdfVariable& data) {
  const size_t count = file.dimensions()[dim].length;
  const NetcdfVariable* const coordinate = file.coordinateOf(dim, data);
  if (coordinate && coordinate->numeric) return timesIn(file, *coordinate, count);
  if (const CfTimes times = timesInDates(file, dim); !times.values.empty()) return times;
  const NetcdfVariable* other = nullptr;  // such as time along t
  for (const NetcdfVariable& variable : file.variables())
    if (isTimeAlong(file, variable, dim) &&
        (!other || (variable.file == data.file && other->file != data.file)))
      other = &variable;
  if (other)
    if (const CfTimes times = timesIn(file, *other, count); increase(times.values)) return times;
  return numbersOfSteps(count);
}

CfTimes cfTimes(const NetcdfFiles& file, const CfGrid& grid) {
  if (!grid.dims.time) return {};
  const CfTimes times = cfTimes(file, *grid.dims.time, *grid.variables.front());
  // The values of members or months need not increase; times that do not are refused where they are used.
  return grid.steps_of.empty() || increase(times.values) ? times : numbersOfSteps(times.values.size());
}

}  // namespace curvisplat
