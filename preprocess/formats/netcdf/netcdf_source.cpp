#include "preprocess/formats/netcdf/netcdf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "preprocess/formats/netcdf/cf_roles.h"
#include "preprocess/formats/netcdf/closed_grid.h"
#include "preprocess/formats/netcdf/foreign_netcdf.h"
#include "preprocess/grid/scalar_names.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;
// Positions are computed for this many nodes at a time, which bounds the buffers.
constexpr uint64_t kNodesAtATime = 1 << 16;
// The mask variable, if it is not requested itself, is read for this many nodes at a time.
constexpr uint64_t kMaskNodesAtATime = 1 << 20;

std::string listed(const std::vector<std::string>& names) {
  const size_t count = std::min(kNamesListed, names.size());
  std::string text =
      fmt::format("{}", fmt::join(names.begin(), names.begin() + static_cast<ptrdiff_t>(count), ", "));
  if (names.size() > count) text += fmt::format(" and {} more", names.size() - count);
  return text;
}

std::string describeDimensions(const NetcdfFiles& file, const CfGrid& grid) {
  const auto name = [&](size_t axis) { return file.dimensions()[grid.dims.axes[axis]].name; };
  return fmt::format("{} x {} x {}", name(0), name(1), name(2));
}

std::map<std::string, std::vector<std::string>> byReason(const std::vector<CfLeftOut>& left_out) {
  std::map<std::string, std::vector<std::string>> reasons;
  for (const CfLeftOut& one : left_out) reasons[one.reason].push_back(one.variable);
  return reasons;
}

bool isCalled(const NetcdfVariable& variable, const std::string& name) {
  const std::string simple = simplifiedName(name);
  return simplifiedName(variable.name) == simple || simplifiedName(variable.text("standard_name")) == simple;
}

/// Indices of the scalar `name`: of its grid, and of the variable in that grid.
std::optional<std::pair<size_t, size_t>> positionOf(const std::vector<CfGrid>& grids,
                                                    const std::string& name) {
  for (const bool exact : {true, false})
    for (size_t g = 0; g < grids.size(); ++g)
      for (size_t v = 0; v < grids[g].variables.size(); ++v) {
        const NetcdfVariable& variable = *grids[g].variables[v];
        if (exact ? variable.name == name : isCalled(variable, name)) return std::pair(g, v);
      }
  return std::nullopt;
}

std::vector<std::filesystem::path> filesOf(const OpenGridOptions& options) {
  std::vector<std::filesystem::path> files{options.grid};
  files.insert(files.end(), options.solutions.begin(), options.solutions.end());
  return files;
}

/// Calls `each` for pieces of a box that are contiguous in it, of about `nodes` nodes or a row.
template <typename Each>
void forEachPiece(const NodeBox& box, uint64_t ni, uint64_t nodes, const Each& each) {
  const uint64_t nj = box.j1 - box.j0;
  const uint64_t rows = std::clamp<uint64_t>(nodes / ni, 1, nj);
  const uint64_t planes = rows < nj ? 1 : std::clamp<uint64_t>(nodes / (ni * rows), 1, box.k1 - box.k0);
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += rows)
      each(NodeBox{j, std::min(j + rows, box.j1), k, std::min(k + planes, box.k1)});
}

}  // namespace

std::unique_ptr<GridSource> openNetcdf(const OpenGridOptions& options) {
  auto source = std::make_unique<NetcdfSource>(options);
  if (const auto closure = source->closure())
    return std::make_unique<ClosedGrid>(std::move(source), *closure);
  return source;
}

NetcdfSource::NetcdfSource(const OpenGridOptions& options)
    : file_(filesOf(options)),
      grid_(chooseGrid(file_, options, description_, mask_)),
      length_(kilometresOf(grid_.longitude.variable().text("units")).value_or(1e-3)),
      globe_(globeOf(options.globe)) {
  describe(options);
}

