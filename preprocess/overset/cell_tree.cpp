#include "preprocess/overset/cell_tree.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/memory.h"

namespace curvisplat {

std::array<CellTree::Range, 2> CellTree::Range::halves() const {
  size_t axis = 0;
  for (const size_t other : {1u, 2u})
    if (end[other] - begin[other] > end[axis] - begin[axis]) axis = other;
  std::array<Range, 2> halves{*this, *this};
  halves[0].end[axis] = halves[1].begin[axis] = begin[axis] + (end[axis] - begin[axis]) / 2;
  return halves;
}

CellTree::CellTree(const GridBlock& block, LoadedSlab loaded, std::vector<uint8_t> fringe, Centring centring)
    : loaded_(std::move(loaded)),
      fringe_(std::move(fringe)),
      row_stride_(loaded_.slab.window.rowNodes(block.ni)),
      plane_stride_(row_stride_ * (loaded_.slab.window.j1 - loaded_.slab.window.j0)) {
  const NodeBox &box = loaded_.slab.box, &window = loaded_.slab.window;
  const auto along = [](uint64_t from, uint64_t to, uint64_t nodes) {
    return std::pair{static_cast<uint32_t>(from),
                     static_cast<uint32_t>(std::max(from, std::min(to, nodes - 1)))};
  };
  std::tie(all_.begin[0], all_.end[0]) =
      along(box.i0 - window.i0, box.endOfRow(block.ni) - window.i0, row_stride_);
  std::tie(all_.begin[1], all_.end[1]) = along(box.j0 - window.j0, box.j1 - window.j0, window.j1 - window.j0);
  std::tie(all_.begin[2], all_.end[2]) = along(box.k0 - window.k0, box.k1 - window.k0, window.k1 - window.k0);

  sizes_.assign(loaded_.nodes.x.size(), kNoCell);
  const std::vector<uint8_t>& blank = loaded_.nodes.blank;
  const uint8_t corner_marks = centring == Centring::kCell ? uint8_t{kNoNode} : uint8_t{0xff};
  parallelFor(all_.begin[2], all_.end[2], [&](uint32_t k) {
    for (uint32_t j = all_.begin[1]; j < all_.end[1]; ++j)
      for (uint32_t i = all_.begin[0]; i < all_.end[0]; ++i) {
        const size_t cell = elementOf(i, j, k);
        if (blank[cell] != 0 || (cornerMarks(blank.data(), cell, row_stride_, plane_stride_) & corner_marks))
          continue;
        sizes_[cell] = cellSize(cornersOf(cell));
      }
  });
  freeMemory(loaded_.nodes.blank);
  freeMemory(loaded_.nodes.scalars);

  if (all_.cells() == 0) return;
  for (uint32_t k = all_.begin[2]; k < all_.end[2]; ++k)
    for (uint32_t j = all_.begin[1]; j < all_.end[1]; ++j)
      for (uint32_t i = all_.begin[0]; i < all_.end[0]; ++i)
        if (const size_t cell = elementOf(i, j, k); sizes_[cell] != kNoCell)
          for (const glm::dvec3& corner : cornersOf(cell)) box_.add(corner);
  if (box_.isEmpty()) return;
  origin_ = box_.lower;
  build(all_);
}

CellSize CellTree::smallest() const {
  return *std::min_element(sizes_.begin(), sizes_.end());
}

bool CellTree::isAllFringe() const {
  return !fringe_.empty() &&
         std::all_of(fringe_.begin(), fringe_.end(), [](uint8_t node) { return node != 0; });
}

uint64_t CellTree::bytes() const {
  return loaded_.nodes.x.size() * (3 * sizeof(double) + sizeof(CellSize)) + fringe_.size() +
         nodes_.size() * sizeof(Node);
}

uint32_t CellTree::build(const Range& range) {
  const auto number = static_cast<uint32_t>(nodes_.size());
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  nodes_.push_back({{kInfinite, kInfinite, kInfinite}, {-kInfinite, -kInfinite, -kInfinite}, 0});
  if (range.cells() > kLeafCells) {
    const auto halves = range.halves();
    const uint32_t first = build(halves[0]), second = build(halves[1]);
    Node& node = nodes_[number];
    for (const uint32_t child : {first, second})
      for (size_t axis = 0; axis < 3; ++axis) {
        node.lower[axis] = std::min(node.lower[axis], nodes_[child].lower[axis]);
        node.upper[axis] = std::max(node.upper[axis], nodes_[child].upper[axis]);
      }
    node.second = second;
    return number;
  }
  BoundingBox box;
  for (uint32_t k = range.begin[2]; k < range.end[2]; ++k)
    for (uint32_t j = range.begin[1]; j < range.end[1]; ++j)
      for (uint32_t i = range.begin[0]; i < range.end[0]; ++i)
        if (const size_t cell = elementOf(i, j, k); sizes_[cell] != kNoCell)
          for (const glm::dvec3& corner : cornersOf(cell)) box.add(corner);
  if (box.isEmpty()) return number;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<size_t>(axis);
    const auto lower = static_cast<float>(box.lower[axis] - origin_[axis]);
    const auto upper = static_cast<float>(box.upper[axis] - origin_[axis]);
    nodes_[number].lower[a] = std::nextafter(lower, -kInfinite);
    nodes_[number].upper[a] = std::nextafter(upper, kInfinite);
  }
  return number;
}

