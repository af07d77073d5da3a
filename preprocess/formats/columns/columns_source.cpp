#include "preprocess/formats/columns/columns_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <numbers>

#include "preprocess/formats/columns/columns_scalars.h"
#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_grid.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kFacesAtOnce = 65536;

ColumnsMap mapOf(const NetcdfFiles& file) {
  auto map = findColumnsMap(file);
  if (!map) throw Error("{}: has no faces by UGRID, ICON or MPAS", file.path().string());
  return std::move(*map);
}

/// Names of the variables on longitude, latitude and levels that the files have besides.
std::vector<std::string> structuredVariables(const NetcdfFiles& file) {
  std::vector<std::string> names;
  try {
    for (const CfGrid& grid : findCfGrids(file, 0).grids)
      for (const NetcdfVariable* const variable : grid.variables) names.push_back(variable->name);
  } catch (const Error&) {  // of no concern where polygons are read
  }
  return names;
}

}  // namespace

bool isColumnsGrid(const OpenGridOptions& options) {
  try {
    const NetcdfFiles file(options);
    if (!findColumnsMap(file)) return false;
    if (options.scalars.empty()) return true;
    const std::vector<std::string> others = structuredVariables(file);
    return std::find(others.begin(), others.end(), options.scalars.front()) == others.end();
  } catch (const Error&) {
    return false;  // the reader of structured grids says what is wrong
  }
}

ColumnsSource::ColumnsSource(const OpenGridOptions& options)
    : file_(options),
      map_(mapOf(file_)),
      scalars_(chooseColumnsScalars(file_, map_, options.scalars, description_.warnings)),
      heights_(findColumnsHeights(file_, map_, scalars_)),
      bottom_(findColumnsBottom(file_, map_, scalars_)) {
  findTimes(options);
  findFirstNode();
  const std::string unit = lowerCase(map_.longitude->text("units"));
  const auto length = kilometresOf(unit);
  const bool radians =
      unit.starts_with("rad") || (unit.empty() && map_.format != "UGRID" && map_.format != "FESOM");
  const bool plane = length.has_value() || map_.longitude->name == "xVertex" ||
                     (isUnitless(unit) && cfRole(file_, *map_.longitude) == CfRole::kX);
  if (plane && !length && map_.format == "UGRID")
    description_.warnings.push_back(fmt::format("{} and {} have no unit of length; metres are assumed",
                                                map_.longitude->name, map_.latitude->name));
  to_degrees_ = plane ? length.value_or(1e-3) : radians ? 180 / std::numbers::pi : 1;
  globe_ = globeWith(options.globe, !plane, 0.0);
  requireDegrees();
  if (heights_.levels.empty()) spoolHeights(options.temporary_folder);
  describe(options);
  findCutFaces();
  noteSagitta();
}

void ColumnsSource::findTimes(const OpenGridOptions& options) {
  if (scalars_.time_dim) {
    const NetcdfDimension& dimension = file_.dimensions()[*scalars_.time_dim];
    if (dimension.length == 0)
      throw Error("{}: has no time step: dimension {} has length 0", file_.path().string(), dimension.name);
    const CfTimes times = cfTimes(file_, *scalars_.time_dim, *scalars_.variables.front());
    description_.times = times.values;
    description_.time_unit = times.unit;
    description_.calendar = times.calendar;
  }
  description_.time_step = chosenTimeStep(file_.path().string(), description_.times, options.time_step);
}

void ColumnsSource::describe(const OpenGridOptions& options) {
  description_.files = file_.paths();
  description_.coordinate_bytes = 8;
  description_.globe = globe_;
  const bool cells = scalars_.centring == Centring::kCell;
  const uint64_t prisms = cells ? scalars_.layers : scalars_.layers - 1;
  description_.pieces.push_back({fmt::format("{} faces, {} layers", map_.faces, prisms),
                                 file_.path().string(), map_.nodes * levels(), map_.faces * prisms});
  for (const NetcdfVariable* const variable : scalars_.variables) {
    GridScalar scalar{variable->name, variable->text("units"), {}, 0, scalars_.centring};
    if (const std::string name = simplifiedName(variable->text("standard_name")); !name.empty())
      scalar.aliases.push_back(name);
    description_.scalars.push_back(std::move(scalar));
  }
  const std::string shape = globe_.sphere() ? fmt::format("on a sphere of {:g} km", options.globe.radius_km)
                                            : std::string("on a flat map");
  description_.format =
      fmt::format("{} ({}), {} faces, {}, heights of {} times {:g}, in km", map_.format, file_.kind(),
                  map_.faces, shape, heights_.words, options.globe.vertical_scale);
  if (!file_.selected().empty()) description_.format += ", " + file_.selected();
  const std::vector<std::string> others = structuredVariables(file_);
  if (!others.empty())
    description_.warnings.push_back(fmt::format(
        "left out: {}, on a structured grid; choose it with --scalar {}", listed(others, 3), others.front()));
  const auto& warnings = file_.warnings();
  description_.warnings.insert(description_.warnings.end(), warnings.begin(), warnings.end());
}

