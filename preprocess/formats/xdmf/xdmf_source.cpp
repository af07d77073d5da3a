#include "preprocess/formats/xdmf/xdmf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr int kMagnitude = -1;
constexpr size_t kBufferNumbers = 64 << 10;
constexpr uint64_t kMaxNumbers = uint64_t{1} << 24;  // of cells that are read together

/// Calls use(tuple number, its components) for the tuples [first, first + count), a buffer at a time.
template <typename Use>
void forEachTuple(const XdmfValues& values, uint64_t components, uint64_t first, uint64_t count,
                  const Use& use) {
  static const PerThread<std::vector<double>> buffers;
  std::vector<double>& buffer = buffers.own();
  const uint64_t most = std::max<uint64_t>(1, kBufferNumbers / components);
  for (uint64_t done = 0; done < count; done += most) {
    const uint64_t tuples = std::min(most, count - done);
    buffer.resize(tuples * components);
    values.read((first + done) * components, buffer);
    for (uint64_t n = 0; n < tuples; ++n)
      use(done + n, std::span(buffer).subspan(n * components, components));
  }
}

template <typename Value>
Value pick(std::span<const double> tuple, int component) {
  if (component != kMagnitude) return convertedTo<Value>(tuple[static_cast<size_t>(component)]);
  double squares = 0;
  for (const double value : tuple) squares += value * value;
  return static_cast<Value>(std::sqrt(squares));
}

bool attributeComesBefore(const XdmfAttribute& a, const XdmfAttribute& b) {
  return std::tie(a.name, a.centring) < std::tie(b.name, b.centring);
}

/// Null if the grid has no such attribute. Its attributes are sorted.
const XdmfAttribute* attributeNamed(const XdmfGrid& grid, const XdmfScalar& scalar) {
  const auto before = [](const XdmfAttribute& attribute, const XdmfScalar& wanted) {
    return std::tie(attribute.name, attribute.centring) < std::tie(wanted.name, wanted.centring);
  };
  const auto found = std::lower_bound(grid.attributes.begin(), grid.attributes.end(), scalar, before);
  const bool same = found != grid.attributes.end() && found->name == scalar.name &&
                    found->centring == scalar.centring && found->components == scalar.components;
  return same ? &*found : nullptr;
}

/// The number of a point. Other numbers become the largest, which is refused.
uint64_t pointOf(double number) {
  return number >= 0 && number <= 0x1p53 ? static_cast<uint64_t>(number)
                                         : std::numeric_limits<uint64_t>::max();
}

/// Files, times, warnings and scalars. Sorts the attributes of each grid.
std::vector<XdmfScalar> describe(XdmfFile& file, GridDescription& description) {
  description.files = file.files;
  description.times = file.times;
  description.time_step = file.time_step;
  description.warnings = file.warnings;
  description.coordinate_bytes = 4;
  for (const XdmfGrid& grid : file.grids)
    for (const auto& places : grid.places)
      if (grid.kind == XdmfGrid::Kind::kUniform || (places && places->valueBytes() == 8))
        description.coordinate_bytes = 8;
  std::vector<XdmfScalar> attributes, scalars;
  std::vector<size_t> grids_with;  // [attribute]
  std::map<std::tuple<std::string, Centring, uint64_t>, size_t> known;
  for (XdmfGrid& grid : file.grids) {
    for (const XdmfAttribute& attribute : grid.attributes) {
      const auto [found, is_new] =
          known.try_emplace({attribute.name, attribute.centring, attribute.components}, attributes.size());
      if (is_new) {
        attributes.push_back({attribute.name, attribute.centring, attribute.components, 0});
        grids_with.push_back(0);
      }
      ++grids_with[found->second];
    }
    std::sort(grid.attributes.begin(), grid.attributes.end(), attributeComesBefore);
  }
  std::set<std::string> taken;
  for (size_t n = 0; n < attributes.size(); ++n) {
    const XdmfScalar& attribute = attributes[n];
    const size_t without = file.grids.size() - grids_with[n];
    if (without > 0)
      description.warnings.push_back(
          fmt::format("{} of {} grids have no attribute {}; they are not drawn with it", without,
                      file.grids.size(), attribute.name));
    const auto add = [&](const std::string& suffix, int component) {
      GridScalar scalar;
      scalar.centring = attribute.centring;
      scalar.name = attribute.name + suffix;
      if (taken.count(scalar.name) > 0 && scalar.centring == Centring::kCell)
        scalar.name = attribute.name + ":cell" + suffix;
      if (taken.count(scalar.name) > 0) scalar.name += fmt::format(":{}", scalars.size() + 1);
      taken.insert(scalar.name);
      description.scalars.push_back(std::move(scalar));
      scalars.push_back({attribute.name, attribute.centring, attribute.components, component});
    };
    if (attribute.components == 1) {
      add("", 0);
      continue;
    }
    const bool vector = attribute.components <= 3;
    if (vector) add(":mag", kMagnitude);
    for (uint64_t c = 0; c < attribute.components; ++c)
      add(vector ? fmt::format(":{}", "xyz"[c]) : fmt::format(":{}", c), static_cast<int>(c));
  }
  return scalars;
}

}  // namespace

