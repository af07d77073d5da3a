#include "preprocess/formats/cgns/cgns_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "preprocess/formats/cgns/cgns_file.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kNamesListed = 3;
using ArraysOfScalars = std::vector<std::vector<CgnsArrays>>;  // [scalar][zone]

/// The zone's name, with its base's if there are several bases.
std::string zoneName(const CgnsTree& tree, size_t zone) {
  return tree.bases > 1 ? tree.zones[zone].base + "/" + tree.zones[zone].name : tree.zones[zone].name;
}

/// Files, format, times, warnings and notes.
void describeZones(const CgnsFile& file, const CgnsTree& tree, uint32_t time_step,
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
      names += (n ? ", " : "") + zoneName(tree, zones[n]);
    if (zones.size() > kNamesListed) names += fmt::format(" and {} more", zones.size() - kNamesListed);
    description.warnings.push_back(fmt::format("{} of {} zones ({}) have no {}; they are not drawn with it",
                                               zones.size(), tree.zones.size(), names,
                                               fmt::join(scalars, ", ")));
  }
}

/// Adds the scalars to the description, and warnings of zones without them.
ArraysOfScalars describeScalars(const CgnsTree& tree, GridDescription& description) {
  ArraysOfScalars arrays_of;
  addScalars(tree, description, arrays_of);
  addVectors(tree, description, arrays_of);
  warnOfGaps(tree, arrays_of, description);
  return arrays_of;
}

/// Reads samples [first, first + count) of a list, without those of the rind.
template <typename Value>
void readRange(const CgnsFile& file, const CgnsArray& array, uint64_t first, std::vector<Value>& to) {
  if (to.empty()) return;
  const uint64_t count = to.size();
  file.read(array.node, array.shape, {{array.rind[0] + first, 0, 0}, {count, 1, 1}, {count, 1}}, to.data());
}

}  // namespace

CgnsMeshSource::CgnsMeshSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step,
                               const std::filesystem::path& folder)
    : file_(std::move(file)), tree_(std::move(tree)) {
  cells_.reserve(tree_.zones.size());  // cells hold pointers to their own sections
  const ListSpools spools(folder);
  for (const CgnsZone& zone : tree_.zones) cells_.emplace_back(*file_, zone, spools);
  for (size_t n = 0; n < tree_.zones.size(); ++n) dropFieldsOfCells(n);
  describeZones(*file_, tree_, time_step, description_);
  for (size_t n = 0; n < tree_.zones.size(); ++n)
    description_.pieces.push_back(
        {zoneName(tree_, n), file_->path().string(), tree_.zones[n].nodes[0], cells_[n].cells()});
  warnOfKinds();
  arrays_ = describeScalars(tree_, description_);
}

/// Drops the zone's fields in cells if they do not have a value for each of its cells.
void CgnsMeshSource::dropFieldsOfCells(size_t zone_number) {
  CgnsZone& zone = tree_.zones[zone_number];
  const uint64_t cells = cells_[zone_number].cells();
  if (cells == zone.cells) return;
  const size_t dropped =
      std::erase_if(zone.fields, [](const CgnsField& field) { return field.centring == Centring::kCell; });
  if (dropped > 0)
    tree_.warnings.push_back(
        fmt::format("the {} cell-centred fields of {}/{} are left out: they have {} values, but its sections "
                    "have {} elements that may be solid",
                    dropped, zone.base, zone.name, zone.cells, cells));
}

void CgnsMeshSource::warnOfKinds() {
  CgnsCells::Counts all;
  for (const CgnsCells& cells : cells_) {
    all.solid += cells.counts().solid;
    all.curved += cells.counts().curved;
    all.others += cells.counts().others;
  }
  if (all.solid == 0)
    throw Error(
        "{}: its unstructured zones have no solid element; expected TETRA, PYRA, PENTA, HEXA or NFACE",
        file_->path().string());
  has_curved_cells_ = all.curved > 0;
  if (all.others > 0)
    description_.warnings.push_back(
        fmt::format("{} elements are nodes, lines or faces and are left out", all.others));
}

void CgnsMeshSource::readScalars(uint32_t piece, uint64_t first, uint64_t count,
                                 std::span<const uint32_t> scalars,
                                 std::vector<std::vector<float>>& out) const {
  out.resize(scalars.size());
  std::vector<float> component(count);
  for (size_t n = 0; n < scalars.size(); ++n) {
    const CgnsArrays& arrays = arrays_.at(scalars[n])[piece];
    out[n].assign(count, arrays.empty() ? std::numeric_limits<float>::quiet_NaN() : 0.0f);
    if (arrays.size() == 1) readRange(*file_, *arrays[0], first, out[n]);
    if (arrays.size() < 2) continue;
    std::vector<double> squares(count, 0.0);
    for (const CgnsArray* const array : arrays) {
      readRange(*file_, *array, first, component);
      for (size_t m = 0; m < count; ++m) squares[m] += double{component[m]} * component[m];
    }
    for (size_t m = 0; m < count; ++m) out[n][m] = static_cast<float>(std::sqrt(squares[m]));
  }
}

void CgnsMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                std::span<const uint32_t> scalars, MeshPoints& out) const {
  const CgnsZone& zone = tree_.zones.at(piece);
  const std::array<std::vector<double>*, 3> axes{&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(count);
    readRange(*file_, zone.coordinates[axis], first, *axes[axis]);
  }
  out.hidden.assign(count, 0);
  readScalars(piece, first, count, scalars, out.scalars);
}

void CgnsMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                               std::span<const uint32_t> scalars, MeshCells& out) const {
  cells_.at(piece).read(first, count, out);
  readScalars(piece, first, count, scalars, out.scalars);
}

namespace {

// A vector is read in groups of rows of about this many nodes.
constexpr uint64_t kRowsOfNodes = 1 << 16;

/// The part of `box` that has samples of the given centring, as a box of the array, with its destination.
CgnsBox boxOf(const CgnsZone& zone, const NodeBox& box, const CgnsArray& array, Centring centring) {
  const uint64_t last = centring == Centring::kCell ? 1 : 0;
  const uint64_t j1 = std::min(box.j1, zone.nodes[1] - last), k1 = std::min(box.k1, zone.nodes[2] - last);
  CgnsBox part;
  const uint64_t i1 = std::min(box.i1, zone.nodes[0] - last);
  part.first = {array.rind[0] + box.i0, array.rind[1] + box.j0, array.rind[2] + box.k0};
  part.count = {i1 - std::min(box.i0, i1), j1 - std::min(box.j0, j1), k1 - std::min(box.k0, k1)};
  part.memory = {box.rowNodes(zone.nodes[0]), box.j1 - box.j0};
  return part;
}

bool empty(const CgnsBox& box) {
  return box.count[0] == 0 || box.count[1] == 0 || box.count[2] == 0;
}

}  // namespace

CgnsSource::CgnsSource(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step)
    : file_(std::move(file)), tree_(std::move(tree)) {
  describeZones(*file_, tree_, time_step, description_);
  for (const CgnsZone& zone : tree_.zones) {
    for (GridBoundary boundary : zone.boundaries) {
      boundary.block = static_cast<uint32_t>(description_.blocks.size());
      description_.boundaries.push_back(std::move(boundary));
    }
    const std::string name = zoneName(tree_, description_.blocks.size());
    description_.blocks.push_back({name, zone.nodes[0], zone.nodes[1], zone.nodes[2], !zone.holes.empty()});
    if (!zone.holes.empty()) description_.blanking = "in overset holes of the zones";
  }
  arrays_ = describeScalars(tree_, description_);
}

void CgnsSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  CURVISPLAT_CHECK_OP(block, <, tree_.zones.size());
  const CgnsZone& zone = tree_.zones[block];
  const size_t nodes = box.rowNodes(zone.nodes[0]) * (box.j1 - box.j0) * (box.k1 - box.k0);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(nodes);
    const CgnsArray& array = zone.coordinates[axis];
    const CgnsBox part = boxOf(zone, box, array, Centring::kNode);
    if (!empty(part)) file_->read(array.node, array.shape, part, axes[axis]->data());
  }
  out.blank.assign(nodes, 0);
  if (!zone.holes.empty()) zone.holes.blankNodes(zone.nodes, box, out.blank);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, arrays_.size());
    out.scalars[n].assign(nodes, std::numeric_limits<float>::quiet_NaN());
    readScalar(zone, box, arrays_[scalars[n]][block], description_.scalars[scalars[n]].centring,
               out.scalars[n]);
    if (description_.scalars[scalars[n]].centring == Centring::kCell)
      zone.holes.blankCells(zone.nodes, box, out.scalars[n]);
  }
}

void CgnsSource::readScalar(const CgnsZone& zone, const NodeBox& box, const CgnsArrays& arrays,
                            Centring centring, std::vector<float>& to) const {
  if (arrays.empty()) return;
  const CgnsBox part = boxOf(zone, box, *arrays[0], centring);
  if (empty(part)) return;
  if (arrays.size() == 1) return file_->read(arrays[0]->node, arrays[0]->shape, part, to.data());
  // A few rows at a time, so that the buffers of the components stay small.
  const uint64_t ni = part.memory[0];
  const uint64_t rows = std::clamp<uint64_t>(kRowsOfNodes / ni, 1, part.count[1]);
  std::vector<double> squares;
  std::vector<float> component;
  for (uint64_t k = 0; k < part.count[2]; ++k)
    for (uint64_t j = 0; j < part.count[1]; j += rows) {
      const uint64_t count = std::min(rows, part.count[1] - j);
      squares.assign(ni * count, 0.0);
      component.assign(ni * count, std::numeric_limits<float>::quiet_NaN());
      for (const CgnsArray* array : arrays) {
        CgnsBox piece = boxOf(zone, box, *array, centring);
        piece.first = {piece.first[0], piece.first[1] + j, piece.first[2] + k};
        piece.count = {piece.count[0], count, 1};
        piece.memory = {ni, count};
        file_->read(array->node, array->shape, piece, component.data());
        for (size_t n = 0; n < component.size(); ++n) squares[n] += double{component[n]} * component[n];
      }
      float* const first = to.data() + ni * (j + part.memory[1] * k);
      std::transform(squares.begin(), squares.end(), first,
                     [](double square) { return static_cast<float>(std::sqrt(square)); });
    }
}

std::unique_ptr<DataSource> openCgns(const OpenGridOptions& options) {
  tryAdf(options.grid);
  auto file = std::make_shared<const CgnsFile>(options.grid);
  const uint32_t step = options.time_step.value_or(0);
  CgnsTree tree = readCgnsTree(*file, step);
  if (tree.unstructured)
    return std::make_unique<CgnsMeshSource>(std::move(file), std::move(tree), step, options.temporary_folder);
  return std::make_unique<CgnsSource>(std::move(file), std::move(tree), step);
}

}  // namespace curvisplat
