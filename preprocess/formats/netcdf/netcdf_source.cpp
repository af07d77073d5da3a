#include "preprocess/formats/netcdf/netcdf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "preprocess/formats/netcdf/cf_roles.h"
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

std::string describeDimensions(const NetcdfFile& file, const CfGrid& grid) {
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

}  // namespace

NetcdfSource::NetcdfSource(const OpenGridOptions& options)
    : file_(options.grid),
      grid_(chooseGrid(file_, options, description_, mask_)),
      length_(kilometresOf(grid_.longitude.variable().text("units")).value_or(1e-3)),
      globe_(globeOf(options.globe)) {
  describe(options);
}

CfGrid NetcdfSource::chooseGrid(const NetcdfFile& file, const OpenGridOptions& options,
                                GridDescription& description, size_t& mask) {
  CfGrids found = findCfGrids(file, options.time_step.value_or(0));
  if (found.grids.empty()) {
    if (const auto format = foreignNetcdf(file))
      throw Error("{}: is {}; only structured (curvilinear) grids are read", file.path().string(), *format);
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
  if (!grid_.degrees && options.shape == GlobeOptions::Shape::kSphere)
    throw Error("{}: {} and {} are lengths; --sphere needs degrees: leave it out", file_.path().string(),
                grid_.longitude.variable().name, grid_.latitude.variable().name);
  // The map is cut opposite the middle of the grid.
  CfRange middle;
  for (size_t axis = 0; axis < 3; ++axis) {
    middle.begin[axis] = file_.dimensions()[grid_.dims.axes[axis]].length / 2;
    middle.end[axis] = middle.begin[axis] + 1;
  }
  const bool flat = grid_.degrees && options.shape == GlobeOptions::Shape::kFlat;
  return Globe(options, grid_.degrees, flat ? grid_.longitude.read(file_, middle).values.at(0) : 0);
}

void NetcdfSource::describe(const OpenGridOptions& options) {
  description_.files.push_back(options.grid.string());
  description_.times = cfTimes(file_, grid_);
  const NetcdfVariable* const time =
      grid_.dims.time ? file_.find(file_.dimensions()[*grid_.dims.time].name) : nullptr;
  if (time) {
    description_.time_unit = time->text("units");
    description_.calendar = time->text("calendar");
  }
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
  for (const std::string& warning : grid_.vertical.warnings()) description_.warnings.push_back(warning);

  const std::string shape = globe_.sphere() ? fmt::format("on a sphere of {:g} km", options.globe.radius_km)
                            : grid_.degrees
                                ? fmt::format("on a flat map of a sphere of {:g} km", options.globe.radius_km)
                                : "flat";
  description_.format = fmt::format("{}, {}, {} {}, vertical {} times {:g}, in km", file_.kind(),
                                    grid_.longitude.variable().name, grid_.latitude.variable().name, shape,
                                    grid_.vertical.description(), options.globe.vertical_scale);
  if (grid_.dims.time)
    description_.format +=
        fmt::format(", time step {} of {}", description_.time_step, description_.times.size());
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
}

void NetcdfSource::readBlank(const NodeBox& box, std::vector<uint8_t>& blank) const {
  const uint64_t ni = description_.blocks[0].ni, nj = box.j1 - box.j0;
  const uint64_t rows = std::clamp<uint64_t>(kMaskNodesAtATime / ni, 1, nj);
  const uint64_t planes = std::clamp<uint64_t>(kMaskNodesAtATime / (ni * rows), 1, box.k1 - box.k0);
  std::vector<float> values;
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += rows) {
      // Several planes only if each is read whole: so the pieces are contiguous in `blank`.
      const NodeBox piece{j, std::min(j + rows, box.j1), k, std::min(k + planes, box.k1)};
      values.resize(ni * (piece.j1 - piece.j0) * (piece.k1 - piece.k0));
      readScalar(piece, mask_, values);
      for (const float value : values) blank[n++] = std::isnan(value);
    }
}

void NetcdfSource::readPlaces(const NodeBox& box, NodeArrays& out) const {
  const uint64_t ni = description_.blocks[0].ni, nj = box.j1 - box.j0;
  const uint64_t rows = std::clamp<uint64_t>(kNodesAtATime / ni, 1, nj);
  const uint64_t planes = std::clamp<uint64_t>(kNodesAtATime / (ni * rows), 1, box.k1 - box.k0);
  std::vector<GlobeColumn> columns;
  const bool read = grid_.vertical.readNodes(file_, {{0, box.j0, box.k0}, {ni, box.j1, box.k1}}, out.z);
  CfValues height;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += rows) {
      const CfRange range{{0, j, k}, {ni, std::min(j + rows, box.j1), std::min(k + planes, box.k1)}};
      const CfValues east = grid_.longitude.read(file_, range), north = grid_.latitude.read(file_, range);
      if (!read) height = grid_.vertical.heights(file_, range);
      const double scale = grid_.degrees ? 1 : length_;
      const auto column = [&](uint64_t ii, uint64_t jj, uint64_t kk) {
        return globe_.column(scale * east.at(ii, jj, kk), scale * north.at(ii, jj, kk));
      };
      // Usually one column serves all levels.
      const bool upright = !grid_.longitude.varies(2) && !grid_.latitude.varies(2);
      const uint64_t rows_here = range.end[1] - range.begin[1];
      columns.clear();
      for (uint64_t jj = 0; upright && jj < rows_here; ++jj)
        for (uint64_t ii = 0; ii < ni; ++ii) columns.push_back(column(ii, jj, 0));
      for (uint64_t kk = 0; kk < range.end[2] - range.begin[2]; ++kk)
        for (uint64_t jj = 0; jj < rows_here; ++jj)
          for (uint64_t ii = 0; ii < ni; ++ii) {
            const uint64_t n = ii + ni * ((j - box.j0 + jj) + nj * (k - box.k0 + kk));
            const GlobePlace place = globe_.place(upright ? columns[ii + ni * jj] : column(ii, jj, kk),
                                                  read ? out.z[n] : height.at(ii, jj, kk));
            out.x[n] = place.x;
            out.y[n] = place.y;
            out.z[n] = place.z;
          }
    }
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
