#include "preprocess/formats/xdmf/xdmf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "preprocess/formats/common/block_source.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/xdmf/xdmf_file.h"
#include "preprocess/mesh/curved_cells.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

struct XdmfScalar {
  std::string name;  // of its attribute
  Centring centring = Centring::kNode;
  uint64_t components = 1;
  int component = 0;  // or kMagnitude
};

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

/// Subtracts the number of the first point from the points of a cell. A polyhedron's number of faces, and of the points of each face,
/// stand among them.
void countFromZero(std::span<uint64_t> words, bool polyhedron, double first_point) {
  uint64_t left = polyhedron ? 0 : words.size();  // points before the next count
  for (size_t n = polyhedron ? 1 : 0; n < words.size(); ++n) {
    if (left == 0) {
      left = words[n];
      continue;
    }
    words[n] = pointNumber(static_cast<double>(words[n]), first_point);
    --left;
  }
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
  ScalarList list(description);
  for (size_t n = 0; n < attributes.size(); ++n) {
    const XdmfScalar& attribute = attributes[n];
    const size_t without = file.grids.size() - grids_with[n];
    if (without > 0)
      description.warnings.push_back(
          fmt::format("{} of {} grids have no attribute {}; they are not drawn with it", without,
                      file.grids.size(), attribute.name));
    forEachComponent(attribute.components, [&](const std::string& suffix, int component) {
      list.add(namesOfComponent(attribute.name, suffix, attribute.centring, scalars.size() + 1),
               attribute.centring);
      scalars.push_back({attribute.name, attribute.centring, attribute.components, component});
    });
  }
  return scalars;
}

/// The numbers must be there: of nodes that are not along the axes.
void readNodes(const XdmfGrid& grid, uint64_t first, uint64_t count, const Places& to) {
  if (grid.kind == XdmfGrid::Kind::kPoints)
    return forEachTuple(*grid.places[0], 3, first, count, [&](uint64_t n, std::span<const double> place) {
      for (size_t axis = 0; axis < 3; ++axis) to.axes[axis][n] = place[axis];
    });
  for (size_t axis = 0; axis < 3; ++axis) grid.places[axis]->read(first, to.span(axis, count));
}

void readAttribute(const XdmfAttribute& attribute, const XdmfScalar& scalar, uint64_t first,
                   std::span<float> to) {
  forEachTuple(*attribute.values, scalar.components, first, to.size(),
               [&](uint64_t tuple, std::span<const double> values) {
                 to[tuple] = pick<float>(values, scalar.component);
               });
}

class XdmfBlocks final : public BlockSource {
 public:
  explicit XdmfBlocks(XdmfFile file) : file_(std::move(file)), scalars_(describe(file_, description_)) {
    for (const XdmfGrid& grid : file_.grids)
      description_.blocks.push_back({grid.name, grid.nodes[0], grid.nodes[1], grid.nodes[2], false});
    description_.format = fmt::format("XDMF, {}", countText(file_.grids.size(), "structured grid"));
  }

 private:
  BlockArray<Places> nodesOf(uint32_t block) const override {
    const XdmfGrid& grid = file_.grids[block];
    if (grid.kind == XdmfGrid::Kind::kUniform)
      return placesAlongAxes([&grid](size_t axis, uint64_t index) {
        return grid.origin[axis] + grid.spacing[axis] * static_cast<double>(index);
      });
    if (grid.kind == XdmfGrid::Kind::kAxes) {
      std::array<std::vector<double>, 3> along;
      for (size_t axis = 0; axis < 3; ++axis) {
        along[axis].resize(grid.nodes[axis]);
        grid.places[axis]->read(0, along[axis]);
      }
      return placesAlongAxes(
          [along = std::move(along)](size_t axis, uint64_t index) { return along[axis][index]; });
    }
    return [&grid](uint64_t first, uint64_t count, const Places& to) { readNodes(grid, first, count, to); };
  }
  BlockArray<float*> valuesOf(uint32_t block, uint32_t number) const override {
    const XdmfScalar& scalar = scalars_.at(number);
    const XdmfAttribute* const attribute = attributeNamed(file_.grids[block], scalar);
    if (!attribute) return {};
    return [attribute, &scalar](uint64_t first, uint64_t count, float* to) {
      readAttribute(*attribute, scalar, first, std::span(to, count));
    };
  }