CfGrid NetcdfSource::chooseGrid(const NetcdfFiles& file, const OpenGridOptions& options,
                                GridDescription& description, size_t& mask) {
  CfGrids found = findCfGrids(file, options.time_step.value_or(0));
  if (found.grids.empty()) {
    if (const auto format = foreignNetcdf(file))
      throw Error(
          "{}: is {}; structured grids are read, and UGRID, ICON and MPAS in files that have their faces "
          "and nodes",
          file.path().string(), *format);
    std::string why = "no variable has three dimensions in space";
    if (!found.left_out.empty()) {
      const auto reasons = byReason(found.left_out);
      why = fmt::format("{}: {}", listed(reasons.begin()->second), reasons.begin()->first);
    }
    throw Error("{}: has no grid by the CF conventions: {}", file.path().string(), why);
  }

  size_t chosen = 0;
  for (size_t g = 1; g < found.grids.size(); ++g)
    if (found.grids[g].variables.size() > found.grids[chosen].variables.size()) chosen = g;
  std::string chooser;
  for (const std::string& name : options.scalars) {
    const auto position = positionOf(found.grids, name);
    if (!position) continue;  // a derived scalar, or a wrong name, which scalarsNamed() reports
    if (!chooser.empty() && position->first != chosen)
      throw Error("{}: {} and {} are on different grids ({} and {}); convert each to a cache of its own",
                  file.path().string(), chooser, name, describeDimensions(file, found.grids[chosen]),
                  describeDimensions(file, found.grids[position->first]));
    if (chooser.empty()) mask = position->second;
    chosen = position->first;
    chooser = name;
  }
  for (size_t g = 0; g < found.grids.size(); ++g) {
    if (g == chosen) continue;
    std::vector<std::string> names;
    for (const NetcdfVariable* variable : found.grids[g].variables) names.push_back(variable->name);
    description.warnings.push_back(
        fmt::format("left out: {}, on another grid ({}); select that grid with --scalar NAME", listed(names),
                    describeDimensions(file, found.grids[g])));
  }
  for (const auto& [reason, names] : byReason(found.left_out))
    description.warnings.push_back(fmt::format("left out: {}: {}", listed(names), reason));
  return std::move(found.grids[chosen]);
}

Globe NetcdfSource::globeOf(const GlobeOptions& options) const {
  if (!grid_.degrees && !grid_.projection && options.shape == GlobeOptions::Shape::kSphere)
    throw Error("{}: {} and {} are lengths; --sphere needs degrees, or a map projection: leave it out",
                file_.path().string(), grid_.longitude.variable().name, grid_.latitude.variable().name);
  // The map is cut opposite the middle of the grid.
  CfRange middle;
  for (size_t axis = 0; axis < 3; ++axis) {
    middle.begin[axis] = file_.dimensions()[grid_.dims.axes[axis]].length / 2;
    middle.end[axis] = middle.begin[axis] + 1;
  }
  const bool flat = options.shape == GlobeOptions::Shape::kFlat;
  // A projected map stays the flat map that it is.
  const bool degrees = grid_.degrees || (grid_.projection && !flat);
  double longitude = 0;
  if (degrees && flat) {
    longitude = grid_.longitude.read(file_, middle).values.at(0);
    double latitude = grid_.latitude.read(file_, middle).values.at(0);
    if (grid_.projection) grid_.projection->toGeographic({&longitude, 1}, {&latitude, 1});
  }
  return Globe(options, degrees, longitude);
}

bool NetcdfSource::projects() const {
  return grid_.projection && globe_.degrees();
}

