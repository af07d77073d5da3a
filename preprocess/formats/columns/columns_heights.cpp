#include "preprocess/formats/columns/columns_heights.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// 1-D values in kilometres upwards; empty if they are no heights.
std::vector<double> heightsOf(const NetcdfFiles& file, const NetcdfVariable& variable,
                              const NetcdfVariable& meaning) {
  const std::string unit = meaning.text("units").empty() ? variable.text("units") : meaning.text("units");
  const auto length = kilometresOf(unit), pressure = pascalsOf(unit);
  if (!length && !pressure) return {};
  NetcdfBox box;
  for (size_t axis = 0; axis < variable.dims.size(); ++axis) {
    box.start.push_back(0);
    box.count.push_back(file.dimension(variable, axis).length);
  }
  if (box.values() > 2 * kMaxColumnsLevels) return {};
  std::vector<double> values(box.values());
  file.read(variable, box, std::span(values));
  for (double& value : values)
    value = length ? value * *length * (growsDownwards(meaning) ? -1 : 1)
                   : standardAltitude(value * *pressure) * 1e-3;
  return values;
}

/// Levels around values that are in the middle of layers.
std::vector<double> around(const std::vector<double>& middles) {
  std::vector<double> levels;
  if (middles.size() < 2) return levels;
  levels.push_back(middles[0] - (middles[1] - middles[0]) / 2);
  for (size_t n = 0; n + 1 < middles.size(); ++n) levels.push_back((middles[n] + middles[n + 1]) / 2);
  const size_t last = middles.size() - 1;
  levels.push_back(middles[last] + (middles[last] - middles[last - 1]) / 2);
  return levels;
}

/// The levels around layers that are a coordinate of their own beside that of the layers: FESOM's nz beside nz1.
/// `around`: where they lie about. Empty if there is none.
std::vector<double> storedLevels(const NetcdfFiles& file, const std::vector<double>& around) {
  for (const NetcdfVariable& variable : file.variables()) {
    if (variable.dims.size() != 1 || file.dimension(variable, 0).length != around.size() ||
        !variable.numeric || variable.text("positive").empty())
      continue;
    const std::vector<double> levels = heightsOf(file, variable, variable);
    bool fits = levels.size() == around.size();
    for (size_t n = 0; fits && n + 1 < levels.size(); ++n) {
      const double middle = (around[n] + around[n + 1]) / 2;
      fits = (levels[n] - middle) * (levels[n + 1] - middle) < 0;
    }
    if (fits) return levels;
  }
  return {};
}

/// The heights by the coordinate variable of the layers.
std::vector<double> levelsOf(const NetcdfFiles& file, const NetcdfVariable& coordinate, bool between) {
  std::vector<double> middles = heightsOf(file, coordinate, coordinate);
  if (!between || middles.empty()) return middles;
  const NetcdfVariable* const bounds = file.find(coordinate.text("bounds"));
  if (bounds && bounds->dims.size() == 2 && file.dimension(*bounds, 1).length == 2) {
    const std::vector<double> ends = heightsOf(file, *bounds, coordinate);
    if (ends.size() == 2 * middles.size()) {
      std::vector<double> levels;
      for (size_t n = 0; n < middles.size(); ++n) levels.push_back(ends[2 * n]);
      levels.push_back(ends.back());
      return levels;
    }
  }
  const std::vector<double> estimated = around(middles), stored = storedLevels(file, estimated);
  return stored.empty() ? estimated : stored;
}

/// The levels of FESOM's mesh file, which has no units: metres, upwards or downwards. Empty if it has none.
std::vector<double> levelsOfFesom(const NetcdfFiles& file, const std::string& name, uint64_t count) {
  const NetcdfVariable* const variable = file.find(name);
  if (!variable || !variable->numeric || variable->dims.size() != 1 || !variable->text("units").empty() ||
      file.dimension(*variable, 0).length != count)
    return {};
  std::vector<double> levels(count);
  file.read(*variable, {{0}, {count}}, std::span(levels));
  for (double& level : levels) level = -1e-3 * std::abs(level);
  return levels;
}

