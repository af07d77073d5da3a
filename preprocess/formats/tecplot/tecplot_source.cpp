#include "preprocess/formats/tecplot/tecplot_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>

#include "preprocess/formats/tecplot/tecplot_data.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr const char* kAxisNames[3][3] = {{"x", "coordinatex", "xcoordinate"},
                                          {"y", "coordinatey", "ycoordinate"},
                                          {"z", "coordinatez", "zcoordinate"}};
constexpr const char* kIblankNames[] = {"iblank"};

/// "x" of "X (m)" and of "X [m]".
std::string nameAlone(const std::string& name) {
  return simplifiedName(name.substr(0, name.find_first_of("([", 1)));
}

}  // namespace

bool isTecplot(const InputFile& file) {
  return isTecplotBinary(file) || isTecplotText(file);
}

TecplotSource::TecplotSource(const OpenGridOptions& options) {
  const auto file = std::make_shared<const PooledFile>(std::make_shared<OpenFiles>(), options.grid);
  description_.files = {options.grid.string()};
  data_ = isTecplotBinary(InputFile(options.grid)) ? readTecplotBinary(file)
                                                   : readTecplotText(file, options.temporary_folder);
  if (data_.zones.empty()) throw Error("{}: is a Tecplot file without zones; expected a grid", file->name());
  chooseStep(options);
  leaveOutFlatZones();
  findCoordinates();
  addScalars();
  description_.coordinate_bytes = 4;
  for (const TecplotZone& zone : data_.zones) {
    for (const size_t axis : axes_)
      if (zone.values[axis].type == TecplotType::kDouble && !zone.values[axis].from_single)
        description_.coordinate_bytes = 8;
    const std::string name =
        zone.name.empty() ? fmt::format("zone {}", description_.blocks.size() + 1) : zone.name;
    description_.blocks.push_back(
        {name, zone.nodes[0], zone.nodes[1], zone.nodes[2], iblank_ && !zone.values[*iblank_].passive});
  }
  const size_t zones = data_.zones.size();
  description_.format =
      fmt::format("Tecplot, {}, {} ordered zone{}", data_.encoding, zones, zones == 1 ? "" : "s");
}

void TecplotSource::chooseStep(const OpenGridOptions& options) {
  std::set<double> times;
  for (const TecplotZone& zone : data_.zones)
    if (zone.time) times.insert(*zone.time);
  description_.times.assign(times.begin(), times.end());
  description_.time_step = chosenTimeStep(description_.files[0], description_.times, options.time_step);
  if (times.size() < 2) return;
  const double time = description_.times[description_.time_step];
  std::erase_if(data_.zones, [&](const TecplotZone& zone) { return zone.time && *zone.time != time; });
}

void TecplotSource::leaveOutFlatZones() {
  std::string flat;
  for (size_t n = 0; n < data_.zones.size() && flat.empty(); ++n)
    if (const TecplotZone& zone = data_.zones[n]; zone.flat())
      flat =
          fmt::format("{} of {}x{}x{} nodes", zone.describe(n), zone.nodes[0], zone.nodes[1], zone.nodes[2]);
  const size_t all = data_.zones.size();
  std::erase_if(data_.zones, [](const TecplotZone& zone) { return zone.flat(); });
  if (data_.zones.empty())
    throw Error("{}: has no zone with volume: {} is flat; expected a three-dimensional grid",
                description_.files[0], flat);
  if (data_.zones.size() < all)
    description_.warnings.push_back(
        fmt::format("{} of {} zones are flat and left out, such as {}", all - data_.zones.size(), all, flat));
}

std::optional<size_t> TecplotSource::variableNamed(std::span<const char* const> names) const {
  for (size_t n = 0; n < data_.variables.size(); ++n)
    if (std::find(names.begin(), names.end(), nameAlone(data_.variables[n])) != names.end()) return n;
  return std::nullopt;
}

void TecplotSource::findCoordinates() {
  if (data_.variables.size() < 3)
    throw Error("{}: has {} variables; expected x, y and z", description_.files[0], data_.variables.size());
  axes_ = {0, 1, 2};
  std::array<std::optional<size_t>, 3> found;
  for (size_t axis = 0; axis < 3; ++axis) found[axis] = variableNamed(kAxisNames[axis]);
  if (found[0] && found[1] && found[2])
    axes_ = {*found[0], *found[1], *found[2]};
  else
    description_.warnings.push_back(
        fmt::format("no variables are named x, y and z; the first three ({}, {}, {}) are taken",
                    data_.variables[0], data_.variables[1], data_.variables[2]));
  for (size_t n = 0; n < data_.zones.size(); ++n)
    for (const size_t axis : axes_) {
      const TecplotValues& values = data_.zones[n].values[axis];
      if (values.passive || values.centring == Centring::kCell)
        throw Error("{}: {} has no {} at its nodes; expected coordinates there", description_.files[0],
                    data_.zones[n].describe(n), data_.variables[axis]);
    }
  iblank_ = variableNamed(kIblankNames);
  const auto of_cells = [&](const TecplotZone& zone) {
    return zone.values[*iblank_].centring == Centring::kCell;
  };
  if (iblank_ && std::any_of(data_.zones.begin(), data_.zones.end(), of_cells)) iblank_.reset();
  if (iblank_) description_.blanking = "iblank 0";
}

