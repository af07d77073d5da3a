#include "preprocess/formats/ensight/ensight_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <vector>

#include "preprocess/formats/common/block_source.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/ensight/ensight_case.h"
#include "preprocess/formats/ensight/ensight_parts.h"
#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

std::vector<uint64_t> pointsOf(const EnsightList& nodes, uint64_t first, uint64_t count) {
  std::vector<double> stored(count);
  nodes.read(first, std::span(stored));
  std::vector<uint64_t> points(count);
  std::transform(stored.begin(), stored.end(), points.begin(),
                 [](double node) { return pointNumber(node, 1); });
  return points;
}

void appendElements(const EnsightElements& elements, uint64_t first, uint64_t count, MeshCells& out) {
  const uint64_t each = elements.nodes_each;
  const std::vector<uint64_t> points = pointsOf(elements.nodes, first * each, count * each);
  for (uint64_t n = 0; n < count; ++n)
    appendCurved(elements.kind, std::span(points).subspan(n * each, each), out);
}

void appendPolyhedra(const EnsightElements& elements, uint64_t first, uint64_t count, MeshCells& out) {
  std::vector<uint64_t> faces(count + 1);
  elements.first_face.read(first, std::span(faces));
  std::vector<uint64_t> begins(faces.back() - faces.front() + 1), stream;
  elements.first_node.read(faces.front(), std::span(begins));
  const std::vector<uint64_t> points =
      pointsOf(elements.nodes, begins.front(), begins.back() - begins.front());
  for (uint64_t n = 0; n < count; ++n) {
    stream.clear();
    for (uint64_t face = faces[n] - faces[0]; face < faces[n + 1] - faces[0]; ++face) {
      stream.push_back(begins[face + 1] - begins[face]);
      const auto of_face = std::span(points).subspan(begins[face] - begins[0], stream.back());
      stream.insert(stream.end(), of_face.begin(), of_face.end());
    }
    out.appendPolyhedron(faces[n + 1] - faces[n], stream);
  }
}

void readCoordinates(const EnsightPart& part, uint64_t first, uint64_t count, const Places& to) {
  for (size_t axis = 0; axis < 3; ++axis)
    part.coordinates.read(axis * part.points + first, to.span(axis, count));
}

/// `kept`: which elements stay, in their order.
template <typename Element>
void keepOnly(const std::vector<size_t>& kept, std::vector<Element>& all) {
  std::vector<Element> left;
  left.reserve(kept.size());
  for (const size_t n : kept) left.push_back(std::move(all[n]));
  all = std::move(left);
}

/// The files of a case, and its parts of one kind. Any number of threads may read.
class EnsightData {
 public:
  explicit EnsightData(const OpenGridOptions& options);

  bool structured() const { return structured_; }
  const std::vector<EnsightPart>& parts() const { return geometry_.parts; }
  bool hasCurvedCells() const { return has_curved_cells_; }
  const GridDescription& description() const { return description_; }
  /// Values [first, first + to.size()) of a scalar in list `list` of a part. NaN where there are none.
  void readValues(uint32_t scalar, size_t part, size_t list, uint64_t first, std::span<float> to) const;

 private:
  void chooseParts();
  void describeParts();
  void addScalars(const std::vector<EnsightVariable>& variables);
  void describeUndefined(const std::string& name, const std::vector<EnsightValues>& parts);

  struct Scalar {
    size_t variable = 0;
    int component = 0;  // or kMagnitude
  };
  EnsightGeometry geometry_;
  bool structured_ = false, has_curved_cells_ = false;
  std::vector<std::vector<EnsightValues>> values_;  // [variable][part]
  std::vector<Scalar> scalars_;
  GridDescription description_;
};