uint64_t ColumnsSource::levels() const {
  return scalars_.layers + (scalars_.centring == Centring::kCell ? 1 : 0);
}

uint64_t ColumnsSource::pointOf(uint64_t node, uint64_t level) const {
  return scalars_.layer_fastest ? node * levels() + level : level * map_.nodes + node;
}

/// Cuts samples [first, first + count) of `columns` columns of `layers` layers into boxes.
template <typename Use>
void ColumnsSource::forEachPart(uint64_t first, uint64_t count, uint64_t columns, uint64_t layers,
                                const Use& use) const {
  if (scalars_.layer_fastest) {
    if (count == 0) return;
    const uint64_t column = first / layers;
    use(Part{column, (first + count - 1) / layers - column + 1, 0, layers, first % layers, count});
    return;
  }
  while (count > 0) {
    const uint64_t layer = first / columns, across = first % columns;
    const uint64_t taken = std::min(count, columns - across);
    use(Part{across, taken, layer, 1, 0, taken});
    first += taken;
    count -= taken;
  }
}

std::vector<double> ColumnsSource::storedNodesOf(uint64_t first, uint64_t count) const {
  const NetcdfVariable& variable = *map_.nodes_of_face;
  const uint64_t sides = map_.most_sides;
  std::vector<double> stored(count * sides);
  if (stored.empty()) return stored;
  const bool faces_first = variable.dims[0] == map_.face_dim;
  file_.read(variable,
             faces_first ? NetcdfBox{{first, 0}, {count, sides}} : NetcdfBox{{0, first}, {sides, count}},
             std::span(stored));
  if (faces_first) return stored;
  std::vector<double> by_face(stored.size());
  for (uint64_t n = 0; n < count; ++n)
    for (uint64_t side = 0; side < sides; ++side) by_face[n * sides + side] = stored[side * count + n];
  return by_face;
}

void ColumnsSource::findFirstNode() {
  if (map_.format != "UGRID") return;
  double least = std::numeric_limits<double>::infinity(), most = 0;
  bool zero_is_node = false;  // rather than a fill value, which is no face's first, second or third node
  for (uint64_t first = 0; first < map_.faces; first += kFacesAtOnce) {
    const uint64_t count = std::min(kFacesAtOnce, map_.faces - first);
    const std::vector<double> stored = storedNodesOf(first, count);
    for (size_t n = 0; n < stored.size(); n += map_.most_sides) {
      const double a = stored[n], b = stored[n + 1], c = stored[n + 2];
      zero_is_node |= a * b * c == 0 && a != b && b != c && c != a;
    }
    for (const double node : stored) {
      if (!(node >= 0)) continue;  // a fill value
      least = std::min(least, node);
      most = std::max(most, node);
    }
  }
  const auto nodes = static_cast<double>(map_.nodes);
  const bool from_one = map_.first_node == 0 && least == 1 && most == nodes;
  const bool from_zero = map_.first_node == 1 && zero_is_node && most < nodes;
  if (!from_one && !from_zero) return;
  description_.warnings.push_back(fmt::format(
      "{} has the nodes {} to {}, which are counted from {}; its start_index {}", map_.nodes_of_face->name,
      least, most, 1 - map_.first_node,
      map_.nodes_of_face->attributes.contains("start_index") ? fmt::format("is {:g}", map_.first_node)
                                                             : "is missing"));
  map_.first_node = 1 - map_.first_node;
}