void TecplotSource::addScalars() {
  for (size_t n = 0; n < data_.variables.size(); ++n) {
    if (std::find(axes_.begin(), axes_.end(), n) != axes_.end() || n == iblank_) continue;
    std::array<size_t, 2> zones{};  // of nodes, of cells
    for (const TecplotZone& zone : data_.zones)
      if (!zone.values[n].passive) ++zones[static_cast<size_t>(zone.values[n].centring == Centring::kCell)];
    const size_t without = data_.zones.size() - zones[0] - zones[1];
    if (without > 0)
      description_.warnings.push_back(
          fmt::format("{} of {} zones have no values of {}; they are not drawn with it", without,
                      data_.zones.size(), data_.variables[n]));
    for (const Centring centring : {Centring::kNode, Centring::kCell}) {
      const bool cells = centring == Centring::kCell;
      if (zones[cells] == 0) continue;
      GridScalar scalar;
      scalar.name = data_.variables[n];
      if (zones[0] > 0 && zones[1] > 0) scalar.name += cells ? ":cell" : ":node";
      const auto taken = [&](const GridScalar& other) { return other.name == scalar.name; };
      if (std::any_of(description_.scalars.begin(), description_.scalars.end(), taken))
        scalar.name += fmt::format(":{}", n + 1);
      scalar.aliases = {nameAlone(data_.variables[n])};
      scalar.centring = centring;
      description_.scalars.push_back(std::move(scalar));
      variables_.push_back(n);
    }
  }
}

/// Values of cells go to their lowest nodes; the other elements of `to` are left.
template <typename Value>
void TecplotSource::readBox(const TecplotZone& zone, size_t variable, const NodeBox& box,
                            std::vector<Value>& to) const {
  const TecplotValues& values = zone.values[variable];
  const uint64_t less = values.centring == Centring::kCell ? 1 : 0;
  const uint64_t ni = zone.nodes[0], row = box.rowNodes(ni), rows = box.j1 - box.j0;
  const uint64_t end = std::min(box.endOfRow(ni), ni - less);
  const uint64_t j1 = std::min(box.j1, zone.nodes[1] - less), k1 = std::min(box.k1, zone.nodes[2] - less);
  if (box.j0 >= j1 || box.i0 >= end) return;
  const uint64_t along = end - box.i0;
  for (uint64_t k = box.k0; k < k1; ++k) {
    const uint64_t first = values.row_pitch * (box.j0 + values.columns * k) + box.i0,
                   at = row * rows * (k - box.k0);
    if (along == ni && values.row_pitch == ni) {
      readTecplotValues(values, first, std::span(to).subspan(at, ni * (j1 - box.j0)));
      continue;
    }
    for (uint64_t j = 0; j < j1 - box.j0; ++j)
      readTecplotValues(values, first + values.row_pitch * j, std::span(to).subspan(at + row * j, along));
  }
}

void TecplotSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                         NodeArrays& out) const {
  const TecplotZone& zone = data_.zones.at(block);
  const size_t nodes = box.rowNodes(zone.nodes[0]) * (box.j1 - box.j0) * (box.k1 - box.k0);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(nodes);
    readBox(zone, axes_[axis], box, *axes[axis]);
  }
  out.blank.assign(nodes, 0);
  if (description_.blocks[block].has_blanking) {
    std::vector<float> iblank(nodes);
    readBox(zone, *iblank_, box, iblank);
    std::transform(iblank.begin(), iblank.end(), out.blank.begin(),
                   [](float value) { return static_cast<uint8_t>(value == 0); });
  }
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    out.scalars[n].assign(nodes, std::numeric_limits<float>::quiet_NaN());
    const size_t variable = variables_.at(scalars[n]);
    const TecplotValues& values = zone.values[variable];
    if (!values.passive && values.centring == description_.scalars[scalars[n]].centring)
      readBox(zone, variable, box, out.scalars[n]);
  }
}

bool TecplotSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  if (!description_.blocks.at(block).has_blanking) return false;
  const TecplotZone& zone = data_.zones[block];
  std::vector<float> iblank(zone.nodes[0] * (box.j1 - box.j0) * (box.k1 - box.k0));
  readBox(zone, *iblank_, box, iblank);
  out.resize(iblank.size());
  std::transform(iblank.begin(), iblank.end(), out.begin(),
                 [](float value) { return static_cast<uint8_t>(value < 0); });
  return true;
}

}  // namespace curvisplat