EnsightData::EnsightData(const OpenGridOptions& options) {
  EnsightCase found = readEnsightCase(options.grid, options.namesFolder(), options.time_step);
  const EnsightScratch scratch(options.temporary_folder, options.index.get());
  geometry_ = readEnsightGeometry(found.geometry, scratch);
  description_.files = {options.grid.string(), found.geometry.file.string()};
  description_.times = std::move(found.times);
  description_.time_step = found.time_step;
  description_.warnings = std::move(found.warnings);
  description_.coordinate_bytes = 4;
  for (const EnsightVariable& variable : found.variables) {
    description_.files.push_back(variable.place.file.string());
    values_.push_back(readEnsightValues(variable, geometry_, scratch));
  }
  chooseParts();
  describeParts();
  addScalars(found.variables);
}

/// Structured parts where there are any; parts without volumes are left out.
void EnsightData::chooseParts() {
  const std::string name = description_.files[1];
  std::vector<bool> solid;
  for (const EnsightPart& part : geometry_.parts) {
    const auto is_solid = [](const EnsightElements& e) { return e.kind != CellKind::kNone && e.count > 0; };
    solid.push_back(part.structured ? part.cells > 0
                                    : std::any_of(part.elements.begin(), part.elements.end(), is_solid));
    structured_ = structured_ || (part.structured && solid.back());
  }
  size_t others = 0, flat = 0;
  std::vector<size_t> kept;
  for (size_t n = 0; n < geometry_.parts.size(); ++n) {
    if (solid[n] && geometry_.parts[n].structured == structured_)
      kept.push_back(n);
    else
      ++(solid[n] ? others : flat);
  }
  keepOnly(kept, geometry_.parts);
  for (auto& of_parts : values_) keepOnly(kept, of_parts);
  if (geometry_.parts.empty())
    throw Error("{}: has no part with volumes ({} of points, lines or faces)", name, flat);
  if (flat > 0)
    description_.warnings.push_back(
        fmt::format("{} without volumes {} left out", countText(flat, "part"), isOrAre(flat)));
  if (others > 0)
    description_.warnings.push_back(
        fmt::format("{} {} unstructured and left out: a cache holds structured or unstructured parts",
                    countText(others, "part"), isOrAre(others)));
}

void EnsightData::describeParts() {
  uint64_t flat = 0;
  for (const EnsightPart& part : geometry_.parts) {
    const std::string name = part.name.empty() ? fmt::format("part {}", part.number) : part.name;
    if (structured_)
      description_.blocks.push_back(
          {name, part.nodes[0], part.nodes[1], part.nodes[2], part.iblank.count > 0});
    else
      description_.pieces.push_back({name, description_.files[1], part.points, part.cells});
    for (const EnsightElements& elements : part.elements) {
      const size_t corners = cornersOf(elements.kind);
      if (elements.kind == CellKind::kNone) flat += elements.count;
      has_curved_cells_ |= corners > 0 && elements.nodes_each > corners;
    }
  }
  if (flat > 0)
    description_.warnings.push_back(fmt::format("{} without volumes (points, lines, faces) {} left out",
                                                countText(flat, "element"), isOrAre(flat)));
  description_.format =
      fmt::format("EnSight Gold, {}, {}", geometry_.binary ? "C Binary" : "ASCII",
                  countText(geometry_.parts.size(), structured_ ? "structured part" : "unstructured part"));
}

void EnsightData::describeUndefined(const std::string& name, const std::vector<EnsightValues>& parts) {
  std::set<double> undefined;
  for (const EnsightValues& values : parts)
    for (const double value : values.undefined)
      if (std::isfinite(value)) undefined.insert(value);
  for (const double value : undefined)
    description_.undefined +=
        fmt::format("{}{} = {:g}", description_.undefined.empty() ? "" : ", ", name, value);
}

void EnsightData::addScalars(const std::vector<EnsightVariable>& variables) {
  ScalarList list(description_);
  for (size_t n = 0; n < variables.size(); ++n) {
    const EnsightVariable& variable = variables[n];
    describeUndefined(variable.name, values_[n]);
    const char* const place = variable.centring == Centring::kCell ? ":cell" : ":node";
    forEachComponent(variable.components, [&](const std::string& suffix, int component) {
      const std::string name = variable.name + suffix;
      list.add({name, name + place}, variable.centring);
      scalars_.push_back({n, component});
    });
  }
}