  XdmfFile file_;
  std::vector<XdmfScalar> scalars_;
};

void appendMixed(const std::string& file, const XdmfGrid& grid, uint64_t first, uint64_t count,
                 MeshCells& out) {
  std::vector<uint64_t> begins(count + 1);
  grid.cells.begins.read(first, std::span(begins));
  if (begins.back() - begins.front() > kMaxNumbers)
    throw Error("{}: {}: cells {} to {} have {} numbers; expected at most {}", file, grid.name, first,
                first + count - 1, begins.back() - begins.front(), kMaxNumbers);
  std::vector<double> numbers(begins.back() - begins.front());
  grid.cells.connectivity->read(begins.front(), numbers);
  std::vector<uint64_t> words;
  for (uint64_t n = 0; n < count; ++n) {
    words.clear();
    for (uint64_t at = begins[n]; at < begins[n + 1]; ++at)
      words.push_back(pointNumber(numbers[at - begins.front()]));
    const bool has_type = grid.cells.shape == CellKind::kNone;  // else all are polyhedra
    const CellKind shape = has_type ? xdmfCellType(words[0])->shape : grid.cells.shape;
    const std::span<uint64_t> rest = std::span(words).subspan(has_type ? 1 : 0);
    countFromZero(rest, shape == CellKind::kPolyhedron, grid.cells.first_point);
    if (shape != CellKind::kPolyhedron)
      appendCurved(shape, shape == CellKind::kNone ? std::span<const uint64_t>() : rest, out);
    else if (rest.empty() || !out.appendPolyhedron(rest[0], rest.subspan(1)))
      throw Error("{}: {}: polyhedron {} has faces that do not add up; the file is damaged", file, grid.name,
                  first + n);
  }
}

class XdmfMesh final : public ElementSource {
 public:
  explicit XdmfMesh(XdmfFile file) : file_(std::move(file)), scalars_(describe(file_, description_)) {
    for (const XdmfGrid& grid : file_.grids) {
      description_.pieces.push_back({grid.name, file_.files.front(), grid.nodes[0], grid.cells.count});
      has_curved_cells_ |= grid.cells.curved;
    }
    description_.format = fmt::format("XDMF, {}", countText(file_.grids.size(), "unstructured grid"));
  }

 private:
  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override {
    readNodes(file_.grids.at(piece), first, count, to);
  }
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override;
  void readValues(uint32_t piece, uint32_t number, uint64_t first, std::span<float> to) const override {
    const XdmfScalar& scalar = scalars_.at(number);
    if (const XdmfAttribute* const attribute = attributeNamed(file_.grids.at(piece), scalar))
      readAttribute(*attribute, scalar, first, to);
  }

  XdmfFile file_;
  std::vector<XdmfScalar> scalars_;
};

void XdmfMesh::appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const {
  const XdmfGrid& grid = file_.grids.at(piece);
  const uint64_t each = grid.cells.nodes_each;
  if (count == 0) return;
  if (each == 0) return appendMixed(file_.files.front(), grid, first, count, out);
  std::vector<uint64_t> points(each);
  if (const uint64_t own = grid.cells.own_points; own > 0) {
    points.resize(own);
    for (uint64_t cell = first; cell < first + count; ++cell) {
      std::iota(points.begin(), points.end(), cell * own);
      appendCurved(grid.cells.shape, points, out);
    }
    return;
  }
  std::vector<double> numbers(count * each);
  grid.cells.connectivity->read(first * each, numbers);
  for (uint64_t n = 0; n < count; ++n) {
    for (uint64_t node = 0; node < each; ++node)
      points[node] = pointNumber(numbers[n * each + node], grid.cells.first_point);
    appendCurved(grid.cells.shape, points, out);
  }
}

}  // namespace

std::unique_ptr<DataSource> openXdmf(const OpenGridOptions& options) {
  XdmfFile file = readXdmf(options);
  if (file.grids.front().cells.count > 0) return std::make_unique<XdmfMesh>(std::move(file));
  return std::make_unique<XdmfBlocks>(std::move(file));
}

}  // namespace curvisplat