std::unique_ptr<DataSource> openXdmf(const OpenGridOptions& options) {
  XdmfFile file = readXdmf(options);
  if (file.grids.front().cells.count > 0) return std::make_unique<XdmfMeshSource>(std::move(file));
  return std::make_unique<XdmfSource>(std::move(file));
}

XdmfSource::XdmfSource(XdmfFile file) : file_(std::move(file)), scalars_(describe(file_, description_)) {
  for (const XdmfGrid& grid : file_.grids)
    description_.blocks.push_back({grid.name, grid.nodes[0], grid.nodes[1], grid.nodes[2], false});
  description_.format = fmt::format("XDMF, {}", countText(file_.grids.size(), "structured grid"));
}

XdmfMeshSource::XdmfMeshSource(XdmfFile file)
    : file_(std::move(file)), scalars_(describe(file_, description_)) {
  for (const XdmfGrid& grid : file_.grids)
    description_.pieces.push_back({grid.name, file_.files.front(), grid.nodes[0], grid.cells.count});
  description_.format = fmt::format("XDMF, {}", countText(file_.grids.size(), "unstructured grid"));
}

bool XdmfMeshSource::hasCurvedCells() const {
  return std::any_of(file_.grids.begin(), file_.grids.end(),
                     [](const XdmfGrid& grid) { return grid.cells.curved; });
}

void XdmfMeshSource::readScalars(const XdmfGrid& grid, uint64_t first, uint64_t count,
                                 std::span<const uint32_t> scalars,
                                 std::vector<std::vector<float>>& out) const {
  out.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    const XdmfScalar& scalar = scalars_.at(scalars[n]);
    out[n].assign(count, std::numeric_limits<float>::quiet_NaN());
    if (const XdmfAttribute* const attribute = attributeNamed(grid, scalar))
      forEachTuple(*attribute->values, scalar.components, first, count,
                   [&](uint64_t tuple, std::span<const double> values) {
                     out[n][tuple] = pick<float>(values, scalar.component);
                   });
  }
}

void XdmfMeshSource::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                                std::span<const uint32_t> scalars, MeshPoints& out) const {
  const XdmfGrid& grid = file_.grids.at(piece);
  const std::array<std::vector<double>*, 3> axes{&out.x, &out.y, &out.z};
  for (size_t axis = 0; axis < 3; ++axis) {
    axes[axis]->resize(count);
    if (grid.kind == XdmfGrid::Kind::kSeparate) grid.places[axis]->read(first, *axes[axis]);
  }
  if (grid.kind == XdmfGrid::Kind::kPoints)
    forEachTuple(*grid.places[0], 3, first, count, [&](uint64_t n, std::span<const double> place) {
      for (size_t axis = 0; axis < 3; ++axis) (*axes[axis])[n] = place[axis];
    });
  out.hidden.assign(count, 0);
  readScalars(grid, first, count, scalars, out.scalars);
}

void XdmfMeshSource::readCells(uint32_t piece, uint64_t first, uint64_t count,
                               std::span<const uint32_t> scalars, MeshCells& out) const {
  const XdmfGrid& grid = file_.grids.at(piece);
  const uint64_t each = grid.cells.nodes_each;
  out.clear();
  if (each == 0) {
    readMixed(grid, first, count, out);
  } else {
    std::vector<double> numbers(count * each);
    if (count > 0) grid.cells.connectivity->read(first * each, numbers);
    std::vector<uint64_t> points(each);
    for (uint64_t n = 0; n < count; ++n) {
      for (uint64_t node = 0; node < each; ++node) points[node] = pointOf(numbers[n * each + node]);
      appendCurved(grid.cells.shape, points, out);
    }
  }
  readScalars(grid, first, count, scalars, out.scalars);
}