bool hasWords(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

/// Columns as a block with columns along i, levels along k and nothing along j.
struct ColumnsBlock {
  size_t columns, levels;
  bool of_nodes, middles;
};

/// The blocks on which heights may be, the best first.
std::vector<ColumnsBlock> blocksOf(const NetcdfFiles& file, const ColumnsMap& map,
                                   const ColumnsScalars& scalars) {
  if (scalars.centring == Centring::kNode) return {{map.node_dim, scalars.layer_dim, true, false}};
  std::vector<ColumnsBlock> blocks;
  for (const bool of_nodes : {false, true})
    for (size_t dim = 0; dim < file.dimensions().size(); ++dim)
      if (file.dimensions()[dim].length == scalars.layers + 1)
        blocks.push_back({of_nodes ? map.node_dim : map.face_dim, dim, of_nodes, false});
  blocks.push_back({map.face_dim, scalars.layer_dim, false, true});
  return blocks;
}

CfDimensions axesOf(const ColumnsBlock& block, const ColumnsScalars& scalars, size_t step) {
  CfDimensions dims;
  dims.axes = {block.columns, CfDimensions::kNoDimension, block.levels};
  dims.time = scalars.time_dim;
  dims.time_step = step;
  return dims;
}

/// A variable with a value for every column and level.
std::optional<CfTerm> termOfColumns(const NetcdfFiles& file, const NetcdfVariable& variable,
                                    const CfDimensions& dims) {
  auto term = variable.numeric ? CfTerm::of(file, variable, dims) : std::nullopt;
  return term && term->exact() && term->varies(0) && term->varies(2) ? term : std::nullopt;
}

std::optional<ColumnsHeights> heightsOn(const NetcdfFiles& file, const ColumnsBlock& block,
                                        const CfDimensions& dims, std::string& reason) {
  ColumnsHeights heights;
  heights.of_nodes = block.of_nodes;
  heights.middles = block.middles;
  heights.count = file.dimensions()[block.levels].length;
  for (const NetcdfVariable& variable : file.variables()) {
    if (!isHeightsOfColumns(file, variable)) continue;
    heights.stored = termOfColumns(file, variable, dims);
    heights.scale = kilometresOf(variable.text("units")).value_or(1e-3) * (growsDownwards(variable) ? -1 : 1);
    heights.words = variable.name;
    if (heights.stored) return heights;
  }
  for (const NetcdfVariable& variable : file.variables()) {
    const auto term = variable.text("formula_terms").empty() || !variable.numeric
                          ? std::nullopt
                          : CfTerm::of(file, variable, dims);
    if (!term || !term->exact() || !term->varies(2)) continue;
    heights.formula = CfVertical::byFormula(file, variable, dims, 2, reason);
    if (heights.formula && heights.formula->varies(0)) {
      heights.words = heights.formula->description();
      return heights;
    }
  }
  return std::nullopt;
}

/// MPAS' ocean, and what calls itself so.
std::optional<ColumnsHeights> heightsOfThickness(const NetcdfFiles& file, const ColumnsScalars& scalars,
                                                 const CfDimensions& dims) {
  ColumnsHeights heights;
  heights.thickness = true;
  heights.count = scalars.layers;
  for (const NetcdfVariable& variable : file.variables()) {
    if (!isThicknessOfColumns(variable)) continue;
    const auto kilometres = kilometresOf(variable.text("units"));
    heights.stored = termOfColumns(file, variable, dims);
    if (!heights.stored) continue;
    heights.scale = *kilometres;
    heights.words = "the thickness " + variable.name;
    for (const char* const name : {"ssh", "zeta", "eta"}) {
      const NetcdfVariable* const surface = file.find(name);
      heights.surface = surface && surface->numeric && kilometresOf(surface->text("units")) == kilometres
                            ? CfTerm::of(file, *surface, dims)
                            : std::nullopt;
      if (heights.surface && heights.surface->exact() && !heights.surface->varies(2)) return heights;
    }
    heights.surface.reset();
    heights.words += " below a surface at 0";
    return heights;
  }
  return std::nullopt;
}

}  // namespace

bool isHeightsOfColumns(const NetcdfFiles& file, const NetcdfVariable& variable) {
  if (!variable.numeric || variable.dims.size() < 2) return false;
  const std::string name = lowerCase(variable.name), long_name = lowerCase(variable.text("long_name"));
  const bool named = name == "zgrid" || name == "z_ifc" || name == "hhl" || name == "z_mc_ifc" ||
                     name == "z_mc" || name == "zmid" || name.starts_with("zcoord") ||
                     name.starts_with("zcor");
  if (!kilometresOf(variable.text("units"))) return named && isUnitless(variable.text("units"));
  return named || cfRole(file, variable) == CfRole::kVertical || name.ends_with("_depth") ||
         name.ends_with("_height") || name.ends_with("_zcc") || name.ends_with("_zw") ||
         hasWords(long_name, "vertical coordinate") || hasWords(long_name, "z-coordinate");
}

