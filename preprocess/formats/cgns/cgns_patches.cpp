#include "preprocess/formats/cgns/cgns_patches.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// The axis of the faces that a GridLocation counts; 3: nodes, or faces of the axis along which the range is
/// flat.
size_t axisOf(const std::string& location) {
  if (location == "IFaceCenter") return 0;
  if (location == "JFaceCenter") return 1;
  if (location == "KFaceCenter") return 2;
  return 3;
}

}  // namespace

std::optional<GridBoundary> cgnsBoundary(const CgnsFile& file, const std::vector<CgnsNode>& details,
                                         const std::array<uint64_t, 3>& nodes) {
  std::string location = "Vertex";
  const CgnsNode* range = nullptr;
  for (const CgnsNode& detail : details) {
    if (detail.label == "GridLocation_t") location = file.text(detail);
    if (detail.label == "IndexRange_t" && (detail.name == "PointRange" || detail.name == "ElementRange"))
      range = &detail;
  }
  if (!range || file.shape(*range).count() != 6) return std::nullopt;
  const std::vector<double> ends = file.numbers(*range);
  const bool of_faces = location.ends_with("FaceCenter");
  size_t normal = axisOf(location);
  for (size_t axis = 0; axis < 3 && normal == 3; ++axis)
    if (ends[axis] == ends[axis + 3] && nodes[axis] > 1) normal = axis;
  if (normal == 3 || ends[normal] != ends[normal + 3]) return std::nullopt;
  GridBoundary boundary;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax(ends[axis], ends[axis + 3]);
    const double last = high + (of_faces && axis != normal ? 1 : 0);
    if (!(low >= 1 && last <= static_cast<double>(nodes[axis]))) return std::nullopt;
    boundary.first[axis] = static_cast<uint64_t>(low) - 1;
    boundary.last[axis] = static_cast<uint64_t>(last) - 1;
  }
  return boundary;
}

namespace {

/// The index from 0 that a number from 1 stands for. Throws Error if there is no such sample.
uint64_t indexOf(double number, uint64_t count) {
  if (!(number >= 1 && number <= static_cast<double>(count)) || number != std::floor(number))
    throw Error("a hole has the index {}; expected 1 to {}", numberText(number), count);
  return static_cast<uint64_t>(number) - 1;
}

}  // namespace

void CgnsHoles::addRange(const std::vector<double>& ends, const std::array<uint64_t, 3>& counts, Holes& to) {
  if (ends.size() != 6) throw Error("a hole's range has {} numbers; expected 6", ends.size());
  Hole hole;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax(ends[axis], ends[axis + 3]);
    hole.first[axis] = indexOf(low, counts[axis]);
    hole.last[axis] = indexOf(high, counts[axis]);
  }
  to.push_back(hole);
}

void CgnsHoles::addList(const std::vector<double>& points, const std::array<uint64_t, 3>& counts, Holes& to) {
  if (points.size() % 3 != 0) throw Error("a hole's list has {} numbers; expected triples", points.size());
  for (size_t n = 0; n < points.size(); n += 3) {
    std::array<uint64_t, 3> at{};
    for (size_t axis = 0; axis < 3; ++axis) at[axis] = indexOf(points[n + axis], counts[axis]);
    if (n > 0 && to.back().last == std::array<uint64_t, 3>{at[0] - 1, at[1], at[2]})
      to.back().last = at;
    else
      to.push_back({at, at});
  }
}

void CgnsHoles::add(const CgnsFile& file, const CgnsNode& holes, const std::array<uint64_t, 3>& nodes) {
  const std::vector<CgnsNode> children = file.children(holes);
  bool of_cells = false;
  for (const CgnsNode& child : children)
    if (child.label == "GridLocation_t") {
      const std::string location = file.text(child);
      of_cells = location == "CellCenter";
      if (!of_cells && location != "Vertex")
        throw Error("a hole's GridLocation is {}; expected Vertex or CellCenter", location);
    }
  std::array<uint64_t, 3> counts = nodes;
  for (uint64_t& count : counts) count -= of_cells ? 1 : 0;
  Holes found;
  for (const CgnsNode& child : children) {
    if (child.label == "IndexRange_t") addRange(file.numbers(child), counts, found);
    if (child.label == "IndexArray_t") addList(file.numbers(child), counts, found);
  }
  Holes& all = of_cells ? cells_ : nodes_;
  all.insert(all.end(), found.begin(), found.end());
}

template <typename Use>
void CgnsHoles::forEachIn(const Holes& holes, const WindowStrides& strides, const NodeBox& box,
                          const Use& use) {
  for (const Hole& hole : holes)
    for (uint64_t k = std::max(hole.first[2], box.k0); k < std::min(hole.last[2] + 1, box.k1); ++k)
      for (uint64_t j = std::max(hole.first[1], box.j0); j < std::min(hole.last[1] + 1, box.j1); ++j)
        for (uint64_t i = std::max(hole.first[0], box.i0); i < std::min(hole.last[0] + 1, box.i1); ++i)
          use(strides.at(i, j, k));
}

void CgnsHoles::blankNodes(const std::array<uint64_t, 3>& nodes, const NodeBox& box,
                           std::vector<uint8_t>& blank) const {
  const WindowStrides strides(box, nodes[0]);
  forEachIn(nodes_, strides, box, [&](size_t n) { blank[n] = 1; });
  if (cells_.empty()) return;
  // The cells around the box's nodes.
  const auto before = [](uint64_t n) { return n - std::min<uint64_t>(n, 1); };
  const NodeBox around{before(box.j0), box.j1,         before(box.k0),
                       box.k1,         before(box.i0), box.endOfRow(nodes[0])};
  const WindowStrides strides_around(around, nodes[0]);
  std::vector<uint8_t> hidden(strides_around.plane * (around.k1 - around.k0));
  forEachIn(cells_, strides_around, around, [&](size_t n) { hidden[n] = 1; });
  const auto allHidden = [&](const std::array<uint64_t, 3>& node) {
    std::array<uint64_t, 3> first = node, last = node;
    for (size_t axis = 0; axis < 3; ++axis) {
      first[axis] = before(first[axis]);
      last[axis] = std::min(last[axis], nodes[axis] - 2);
    }
    for (uint64_t k = first[2]; k <= last[2]; ++k)
      for (uint64_t j = first[1]; j <= last[1]; ++j)
        for (uint64_t i = first[0]; i <= last[0]; ++i)
          if (!hidden[strides_around.at(i, j, k)]) return false;
    return true;
  };
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = box.i0; i < around.i1; ++i, ++n)
        if (!blank[n] && allHidden({i, j, k})) blank[n] = 1;
}

void CgnsHoles::blankCells(const std::array<uint64_t, 3>& nodes, const NodeBox& box,
                           std::vector<float>& values) const {
  forEachIn(cells_, WindowStrides(box, nodes[0]), box,
            [&](size_t n) { values[n] = std::numeric_limits<float>::quiet_NaN(); });
}

}  // namespace curvisplat
