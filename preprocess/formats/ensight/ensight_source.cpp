#include "preprocess/formats/ensight/ensight_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// The point of a node, which the file counts from 1. Other numbers become one that is too large, which is
/// refused.
uint64_t pointOf(double node) {
  return node >= 1 && node <= 0x1p53 ? static_cast<uint64_t>(node) - 1 : std::numeric_limits<uint64_t>::max();
}

std::vector<uint64_t> pointsOf(const EnsightList& nodes, uint64_t first, uint64_t count) {
  std::vector<double> stored(count);
  nodes.read(first, std::span(stored));
  std::vector<uint64_t> points(count);
  std::transform(stored.begin(), stored.end(), points.begin(), pointOf);
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

/// `kept`: which elements stay, in their order.
template <typename Element>
void keepOnly(const std::vector<size_t>& kept, std::vector<Element>& all) {
  std::vector<Element> left;
  left.reserve(kept.size());
  for (const size_t n : kept) left.push_back(std::move(all[n]));
  all = std::move(left);
}

}  // namespace

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
  std::set<std::string> taken;
  for (size_t n = 0; n < variables.size(); ++n) {
    const auto add = [&](std::string name, int component) {
      if (taken.count(name) > 0) name += variables[n].centring == Centring::kCell ? ":cell" : ":node";
      taken.insert(name);
      GridScalar scalar;
      scalar.name = std::move(name);
      scalar.centring = variables[n].centring;
      description_.scalars.push_back(std::move(scalar));
      scalars_.push_back({n, component});
    };
    describeUndefined(variables[n].name, values_[n]);
    if (variables[n].components == 1) {
      add(variables[n].name, 0);
      continue;
    }
    add(variables[n].name + ":mag", -1);
    for (int c = 0; c < 3; ++c) add(fmt::format("{}:{}", variables[n].name, "xyz"[c]), c);
  }
}

void EnsightData::readValues(uint32_t scalar_number, size_t part, size_t list, uint64_t first, uint64_t count,
                             std::span<float> to) const {
  const Scalar& scalar = scalars_.at(scalar_number);
  const EnsightValues& values = values_[scalar.variable][part];
  if (list >= values.lists.size() || values.lists[list].count == 0)
    return std::fill(to.begin(), to.end(), kNaN);
  const EnsightList& stored = values.lists[list];
  const auto undefined = static_cast<float>(values.undefined[list]);
  if (scalar.component >= 0) {
    stored.read(static_cast<uint64_t>(scalar.component) * count + first, to);
    std::replace(to.begin(), to.end(), undefined, kNaN);
    return;
  }
  std::vector<double> squares(to.size(), 0.0);
  for (uint64_t c = 0; c < 3; ++c) {
    stored.read(c * count + first, to);
    for (size_t n = 0; n < to.size(); ++n)
      squares[n] += to[n] == undefined ? double{kNaN} : double{to[n]} * to[n];
  }
  std::transform(squares.begin(), squares.end(), to.begin(),
                 [](double square) { return static_cast<float>(std::sqrt(square)); });
}

void EnsightMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                   std::span<const uint32_t> scalars, MeshPoints& out) const {
  const EnsightPart& part = data_.parts().at(piece);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(count);
    part.coordinates.read(axis * part.points + first, std::span(*axes[axis]));
  }
  out.hidden.assign(count, 0);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    out.scalars[n].resize(count);
    data_.readValues(scalars[n], piece, 0, first, part.points, out.scalars[n]);
  }
}

void EnsightMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                                  std::span<const uint32_t> scalars, MeshCells& out) const {
  out.clear();
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.resize(count);
  uint64_t begin = 0;
  const std::vector<EnsightElements>& all = data_.parts().at(piece).elements;
  for (size_t list = 0; list < all.size(); ++list) {
    const EnsightElements& elements = all[list];
    if (elements.kind == CellKind::kNone) continue;
    const uint64_t from = std::max(first, begin), to = std::min(first + count, begin + elements.count);
    if (from < to) {
      if (elements.kind == CellKind::kPolyhedron)
        appendPolyhedra(elements, from - begin, to - from, out);
      else
        appendElements(elements, from - begin, to - from, out);
      if (elements.ghosts)
        std::fill(out.hidden.end() - static_cast<ptrdiff_t>(to - from), out.hidden.end(), 1);
      for (size_t n = 0; n < scalars.size(); ++n)
        data_.readValues(scalars[n], piece, list, from - begin, elements.count,
                         std::span(out.scalars[n]).subspan(from - first, to - from));
    }
    begin += elements.count;
  }
}

void EnsightGridSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                             NodeArrays& out) const {
  const EnsightPart& part = data_.parts().at(block);
  const uint64_t ni = part.nodes[0], nj = part.nodes[1], rows = box.j1 - box.j0;
  const uint64_t row = box.rowNodes(ni), cells_end = std::min(box.endOfRow(ni), ni - 1);
  const size_t nodes = row * rows * (box.k1 - box.k0);
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  for (std::vector<double>* const axis : axes) axis->resize(nodes);
  out.blank.assign(nodes, 0);
  out.scalars.resize(scalars.size());
  for (std::vector<float>& values : out.scalars) values.assign(nodes, kNaN);
  // Whole rows of a plane follow one another.
  const uint64_t rows_at_once = box.hasWholeRows(ni) ? rows : 1, count = row * rows_at_once;
  std::vector<double> iblank(count);
  for (uint64_t n_row = 0; n_row < rows * (box.k1 - box.k0); n_row += rows_at_once) {
    const uint64_t j0 = box.j0 + n_row % rows, k = box.k0 + n_row / rows;
    const uint64_t stored = ni * (j0 + nj * k) + box.i0, at = row * n_row;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (part.kind == EnsightPart::Kind::kCurvilinear) {
        part.coordinates.read(axis * part.points + stored, std::span(*axes[axis]).subspan(at, count));
        continue;
      }
      for (uint64_t n = 0; n < count; ++n) {
        const uint64_t index[] = {box.i0 + n % row, j0 + n / row, k};
        (*axes[axis])[at + n] = part.axes[axis][index[axis]];
      }
    }
    if (part.iblank.count > 0) {
      part.iblank.read(stored, std::span(iblank));
      for (uint64_t n = 0; n < count; ++n) out.blank[at + n] = iblank[n] == 0;
    }
    for (size_t n = 0; n < scalars.size(); ++n) {
      std::vector<float>& values = out.scalars[n];
      if (data_.description().scalars[scalars[n]].centring == Centring::kNode) {
        data_.readValues(scalars[n], block, 0, stored, part.points, std::span(values).subspan(at, count));
        continue;
      }
      if (box.i0 >= cells_end || k + 1 >= part.nodes[2]) continue;
      for (uint64_t j = j0; j < std::min(j0 + rows_at_once, nj - 1); ++j)
        data_.readValues(scalars[n], block, 0, (ni - 1) * (j + (nj - 1) * k) + box.i0, part.cells,
                         std::span(values).subspan(at + row * (j - j0), cells_end - box.i0));
    }
  }
}

std::unique_ptr<DataSource> openEnsight(const OpenGridOptions& options) {
  EnsightData data(options);
  if (data.structured()) return std::make_unique<EnsightGridSource>(std::move(data));
  return std::make_unique<EnsightMeshSource>(std::move(data));
}

}  // namespace curvisplat