void NetcdfSource::describe(const OpenGridOptions& options) {
  description_.files = file_.paths();
  const CfTimes times = cfTimes(file_, grid_);
  description_.times = times.values;
  description_.time_unit = times.unit;
  description_.calendar = times.calendar;
  if (grid_.dims.time && description_.times.empty())
    throw Error("{}: has no time step: dimension {} has length 0", file_.path().string(),
                file_.dimensions()[*grid_.dims.time].name);
  description_.time_step = chosenTimeStep(file_.path().string(), description_.times, options.time_step);

  const auto length = [&](size_t axis) { return file_.dimensions()[grid_.dims.axes[axis]].length; };
  description_.blocks.push_back({describeDimensions(file_, grid_), length(0), length(1), length(2), true});
  for (const NetcdfVariable* variable : grid_.variables) {
    GridScalar scalar{variable->name, variable->text("units"), {}, 0, Centring::kNode};
    if (const std::string name = simplifiedName(variable->text("standard_name")); !name.empty())
      scalar.aliases.push_back(name);
    description_.scalars.push_back(std::move(scalar));
  }
  if (const std::string missing = file_.missingValues(*grid_.variables[mask_]); !missing.empty())
    description_.blanking =
        fmt::format("{} is missing where it is {}", grid_.variables[mask_]->name, missing);
  description_.coordinate_bytes =
      std::max(grid_.longitude.variable().value_bytes, grid_.latitude.variable().value_bytes) > 4 ? 8 : 4;
  if (grid_.mask)
    description_.blanking +=
        fmt::format("{}{}", description_.blanking.empty() ? "" : ", or where ", grid_.mask->description());
  for (const auto* warnings : {&grid_.vertical.warnings(), &file_.duplicates()})
    description_.warnings.insert(description_.warnings.end(), warnings->begin(), warnings->end());
  if (grid_.indices)
    description_.warnings.push_back(
        fmt::format("the dimensions {} have no coordinates; the indices of the nodes take their place",
                    describeDimensions(file_, grid_)));

  const std::string shape = globe_.sphere() ? fmt::format("on a sphere of {:g} km", options.globe.radius_km)
                            : globe_.degrees()
                                ? fmt::format("on a flat map of a sphere of {:g} km", options.globe.radius_km)
                                : "flat";
  const std::string projection = grid_.projection ? fmt::format(" ({})", grid_.projection->name()) : "";
  description_.format =
      fmt::format("{}, {}, {}{} {}, vertical {} times {:g}, in km", file_.kind(),
                  grid_.longitude.variable().name, grid_.latitude.variable().name, projection, shape,
                  grid_.vertical.description(), options.globe.vertical_scale);
  if (grid_.dims.time)
    description_.format +=
        fmt::format(", time step {} of {}", description_.time_step, description_.times.size());
  if (const double share = shareOfZeros(); share > 0)
    description_.warnings.push_back(
        fmt::format("{} is exactly 0 at {:.0f} % of the nodes, at all levels, which may be land; --blank 0 "
                    "leaves these out",
                    grid_.variables[mask_]->name, 100 * share));
}

/// Where a file marks land by zeros alone: the share of columns that are 0 at the first, middle and last level,
/// in a row in the middle and those a quarter from the ends. 0 if less than a hundredth, if all, in the air, and
/// where values are missing or a mask tells.
double NetcdfSource::shareOfZeros() const {
  const GridBlock& block = description_.blocks[0];
  if (grid_.levels != 2 || grid_.mask || !isOcean(file_, grid_)) return 0;
  uint64_t zero = 0, all = 0;
  for (const uint64_t quarter : {1, 2, 3}) {
    const uint64_t j = block.nj * quarter / 4;
    std::vector<uint8_t> zeros(block.ni, 1);
    std::vector<float> values(block.ni);
    for (const uint64_t k : {uint64_t{0}, block.nk / 2, block.nk - 1}) {
      readScalar({j, j + 1, k, k + 1}, mask_, values);
      for (uint64_t i = 0; i < block.ni; ++i) {
        if (std::isnan(values[i])) return 0;
        zeros[i] &= values[i] == 0;
      }
    }
    for (const uint8_t one : zeros) zero += one;
    all += block.ni;
  }
  return zero == all || 100 * zero < all ? 0 : static_cast<double>(zero) / static_cast<double>(all);
}

void NetcdfSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                        NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, ==, 0u);
  const size_t nodes = description_.blocks[0].ni * (box.j1 - box.j0) * (box.k1 - box.k0);
  for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  readPlaces(box, out);
  out.blank.assign(nodes, 0);
  out.scalars.resize(scalars.size());
  const std::vector<float>* mask = nullptr;
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, grid_.variables.size());
    out.scalars[n].resize(nodes);
    readScalar(box, scalars[n], out.scalars[n]);
    if (scalars[n] == mask_) mask = &out.scalars[n];
  }
  if (mask)
    for (size_t n = 0; n < nodes; ++n) out.blank[n] = std::isnan((*mask)[n]);
  else
    readBlank(box, out.blank);
  if (grid_.mask) applyMask(box, out.blank);
}

void NetcdfSource::applyMask(const NodeBox& box, std::vector<uint8_t>& blank) const {
  const uint64_t ni = description_.blocks[0].ni;
  size_t n = 0;
  forEachPiece(box, ni, kNodesAtATime, [&](const NodeBox& piece) {
    const size_t nodes = ni * (piece.j1 - piece.j0) * (piece.k1 - piece.k0);
    grid_.mask->apply(file_, {{0, piece.j0, piece.k0}, {ni, piece.j1, piece.k1}}, {&blank[n], nodes});
    n += nodes;
  });
}