std::optional<CellTree::Holder> CellTree::in(size_t cell, const glm::dvec3& point) const {
  if (sizes_[cell] == kNoCell) return std::nullopt;
  const std::array<glm::dvec3, 8> corners = cornersOf(cell);
  BoundingBox box;
  for (const glm::dvec3& corner : corners) box.add(corner);
  if (!box.holds(point)) return std::nullopt;
  const std::optional<glm::dvec3> u = locateInHexahedron(corners, point);
  constexpr double kMax = 1 + kOnFace;
  if (!u || std::abs(u->x) > kMax || std::abs(u->y) > kMax || std::abs(u->z) > kMax) return std::nullopt;
  return Holder{cell, *u};
}

std::optional<CellTree::Holder> CellTree::near(const glm::dvec3& point, const Hint& hint) const {
  if (!hint.cell) return std::nullopt;
  constexpr int kMaxSteps = 3;
  constexpr double kFar = 7;  // three cells
  std::array<uint32_t, 3> place{static_cast<uint32_t>(*hint.cell % row_stride_),
                                static_cast<uint32_t>(*hint.cell % plane_stride_ / row_stride_),
                                static_cast<uint32_t>(*hint.cell / plane_stride_)};
  for (int step = 0; step < kMaxSteps; ++step) {
    const size_t cell = elementOf(place[0], place[1], place[2]);
    if (sizes_[cell] == kNoCell) return std::nullopt;
    const std::optional<glm::dvec3> u = locateInHexahedron(cornersOf(cell), point);
    if (!u) return std::nullopt;
    const glm::dvec3 away = glm::abs(*u);
    const double farthest = std::max({away.x, away.y, away.z});
    if (farthest < 1 - kOnFace) return Holder{cell, *u};
    if (farthest <= 1 + kOnFace || farthest > kFar) return std::nullopt;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<size_t>(axis);
      const int64_t to = int64_t{place[a]} + static_cast<int64_t>(std::floor(((*u)[axis] + 1) / 2));
      if (to < all_.begin[a] || to >= all_.end[a]) return std::nullopt;
      place[a] = static_cast<uint32_t>(to);
    }
  }
  return std::nullopt;
}

bool CellTree::meets(const BoundingBox& box) const {
  if (nodes_.empty() || !box_.meets(box)) return false;
  const glm::dvec3 lower = box.lower - origin_, upper = box.upper - origin_;
  std::array<Visited, 64> stack;
  size_t depth = 0;
  stack[depth++] = {0, all_};
  while (depth > 0) {
    const Visited at = stack[--depth];
    const Node& node = nodes_[at.node];
    bool apart = false;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<size_t>(axis);
      apart |= !(node.lower[a] <= upper[axis] && lower[axis] <= node.upper[a]);
    }
    if (apart) continue;
    if (node.second == 0) return true;
    const auto halves = at.range.halves();
    stack[depth++] = {node.second, halves[1]};
    stack[depth++] = {at.node + 1, halves[0]};
  }
  return false;
}

}  // namespace curvisplat