void EnsightData::readValues(uint32_t scalar_number, size_t part_number, size_t list, uint64_t first,
                             std::span<float> to) const {
  const Scalar& scalar = scalars_.at(scalar_number);
  const EnsightValues& values = values_[scalar.variable][part_number];
  if (list >= values.lists.size() || values.lists[list].count == 0)
    return std::fill(to.begin(), to.end(), kNaN);
  const EnsightPart& part = geometry_.parts[part_number];
  const bool cells = description_.scalars[scalar_number].centring == Centring::kCell;
  const uint64_t count = !cells ? part.points : part.structured ? part.cells : part.elements[list].count;
  const auto read = [&](size_t component, std::span<float> of_component) {
    values.lists[list].read(component * count + first, of_component);
    std::replace(of_component.begin(), of_component.end(), static_cast<float>(values.undefined[list]), kNaN);
  };
  if (scalar.component != kMagnitude) return read(static_cast<size_t>(scalar.component), to);
  readMagnitude(3, to, read);
}

class EnsightGrid final : public BlockSource {
 public:
  explicit EnsightGrid(EnsightData data) : data_(std::move(data)) { description_ = data_.description(); }

 private:
  BlockArray<Places> nodesOf(uint32_t block) const override {
    const EnsightPart& part = data_.parts()[block];
    if (part.kind != EnsightPart::Kind::kCurvilinear)
      return placesAlongAxes([&part](size_t axis, uint64_t index) { return part.axes[axis][index]; });
    return [&part](uint64_t first, uint64_t count, const Places& to) {
      readCoordinates(part, first, count, to);
    };
  }
  BlockArray<float*> iblankOf(uint32_t block) const override {
    return [&list = data_.parts()[block].iblank](uint64_t first, uint64_t count, float* to) {
      list.read(first, std::span(to, count));
    };
  }
  BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const override {
    return [this, block, scalar](uint64_t first, uint64_t count, float* to) {
      data_.readValues(scalar, block, 0, first, std::span(to, count));
    };
  }

  const EnsightData data_;
};

class EnsightMesh final : public ElementSource {
 public:
  explicit EnsightMesh(EnsightData data) : data_(std::move(data)) {
    description_ = data_.description();
    has_curved_cells_ = data_.hasCurvedCells();
  }

 private:
  /// Elements that are not drawn are not counted.
  static uint64_t countOf(const EnsightElements& elements) {
    return elements.kind == CellKind::kNone ? 0 : elements.count;
  }

  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override {
    readCoordinates(data_.parts().at(piece), first, count, to);
  }
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override {
    const std::vector<EnsightElements>& lists = data_.parts().at(piece).elements;
    forEachPartOfLists(lists, first, count, countOf, [&](const PartOfList& part) {
      const EnsightElements& elements = lists[part.list];
      if (elements.kind == CellKind::kPolyhedron)
        appendPolyhedra(elements, part.first, part.count, out);
      else
        appendElements(elements, part.first, part.count, out);
      if (elements.ghosts)
        std::fill(out.hidden.end() - static_cast<ptrdiff_t>(part.count), out.hidden.end(), 1);
    });
  }
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override {
    if (description_.scalars.at(scalar).centring == Centring::kNode)
      return data_.readValues(scalar, piece, 0, first, to);
    forEachPartOfLists(
        data_.parts().at(piece).elements, first, to.size(), countOf, [&](const PartOfList& part) {
          data_.readValues(scalar, piece, part.list, part.first, to.subspan(part.at, part.count));
        });
  }

  const EnsightData data_;
};

}  // namespace

std::unique_ptr<DataSource> openEnsight(const OpenGridOptions& options) {
  EnsightData data(options);
  if (data.structured()) return std::make_unique<EnsightGrid>(std::move(data));
  return std::make_unique<EnsightMesh>(std::move(data));
}

}  // namespace curvisplat