std::vector<int64_t> ColumnsSource::nodesOf(uint64_t first, uint64_t count) const {
  const uint64_t sides = map_.most_sides;
  const std::vector<double> stored = storedNodesOf(first, count);
  std::vector<double> given(count, static_cast<double>(sides));
  if (map_.sides && count > 0) file_.read(*map_.sides, {{first}, {count}}, std::span(given));
  std::vector<int64_t> nodes(count * sides, -1);
  for (uint64_t n = 0; n < count; ++n)
    for (uint64_t side = 0; side < sides && static_cast<double>(side) < given[n]; ++side) {
      const double node = stored[n * sides + side] - map_.first_node;
      if (std::isnan(node) || (node < 0 && map_.format == "UGRID")) break;  // a fill value: fewer sides
      if (!(node >= 0 && node < static_cast<double>(map_.nodes)))
        throw Error("{}: face {} has the node {}; expected {} to {}; the file is damaged",
                    file_.path().string(), first + n, node + map_.first_node, map_.first_node,
                    static_cast<double>(map_.nodes) - 1 + map_.first_node);
      nodes[n * sides + side] = static_cast<int64_t>(node);
    }
  return nodes;
}

void ColumnsSource::spoolHeights(const std::filesystem::path& folder) {
  heights_ = findColumnsHeights(file_, map_, scalars_, description_.time_step);
  ColumnsHeightsReader reader(file_, heights_);
  NumberSpool<double> spool(std::make_shared<SpoolFile>(folder));
  const uint64_t columns = heights_.of_nodes ? map_.nodes : map_.faces;
  for (uint64_t level = 0; level < levels(); ++level) {
    std::vector<double> sums(map_.nodes, 0.0);
    std::vector<uint32_t> counts(map_.nodes, 0);
    for (uint64_t first = 0; first < columns; first += kFacesAtOnce) {
      const uint64_t count = std::min(kFacesAtOnce, columns - first);
      const std::vector<double> heights = reader.read(first, count, level);
      if (heights_.of_nodes) {
        for (const double height : heights) spool.add(height);
        continue;
      }
      const std::vector<int64_t> nodes = nodesOf(first, count);
      for (size_t n = 0; n < nodes.size(); ++n) {
        const double height = heights[n / map_.most_sides];
        if (nodes[n] < 0 || !std::isfinite(height)) continue;
        sums[static_cast<size_t>(nodes[n])] += height;
        ++counts[static_cast<size_t>(nodes[n])];
      }
    }
    for (size_t n = 0; n < sums.size() && !heights_.of_nodes; ++n) spool.add(sums[n] / counts[n]);
  }
  node_heights_ = spool.finish();
}

void ColumnsSource::readHeights(uint64_t level, uint64_t first, std::span<double> out) const {
  if (heights_.levels.empty())
    node_heights_.read(level * map_.nodes + first, out);
  else
    std::fill(out.begin(), out.end(), heights_.levels[level]);
}

/// Throws where most of the nodes lie at no place on the Earth.
void ColumnsSource::requireDegrees() const {
  if (!globe_.degrees()) return;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::array<double, 2> least{kInfinity, kInfinity}, most{-kInfinity, -kInfinity};
  uint64_t there = 0, wrong = 0;
  for (uint64_t first = 0; first < map_.nodes; first += kFacesAtOnce) {
    const uint64_t count = std::min(kFacesAtOnce, map_.nodes - first);
    const std::array angles{readAngles(*map_.longitude, first, count),
                            readAngles(*map_.latitude, first, count)};
    for (uint64_t n = 0; n < count; ++n) {
      if (!std::isfinite(angles[0][n]) || !std::isfinite(angles[1][n]))
        continue;  // a node that the mesh lacks
      ++there;
      wrong += !isOnEarth(angles[0][n], angles[1][n]);
    }
    for (size_t axis = 0; axis < 2; ++axis)
      for (const double angle : angles[axis]) {
        least[axis] = std::min(least[axis], angle);
        most[axis] = std::max(most[axis], angle);
      }
  }
  if (2 * wrong > there)
    throw Error(
        "{}: {} is {:g} .. {:g} and {} is {:g} .. {:g} degrees, which are no longitudes and latitudes: "
        "lengths "
        "need a unit of length (ncatted -a units,{},o,c,m FILE), degrees degrees_east and degrees_north",
        file_.path().string(), map_.longitude->name, least[0], most[0], map_.latitude->name, least[1],
        most[1], map_.longitude->name);
}