void XdmfMeshSource::readMixed(const XdmfGrid& grid, uint64_t first, uint64_t count, MeshCells& out) const {
  if (count == 0) return;
  std::vector<uint64_t> begins(count + 1);
  grid.cells.begins.read(first, std::span(begins));
  if (begins.back() - begins.front() > kMaxNumbers)
    throw Error("{}: {}: cells {} to {} have {} numbers; expected at most {}", file_.files.front(), grid.name,
                first, first + count - 1, begins.back() - begins.front(), kMaxNumbers);
  std::vector<double> numbers(begins.back() - begins.front());
  grid.cells.connectivity->read(begins.front(), numbers);
  std::vector<uint64_t> words;
  for (uint64_t n = 0; n < count; ++n) {
    words.clear();
    for (uint64_t at = begins[n]; at < begins[n + 1]; ++at)
      words.push_back(pointOf(numbers[at - begins.front()]));
    const bool has_type = grid.cells.shape == CellKind::kNone;  // else all are polyhedra
    const CellKind shape = has_type ? xdmfCellType(words[0])->shape : grid.cells.shape;
    const std::span<const uint64_t> rest = std::span<const uint64_t>(words).subspan(has_type ? 1 : 0);
    if (shape != CellKind::kPolyhedron)
      appendCurved(shape, shape == CellKind::kNone ? std::span<const uint64_t>() : rest, out);
    else if (rest.empty() || !out.appendPolyhedron(rest[0], rest.subspan(1)))
      throw Error("{}: {}: polyhedron {} has faces that do not add up; the file is damaged",
                  file_.files.front(), grid.name, first + n);
  }
}

void XdmfSource::readPlaces(const XdmfGrid& grid, const NodeBox& box, NodeArrays& out) const {
  std::vector<double>* const axes[] = {&out.x, &out.y, &out.z};
  const uint64_t ni = grid.nodes[0], row = box.rowNodes(ni), rows = box.j1 - box.j0;
  // Whole rows of a plane follow one another.
  const uint64_t rows_at_once = box.hasWholeRows(ni) ? rows : 1, count = row * rows_at_once;
  std::array<std::vector<double>, 3> along;
  if (grid.kind == XdmfGrid::Kind::kAxes)
    for (size_t axis = 0; axis < 3; ++axis) {
      along[axis].resize(grid.nodes[axis]);
      grid.places[axis]->read(0, along[axis]);
    }
  for (uint64_t n_row = 0; n_row < rows * (box.k1 - box.k0); n_row += rows_at_once) {
    const uint64_t j0 = box.j0 + n_row % rows, k = box.k0 + n_row / rows;
    const uint64_t stored = ni * (j0 + grid.nodes[1] * k) + box.i0, at = row * n_row;
    if (grid.kind == XdmfGrid::Kind::kPoints) {
      forEachTuple(*grid.places[0], 3, stored, count, [&](uint64_t n, std::span<const double> place) {
        for (size_t axis = 0; axis < 3; ++axis) (*axes[axis])[at + n] = place[axis];
      });
      continue;
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      const std::span<double> to = std::span(*axes[axis]).subspan(at, count);
      if (grid.kind == XdmfGrid::Kind::kSeparate) {
        grid.places[axis]->read(stored, to);
        continue;
      }
      for (uint64_t n = 0; n < count; ++n) {
        const uint64_t index[] = {box.i0 + n % row, j0 + n / row, k};
        to[n] = grid.kind == XdmfGrid::Kind::kAxes
                    ? along[axis][index[axis]]
                    : grid.origin[axis] + grid.spacing[axis] * static_cast<double>(index[axis]);
      }
    }
  }
}

void XdmfSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const {
  const XdmfGrid& grid = file_.grids.at(block);
  const uint64_t ni = grid.nodes[0], row = box.rowNodes(ni), rows = box.j1 - box.j0;
  const size_t nodes = row * rows * (box.k1 - box.k0);
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  readPlaces(grid, box, out);
  out.blank.assign(nodes, 0);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    std::vector<float>& to = out.scalars[n];
    to.assign(nodes, std::numeric_limits<float>::quiet_NaN());
    const XdmfScalar& scalar = scalars_.at(scalars[n]);
    const XdmfAttribute* const attribute = attributeNamed(grid, scalar);
    if (!attribute) continue;
    const uint64_t less = scalar.centring == Centring::kCell ? 1 : 0;
    const uint64_t along = ni - less, nj = grid.nodes[1] - less;
    const uint64_t j1 = std::min(box.j1, nj), k1 = std::min(box.k1, grid.nodes[2] - less);
    if (box.j0 >= j1) continue;
    const uint64_t end = std::min(box.endOfRow(ni), along);
    if (box.i0 >= end) continue;
    const uint64_t part = end - box.i0;
    // Whole rows of a plane follow one another.
    const uint64_t rows_at_once = part == along ? j1 - box.j0 : 1;
    for (uint64_t k = box.k0; k < k1; ++k)
      for (uint64_t j = box.j0; j < j1; j += rows_at_once)
        forEachTuple(*attribute->values, scalar.components, along * (j + nj * k) + box.i0,
                     part * rows_at_once, [&](uint64_t tuple, std::span<const double> values) {
                       const uint64_t of_row = j - box.j0 + tuple / part;
                       to[row * (of_row + rows * (k - box.k0)) + tuple % part] =
                           pick<float>(values, scalar.component);
                     });
  }
}

}  // namespace curvisplat