void NetcdfSource::readBlank(const NodeBox& box, std::vector<uint8_t>& blank) const {
  const uint64_t ni = description_.blocks[0].ni;
  std::vector<float> values;
  size_t n = 0;
  forEachPiece(box, ni, kMaskNodesAtATime, [&](const NodeBox& piece) {
    values.resize(ni * (piece.j1 - piece.j0) * (piece.k1 - piece.k0));
    readScalar(piece, mask_, values);
    for (const float value : values) blank[n++] = std::isnan(value);
  });
}

/// The columns of the box's nodes; those of its first plane only where one column serves all levels.
void NetcdfSource::readColumns(const CfRange& range, std::vector<GlobeColumn>& columns) const {
  const CfValues east = grid_.longitude.read(file_, range), north = grid_.latitude.read(file_, range);
  const double scale = !grid_.degrees && !projects() ? length_ : 1;
  const bool upright = !grid_.longitude.varies(2) && !grid_.latitude.varies(2);
  const uint64_t planes = upright ? 1 : range.end[2] - range.begin[2];
  std::vector<double> x, y;
  for (uint64_t k = 0; k < planes; ++k)
    for (uint64_t j = 0; j < range.end[1] - range.begin[1]; ++j)
      for (uint64_t i = 0; i < range.end[0] - range.begin[0]; ++i) {
        x.push_back(scale * east.at(i, j, k));
        y.push_back(scale * north.at(i, j, k));
      }
  if (projects()) {
    if (!grid_.degrees)  // PROJ's lengths are metres
      for (std::vector<double>* axis : {&x, &y})
        for (double& value : *axis) value *= 1e3 * length_;
    grid_.projection->toGeographic(x, y);
  }
  columns.clear();
  for (size_t n = 0; n < x.size(); ++n) columns.push_back(globe_.column(x[n], y[n]));
}

std::optional<GridClosure> NetcdfSource::closure() const {
  if (!globe_.sphere() || grid_.levels != 2) return std::nullopt;
  const GridBlock& block = description_.blocks[0];
  return closureOf(block.ni, block.nj, [&](uint64_t j) {
    std::vector<GlobeColumn> columns;
    readColumns({{0, j, 0}, {block.ni, j + 1, 1}}, columns);
    std::vector<glm::dvec3> points;
    for (const GlobeColumn& column : columns) points.push_back({column.x, column.y, column.z});
    return points;
  });
}

void NetcdfSource::readPlaces(const NodeBox& box, NodeArrays& out) const {
  const uint64_t ni = description_.blocks[0].ni;
  std::vector<GlobeColumn> columns;
  const bool read = grid_.vertical.readNodes(file_, {{0, box.j0, box.k0}, {ni, box.j1, box.k1}}, out.z);
  CfValues height;
  size_t n = 0;
  forEachPiece(box, ni, kNodesAtATime, [&](const NodeBox& piece) {
    const CfRange range{{0, piece.j0, piece.k0}, {ni, piece.j1, piece.k1}};
    readColumns(range, columns);
    if (!read) height = grid_.vertical.heights(file_, range);
    size_t column = 0;
    for (uint64_t k = 0; k < piece.k1 - piece.k0; ++k)
      for (uint64_t j = 0; j < piece.j1 - piece.j0; ++j)
        for (uint64_t i = 0; i < ni; ++i, ++n, ++column) {
          if (column == columns.size()) column = 0;
          const GlobePlace place = globe_.place(columns[column], read ? out.z[n] : height.at(i, j, k));
          out.x[n] = place.x;
          out.y[n] = place.y;
          out.z[n] = place.z;
        }
  });
}

void NetcdfSource::readScalar(const NodeBox& box, size_t scalar, std::vector<float>& to) const {
  const NetcdfVariable& variable = *grid_.variables[scalar];
  const std::array<uint64_t, 3> begin{0, box.j0, box.k0},
      count{description_.blocks[0].ni, box.j1 - box.j0, box.k1 - box.k0};
  NetcdfBox part{std::vector<size_t>(variable.dims.size(), 0), std::vector<size_t>(variable.dims.size(), 1)};
  for (size_t d = 0; d < variable.dims.size(); ++d) {
    if (grid_.dims.time && variable.dims[d] == *grid_.dims.time) part.start[d] = grid_.dims.time_step;
    for (size_t axis = 0; axis < 3; ++axis)
      if (variable.dims[d] == grid_.dims.axes[axis]) {
        part.start[d] = begin[axis];
        part.count[d] = count[axis];
      }
  }
  file_.read(variable, part, std::span<float>(to));
}

}  // namespace curvisplat