/// Calls use(face, its nodes) for each; nodes below 0 are none.
template <typename Use>
void ColumnsSource::forEachFace(const Use& use) const {
  for (uint64_t first = 0; first < map_.faces; first += kFacesAtOnce) {
    const uint64_t count = std::min(kFacesAtOnce, map_.faces - first);
    const std::vector<int64_t> nodes = nodesOf(first, count);
    for (uint64_t n = 0; n < count; ++n)
      use(first + n, std::span(nodes).subspan(n * map_.most_sides, map_.most_sides));
  }
}

void ColumnsSource::findCutFaces() {
  if (globe_.sphere() || !globe_.degrees()) return;
  std::vector<double> from_middle = readAngles(*map_.longitude, 0, map_.nodes);
  for (double& longitude : from_middle)
    longitude = std::remainder(longitude - globe_.middle_longitude, 360.0);
  forEachFace([&](uint64_t face, std::span<const int64_t> nodes) {
    double least = 180, most = -180;
    for (const int64_t node : nodes) {
      if (node < 0) continue;
      least = std::min(least, from_middle[static_cast<size_t>(node)]);
      most = std::max(most, from_middle[static_cast<size_t>(node)]);
    }
    if (most - least > 180) cut_faces_.push_back(face);
  });
  if (!cut_faces_.empty())
    description_.warnings.push_back(fmt::format(
        "{} of {} faces lie across the edge of the flat map, opposite the longitude {:g}, and are left out",
        cut_faces_.size(), map_.faces, globe_.middle_longitude));
}

double ColumnsSource::thinnestLayer() const {
  double thinnest = std::numeric_limits<double>::infinity();
  std::vector<double> heights(std::min(kFacesAtOnce, map_.nodes)), next(heights.size());
  readHeights(0, 0, heights);
  for (uint64_t level = 1; level < levels(); ++level) {
    readHeights(level, 0, next);
    double sum = 0, count = 0;
    for (size_t n = 0; n < next.size(); ++n) {
      const double thickness = std::abs(next[n] - heights[n]);
      if (!(thickness > 0)) continue;  // below the ground
      sum += thickness;
      ++count;
    }
    if (count > 0) thinnest = std::min(thinnest, sum / count);
    heights.swap(next);
  }
  return std::isfinite(thinnest) ? thinnest : 0.0;
}

void ColumnsSource::noteSagitta() {
  // Cells of more are smaller than 20 km, unless the mesh is very uneven, and lie less than 10 m below the sphere.
  constexpr uint64_t kMaxNodes = 1 << 21;
  if (!globe_.sphere() || map_.nodes > kMaxNodes) return;
  const std::vector<double> longitude = readAngles(*map_.longitude, 0, map_.nodes);
  const std::vector<double> latitude = readAngles(*map_.latitude, 0, map_.nodes);
  double deepest = 0;  // in radii
  forEachFace([&](uint64_t, std::span<const int64_t> nodes) {
    glm::dvec3 sum(0.0);
    double count = 0;
    for (const int64_t node : nodes) {
      if (node < 0) continue;
      const double east = longitude[static_cast<size_t>(node)], north = latitude[static_cast<size_t>(node)];
      if (!isOnEarth(east, north)) return;  // it is blanked
      sum += globe_.column(east, north);
      ++count;
    }
    if (const double depth = 1 - glm::length(sum) / count; depth > deepest) deepest = depth;
  });
  std::string warning = warningOfSagitta(globe_.radius_km * deepest, globe_.vertical_scale * thinnestLayer());
  if (!warning.empty()) description_.warnings.push_back(std::move(warning));
}

std::vector<double> ColumnsSource::readAngles(const NetcdfVariable& variable, uint64_t first,
                                              uint64_t count) const {
  std::vector<double> values(count);
  if (count > 0) file_.read(variable, {{first}, {count}}, std::span(values));
  for (double& value : values) value *= to_degrees_;
  return values;
}

std::vector<double> ColumnsSource::layersOf(uint64_t first, uint64_t count) const {
  std::vector<double> layers(count, std::numeric_limits<double>::infinity());
  if (!bottom_.layers || count == 0) return layers;
  file_.read(*bottom_.layers, {{first}, {count}}, std::span(layers));
  for (double& number : layers) number -= bottom_.surplus;
  return layers;
}

