#include "preprocess/formats/common/block_source.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "preprocess/grid/slabs.h"

namespace curvisplat {
namespace {

constexpr uint64_t kBufferValues = 1 << 16;

/// Copies rows that follow one another to rows of `box`.
void copyRows(std::span<const float> from, const ArrayBox& box, float* to) {
  for (size_t n = 0; n < from.size(); n += box.count[0], to += box.memory[0])
    std::copy_n(from.data() + n, box.count[0], to);
}

}  // namespace

ArrayBox partWithSamples(const GridBlock& block, const NodeBox& box, Centring centring) {
  const uint64_t less = centring == Centring::kCell ? 1 : 0;
  const auto count = [less](uint64_t begin, uint64_t end, uint64_t nodes) {
    end = std::min(end, nodes - less);
    return end - std::min(begin, end);
  };
  return {{box.i0, box.j0, box.k0},
          {count(box.i0, box.i1, block.ni), count(box.j0, box.j1, block.nj), count(box.k0, box.k1, block.nk)},
          {box.rowNodes(block.ni), box.j1 - box.j0},
          {block.ni - less, block.nj - less}};
}

template <typename To>
void BlockArray<To>::read(const ArrayBox& box, const To& to) const {
  if (box_) return box_(box, to);
  const std::array<uint64_t, 2>& along = along_[0] > 0 ? along_ : box.whole;
  const bool whole = box.count[0] == along[0], dense = box.count[0] == box.memory[0];
  uint64_t rows = whole ? box.count[1] : 1;
  std::vector<float> buffer;  // of whole rows that do not follow one another in memory
  if (whole && !dense) rows = std::clamp<uint64_t>(kBufferValues / box.count[0], 1, rows);
  for (uint64_t k = 0; k < box.count[2]; ++k)
    for (uint64_t j = 0; j < box.count[1]; j += rows) {
      const uint64_t count = box.count[0] * std::min(rows, box.count[1] - j);
      const uint64_t first = along[0] * (box.first[1] + j + along[1] * (box.first[2] + k)) + box.first[0];
      const To place = to + box.memory[0] * (j + box.memory[1] * k);
      if constexpr (std::is_same_v<To, float*>)
        if (rows > 1 && !dense) {
          buffer.resize(count);
          run_(first, count, buffer.data());
          copyRows(buffer, box, place);
          continue;
        }
      run_(first, count, place);
    }
}

template class BlockArray<Places>;
template class BlockArray<float*>;

BlockArray<Places> placesAlongAxes(std::function<double(size_t axis, uint64_t index)> place) {
  return [place = std::move(place)](const ArrayBox& box, const Places& to) {
    for (size_t axis = 0; axis < 3; ++axis) {
      std::vector<double> along(box.count[axis]);
      for (uint64_t n = 0; n < along.size(); ++n) along[n] = place(axis, box.first[axis] + n);
      std::array<uint64_t, 3> at;
      double* next = to.axes[axis];
      for (at[2] = 0; at[2] < box.count[2]; ++at[2])
        for (at[1] = 0; at[1] < box.count[1]; ++at[1])
          for (at[0] = 0; at[0] < box.count[0]; ++at[0]) *next++ = along[at[axis]];
    }
  };
}

BlockArray<float*> magnitudeOf(std::vector<BlockArray<float*>> components) {
  return [components = std::move(components)](const ArrayBox& box, float* to) {
    const uint64_t rows = std::clamp<uint64_t>(kBufferValues / box.count[0], 1, box.count[1]);
    std::vector<float> values;
    ArrayBox part = box;
    part.count[2] = 1;
    for (uint64_t k = 0; k < box.count[2]; ++k)
      for (uint64_t j = 0; j < box.count[1]; j += rows) {
        part.first = {box.first[0], box.first[1] + j, box.first[2] + k};
        part.count[1] = std::min(rows, box.count[1] - j);
        part.memory = {part.count[0], part.count[1]};
        values.resize(part.count[0] * part.count[1]);
        readMagnitude(components.size(), values,
                      [&](size_t c, std::span<float> one) { components[c].read(part, one.data()); });
        copyRows(values, box, to + box.memory[0] * (j + box.memory[1] * k));
      }
  };
}

/// Calls use(number of the node in the box, its iblank), a plane at a time.
template <typename Use>
void BlockSource::forEachIblank(uint32_t block, const NodeBox& box, const Use& use) const {
  const GridBlock& shape = description_.blocks[block];
  if (!shape.has_blanking) return;
  const BlockArray<float*> iblank = iblankOf(block);
  if (!iblank) return;
  std::vector<float> plane(static_cast<size_t>(box.rowNodes(shape.ni) * (box.j1 - box.j0)));
  NodeBox part = box;
  size_t node = 0;
  for (part.k0 = box.k0; part.k0 < box.k1; ++part.k0) {
    part.k1 = part.k0 + 1;
    iblank.read(partWithSamples(shape, part, Centring::kNode), plane.data());
    for (const float value : plane) use(node++, value);
  }
}

void BlockSource::read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                       NodeArrays& out) const {
  const GridBlock& shape = description_.blocks.at(block);
  const auto nodes = static_cast<size_t>(box.rowNodes(shape.ni) * rowsOf(box));
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  const ArrayBox all = partWithSamples(shape, box, Centring::kNode);
  if (!all.empty()) nodesOf(block).read(all, {{out.x.data(), out.y.data(), out.z.data()}});
  out.blank.assign(nodes, 0);
  forEachIblank(block, box, [&](size_t n, float value) { out.blank[n] = value == 0; });
  blankNodes(block, box, out.blank);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    const Centring centring = description_.scalars.at(scalars[n]).centring;
    const ArrayBox part = partWithSamples(shape, box, centring);
    out.scalars[n].assign(nodes, std::numeric_limits<float>::quiet_NaN());
    if (part.empty()) continue;
    if (const BlockArray<float*> values = valuesOf(block, scalars[n]))
      values.read(part, out.scalars[n].data());
    if (centring == Centring::kCell) blankCells(block, box, out.scalars[n]);
  }
}

bool BlockSource::readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const {
  const GridBlock& shape = description_.blocks.at(block);
  if (!negative_is_fringe_ || !shape.has_blanking) return false;
  out.assign(static_cast<size_t>(box.rowNodes(shape.ni) * rowsOf(box)), 0);
  forEachIblank(block, box, [&](size_t n, float value) { out[n] = value < 0; });
  return true;
}

}  // namespace curvisplat
