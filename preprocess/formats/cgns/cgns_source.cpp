#include "preprocess/formats/cgns/cgns_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/cgns/adf_trial.h"
#include "preprocess/formats/cgns/cgns_cells.h"
#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_tree.h"
#include "preprocess/formats/common/block_source.h"
#include "preprocess/formats/common/element_source.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kZonesListed = 3;

/// The arrays of a scalar on a zone: one, or three for the magnitude of a vector. Empty: the scalar is NaN.
/// The file's CgnsTree owns the arrays.
using CgnsArrays = std::vector<const CgnsArray*>;
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
    for (size_t n = 0; n < std::min(kZonesListed, zones.size()); ++n)
      names += (n ? ", " : "") + zoneName(tree, zones[n]);
    if (zones.size() > kZonesListed) names += fmt::format(" and {} more", zones.size() - kZonesListed);
    description.warnings.push_back(fmt::format("{} of {} zones ({}) have no {}; they are not drawn with it",
                                               zones.size(), tree.zones.size(), names, listed(scalars)));
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

// ---- structured zones ----

/// The box of an array with a rind of further samples around it.
CgnsBox insideRind(const CgnsArray& array, CgnsBox box) {
  for (size_t axis = 0; axis < 3; ++axis) box.first[axis] += array.rind[axis];
  return box;
}

class CgnsBlocks final : public BlockSource {
 public:
  CgnsBlocks(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step)
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

 private:
  BlockArray<Places> nodesOf(uint32_t block) const override {
    return [this, &zone = tree_.zones[block]](const ArrayBox& box, const Places& to) {
      for (size_t axis = 0; axis < 3; ++axis) {
        const CgnsArray& array = zone.coordinates[axis];
        file_->read(array.node, array.shape, insideRind(array, box), to.axes[axis]);
      }
    };
  }
  BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const override {
    std::vector<BlockArray<float*>> components;
    for (const CgnsArray* const array : arrays_.at(scalar)[block])
      components.push_back([this, array](const ArrayBox& box, float* to) {
        file_->read(array->node, array->shape, insideRind(*array, box), to);
      });
    if (components.empty()) return {};
    return components.size() == 1 ? components[0] : magnitudeOf(std::move(components));
  }
  void blankNodes(uint32_t block, const NodeBox& box, std::vector<uint8_t>& blank) const override {
    const CgnsZone& zone = tree_.zones[block];
    if (!zone.holes.empty()) zone.holes.blankNodes(zone.nodes, box, blank);
  }
  void blankCells(uint32_t block, const NodeBox& box, std::vector<float>& values) const override {
    tree_.zones[block].holes.blankCells(tree_.zones[block].nodes, box, values);
  }

  std::shared_ptr<const CgnsFile> file_;
  CgnsTree tree_;
  ArraysOfScalars arrays_;
};

// ---- unstructured zones ----

/// Reads samples [first, first + to.size()) of a list, without those of the rind.
template <typename Value>
void readRange(const CgnsFile& file, const CgnsArray& array, uint64_t first, std::span<Value> to) {
  if (to.empty()) return;
  const uint64_t count = to.size();
  file.read(array.node, array.shape, {{array.rind[0] + first, 0, 0}, {count, 1, 1}, {count, 1}, {}},
            to.data());
}

class CgnsPieces final : public ElementSource {
 public:
  CgnsPieces(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step,
             const std::filesystem::path& folder);

 private:
  void dropFieldsOfCells(size_t zone);
  void describeKinds();
  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override {
    for (size_t axis = 0; axis < 3; ++axis)
      readRange(*file_, tree_.zones.at(piece).coordinates[axis], first, to.span(axis, count));
  }
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override {
    cells_.at(piece).read(first, count, out);
  }
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override;

  std::shared_ptr<const CgnsFile> file_;
  CgnsTree tree_;
  std::vector<CgnsCells> cells_;  // [zone]
  ArraysOfScalars arrays_;
};

CgnsPieces::CgnsPieces(std::shared_ptr<const CgnsFile> file, CgnsTree tree, uint32_t time_step,
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
  describeKinds();
  arrays_ = describeScalars(tree_, description_);
}

/// Drops the zone's fields in cells if they do not have a value for each of its cells.
void CgnsPieces::dropFieldsOfCells(size_t zone_number) {
  CgnsZone& zone = tree_.zones[zone_number];
  const uint64_t count = cells_[zone_number].cells();
  if (count == zone.cells) return;
  const size_t dropped =
      std::erase_if(zone.fields, [](const CgnsField& field) { return field.centring == Centring::kCell; });
  if (dropped > 0)
    tree_.warnings.push_back(
        fmt::format("the {} cell-centred fields of {}/{} are left out: they have {} values, but its sections "
                    "have {} elements that may be solid",
                    dropped, zone.base, zone.name, zone.cells, count));
}

/// Whether there are curved cells, and a warning of those that are not solid.
void CgnsPieces::describeKinds() {
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

void CgnsPieces::readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const {
  const CgnsArrays& arrays = arrays_.at(scalar)[piece];
  const auto read = [&](size_t component, std::span<float> values) {
    readRange(*file_, *arrays[component], first, values);
  };
  if (arrays.size() == 1) read(0, to);
  if (arrays.size() > 1) readMagnitude(arrays.size(), to, read);
}

}  // namespace

std::unique_ptr<DataSource> openCgns(const OpenGridOptions& options) {
  tryAdf(options.grid);
  auto file = std::make_shared<const CgnsFile>(options.grid);
  const uint32_t step = options.time_step.value_or(0);
  CgnsTree tree = readCgnsTree(*file, step);
  if (tree.unstructured)
    return std::make_unique<CgnsPieces>(std::move(file), std::move(tree), step, options.temporary_folder);
  return std::make_unique<CgnsBlocks>(std::move(file), std::move(tree), step);
}

}  // namespace curvisplat
