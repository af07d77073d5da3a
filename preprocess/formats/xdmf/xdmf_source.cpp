#include "preprocess/formats/xdmf/xdmf_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace curvisplat {
namespace {

constexpr int kMagnitude = -1;
constexpr size_t kBufferNumbers = 64 << 10;

/// Calls use(tuple number, its components) for the tuples [first, first + count), a buffer at a time.
template <typename Use>
void forEachTuple(const XdmfValues& values, uint64_t components, uint64_t first, uint64_t count,
                  const Use& use) {
  thread_local std::vector<double> buffer;
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

const XdmfAttribute* attributeNamed(const XdmfGrid& grid, const std::string& name, Centring centring,
                                    uint64_t components) {
  for (const XdmfAttribute& attribute : grid.attributes)
    if (attribute.name == name && attribute.centring == centring && attribute.components == components)
      return &attribute;
  return nullptr;
}

}  // namespace

XdmfSource::XdmfSource(const OpenGridOptions& options) : file_(readXdmf(options)) {
  description_.files = file_.files;
  description_.times = file_.times;
  description_.time_step = file_.time_step;
  description_.warnings = file_.warnings;
  description_.coordinate_bytes = 4;
  for (const XdmfGrid& grid : file_.grids) {
    description_.blocks.push_back({grid.name, grid.nodes[0], grid.nodes[1], grid.nodes[2], false});
    for (const auto& places : grid.places)
      if (grid.kind == XdmfGrid::Kind::kUniform || (places && places->valueBytes() == 8))
        description_.coordinate_bytes = 8;
  }
  const size_t grids = file_.grids.size();
  description_.format = fmt::format("XDMF, {} structured grid{}", grids, grids == 1 ? "" : "s");
  addScalars();
}

void XdmfSource::addScalars() {
  std::vector<Scalar> attributes;
  for (const XdmfGrid& grid : file_.grids)
    for (const XdmfAttribute& attribute : grid.attributes) {
      const auto same = [&](const Scalar& other) {
        return other.name == attribute.name && other.centring == attribute.centring &&
               other.components == attribute.components;
      };
      if (std::none_of(attributes.begin(), attributes.end(), same))
        attributes.push_back({attribute.name, attribute.centring, attribute.components, 0});
    }
  for (const Scalar& attribute : attributes) {
    const auto lacks = [&](const XdmfGrid& grid) {
      return !attributeNamed(grid, attribute.name, attribute.centring, attribute.components);
    };
    const auto without = std::count_if(file_.grids.begin(), file_.grids.end(), lacks);
    if (without > 0)
      description_.warnings.push_back(
          fmt::format("{} of {} grids have no attribute {}; they are not drawn with it", without,
                      file_.grids.size(), attribute.name));
    const auto add = [&](const std::string& suffix, int component) {
      GridScalar scalar;
      scalar.centring = attribute.centring;
      scalar.name = attribute.name + suffix;
      const auto taken = [&](const GridScalar& other) { return other.name == scalar.name; };
      const std::vector<GridScalar>& known = description_.scalars;
      if (std::any_of(known.begin(), known.end(), taken) && scalar.centring == Centring::kCell)
        scalar.name = attribute.name + ":cell" + suffix;
      if (std::any_of(known.begin(), known.end(), taken))
        scalar.name += fmt::format(":{}", scalars_.size() + 1);
      description_.scalars.push_back(std::move(scalar));
      scalars_.push_back({attribute.name, attribute.centring, attribute.components, component});
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
    const Scalar& scalar = scalars_.at(scalars[n]);
    const XdmfAttribute* const attribute =
        attributeNamed(grid, scalar.name, scalar.centring, scalar.components);
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