void ColumnsSource::readScalars(uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                                std::vector<std::vector<float>>& out) const {
  const bool cells = scalars_.centring == Centring::kCell;
  const size_t across_dim = cells ? map_.face_dim : map_.node_dim;
  out.resize(scalars.size());
  for (size_t s = 0; s < scalars.size(); ++s) {
    const ColumnsReader reader(file_, *scalars_.variables.at(scalars[s]), across_dim, scalars_.layer_dim,
                               scalars_.time_dim ? description_.time_step : 0);
    out[s].clear();
    forEachPart(first, count, cells ? map_.faces : map_.nodes, scalars_.layers, [&](const Part& part) {
      const auto box = reader.read<float>(part.across, part.columns, part.layer, part.layers);
      for (uint64_t n = part.skipped; n < part.skipped + part.taken; ++n)
        out[s].push_back(box.value(n / part.layers, n % part.layers));
    });
  }
}

void ColumnsSource::readPoints(uint32_t, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                               MeshPoints& out) const {
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->clear();
  out.hidden.clear();
  const bool values_at_nodes = scalars_.centring == Centring::kNode;
  forEachPart(first, count, map_.nodes, levels(), [&](const Part& part) {
    const std::vector<double> longitude = readAngles(*map_.longitude, part.across, part.columns);
    const std::vector<double> latitude = readAngles(*map_.latitude, part.across, part.columns);
    std::vector<double> heights(part.columns * part.layers);
    for (uint64_t layer = 0; layer < part.layers; ++layer) {
      const auto row = std::span(heights).subspan(layer * part.columns, part.columns);
      readHeights(part.layer + layer, part.across, row);
    }
    std::vector<double> layers;
    if (values_at_nodes) layers = layersOf(part.across, part.columns);
    for (uint64_t n = part.skipped; n < part.skipped + part.taken; ++n) {
      const uint64_t column = n / part.layers, layer = n % part.layers;
      out.hidden.push_back(values_at_nodes && static_cast<double>(part.layer + layer) >= layers[column]);
      const bool nowhere = globe_.degrees() && !isOnEarth(longitude[column], latitude[column]);
      const glm::dvec3 place = nowhere ? glm::dvec3(std::numeric_limits<double>::quiet_NaN())
                                       : globe_.place(globe_.column(longitude[column], latitude[column]),
                                                      heights[layer * part.columns + column]);
      out.x.push_back(place.x);
      out.y.push_back(place.y);
      out.z.push_back(place.z);
    }
  });
  out.scalars.clear();
  if (values_at_nodes) readScalars(first, count, scalars, out.scalars);
}

void ColumnsSource::readCells(uint32_t, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                              MeshCells& out) const {
  out.clear();
  const uint64_t layers = levels() - 1;
  std::vector<uint64_t> points;
  forEachPart(first, count, map_.faces, layers, [&](const Part& part) {
    const std::vector<int64_t> nodes = nodesOf(part.across, part.columns);
    std::vector<double> with_data(part.columns, std::numeric_limits<double>::infinity());
    if (scalars_.centring == Centring::kCell) with_data = layersOf(part.across, part.columns);
    for (auto cut = std::lower_bound(cut_faces_.begin(), cut_faces_.end(), part.across);
         cut != cut_faces_.end() && *cut < part.across + part.columns; ++cut)
      with_data[*cut - part.across] = 0;
    for (uint64_t n = part.skipped; n < part.skipped + part.taken; ++n) {
      const uint64_t column = n / part.layers, layer = part.layer + n % part.layers;
      points.clear();
      for (const uint64_t level : {layer, layer + 1})
        for (uint64_t side = 0; side < map_.most_sides; ++side)
          if (const int64_t node = nodes[column * map_.most_sides + side]; node >= 0)
            points.push_back(pointOf(static_cast<uint64_t>(node), level));
      out.appendPrism(points);
      if (static_cast<double>(layer) >= with_data[column]) out.hidden.back() = 1;
    }
  });
  out.scalars.clear();
  if (scalars_.centring == Centring::kCell) readScalars(first, count, scalars, out.scalars);
}

}  // namespace curvisplat