ColumnsHeights findColumnsHeights(const NetcdfFiles& file, const ColumnsMap& map,
                                  const ColumnsScalars& scalars, size_t step) {
  const bool between = scalars.centring == Centring::kCell;
  const uint64_t levels = scalars.layers + (between ? 1 : 0);
  std::string reason;
  for (const ColumnsBlock& block : blocksOf(file, map, scalars))
    if (auto found = heightsOn(file, block, axesOf(block, scalars, step), reason)) return std::move(*found);
  ColumnsHeights heights;
  const std::string& name = file.dimensions()[scalars.layer_dim].name;
  if (map.format == "FESOM") {
    heights.words = between ? "nz" : name;
    heights.levels = levelsOfFesom(file, heights.words, levels);
    if (!heights.levels.empty()) return heights;
  }
  for (const NetcdfVariable& variable : file.variables()) {
    if (variable.dims != std::vector{scalars.layer_dim} || !variable.numeric) continue;
    if (variable.name == "refBottomDepth" && between) {
      heights.levels = {0.0};
      for (const double depth : heightsOf(file, variable, variable))
        heights.levels.push_back(-std::abs(depth));
    } else if (variable.name == name || cfRole(file, variable) == CfRole::kVertical ||
               !variable.text("positive").empty()) {
      heights.levels = levelsOf(file, variable, between);
    }
    heights.words = variable.name;
    const bool finite = std::all_of(heights.levels.begin(), heights.levels.end(),
                                    [](double height) { return std::abs(height) <= kMaxHeight; });
    if (heights.levels.size() == levels && finite) return heights;
  }
  if (between)
    if (auto found = heightsOfThickness(
            file, scalars, axesOf({map.face_dim, scalars.layer_dim, false, true}, scalars, step)))
      return std::move(*found);
  const NetcdfVariable* const along = file.find(name);
  if (!reason.empty())
    throw Error("{}: the layers of {} ({}) have no heights: {}", file.path().string(), map.format, name,
                reason);
  throw Error(
      "{}: the layers of {} ({}) have no heights{}; expected {}a coordinate {} with a unit of length or "
      "pressure",
      file.path().string(), map.format, name,
      !along                         ? ""
      : along->text("units").empty() ? fmt::format(" ({} has no unit)", name)
                                     : fmt::format(" ({} has the unit '{}')", name, along->text("units")),
      map.format == "ICON"   ? "z_ifc (give the file that has it, too), or "
      : map.format == "MPAS" ? "zgrid, layerThickness or refBottomDepth (give the file that has it, too), or "
                             : "heights of its faces or nodes (give the file that has them, too), or ",
      name);
}

bool isThicknessOfColumns(const NetcdfVariable& variable) {
  return kilometresOf(variable.text("units")) &&
         (variable.text("standard_name") == "cell_thickness" || variable.name == "layerThickness" ||
          hasWords(lowerCase(variable.text("long_name")), "layer thickness"));
}

std::vector<double> ColumnsHeightsReader::stored(uint64_t first, uint64_t count, uint64_t level,
                                                 uint64_t levels) const {
  const CfRange range{{first, 0, level}, {first + count, 1, level + levels}};
  const CfValues values =
      heights_.formula ? heights_.formula->heights(file_, range) : heights_.stored->read(file_, range);
  std::vector<double> heights;
  for (uint64_t n = 0; n < count; ++n)
    for (uint64_t l = 0; l < levels; ++l) {
      const double height = (heights_.formula ? 1 : heights_.scale) * values.at(n, 0, l);
      heights.push_back(std::abs(height) <= kMaxHeight ? height : std::numeric_limits<double>::quiet_NaN());
    }
  return heights;
}

std::vector<double> ColumnsHeightsReader::read(uint64_t first, uint64_t count, uint64_t level) {
  if (!heights_.thickness && !heights_.middles) return stored(first, count, level, 1);
  std::vector<double> heights;
  if (heights_.thickness) {
    if (level == 0) {
      const CfValues surface = heights_.surface
                                   ? heights_.surface->read(file_, {{first, 0, 0}, {first + count, 1, 1}})
                                   : CfValues{{1, 1, 1}, {0.0}};
      above_.resize(first + count);
      for (uint64_t n = 0; n < count; ++n) above_[first + n] = heights_.scale * surface.at(n, 0, 0);
    } else {
      // Below the ground there are no layers.
      const std::vector<double> layer = stored(first, count, level - 1, 1);
      for (uint64_t n = 0; n < count; ++n)
        if (std::isfinite(layer[n])) above_[first + n] -= layer[n];
    }
    const auto from = above_.begin() + static_cast<ptrdiff_t>(first);
    heights.assign(from, from + static_cast<ptrdiff_t>(count));
    return heights;
  }
  // A boundary lies between two middles; beyond the last one, as far as the other end of its layer.
  const uint64_t begin = level < 2 ? 0 : level - 2, end = std::min(level + 2, heights_.count);
  const std::vector<double> middles = stored(first, count, begin, end - begin);
  for (uint64_t n = 0; n < count; ++n) {
    const auto middle = [&](uint64_t layer) {  // counted from 2 below the level
      const uint64_t number = level + layer;
      return number < begin + 2 || number >= end + 2 ? std::nan("")
                                                     : middles[n * (end - begin) + number - 2 - begin];
    };
    const double below = middle(1), above = middle(2);
    heights.push_back(std::isnan(below)   ? above - (middle(3) - above) / 2
                      : std::isnan(above) ? below + (below - middle(0)) / 2
                                          : (below + above) / 2);
  }
  return heights;
}

}  // namespace curvisplat
