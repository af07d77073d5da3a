#include "preprocess/survey/joined_axes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <utility>

#include "preprocess/grid/slabs.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxEdges = 2'000'000;  // that are kept, of 16 bytes
constexpr double kResolution = 1 << 20;    // of the grid's size

/// Mixes the bits of a number (the finaliser of SplitMix64).
uint64_t mixed(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
  return x ^ (x >> 31);
}

/// Calls `take` with the nodes of each outer face of the block and their box, `depth` planes thick where the block is.
template <typename Take>
void forEachFace(const GridSource& source, uint32_t number, const Take& take, uint64_t depth = 1) {
  const GridBlock& block = source.description().blocks[number];
  const std::array<uint64_t, 3> counts{block.ni, block.nj, block.nk};
  NodeArrays nodes;
  for (size_t axis = 0; axis < 3; ++axis)
    for (const uint64_t plane : {uint64_t{0}, counts[axis] - 1}) {
      if (plane == 0 || counts[axis] > 1) {
        std::array<uint64_t, 3> first{}, end = counts;
        const uint64_t inner = std::min(depth, counts[axis]) - 1;
        first[axis] = plane == 0 ? 0 : plane - inner;
        end[axis] = plane == 0 ? 1 + inner : plane + 1;
        const NodeBox box{first[1], end[1], first[2], end[2], first[0], end[0]};
        readBox(source, number, box, {}, nodes);
        take(box, nodes);
      }
      if (counts[axis] == 1) break;
    }
}

/// The longest edge of the box around the faces of all blocks.
double sizeOf(const GridSource& source) {
  std::array<std::pair<double, double>, 3> ranges;
  ranges.fill({std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()});
  for (uint32_t number = 0; number < source.description().blocks.size(); ++number)
    forEachFace(source, number, [&](const NodeBox&, const NodeArrays& nodes) {
      const std::array<const std::vector<double>*, 3> axes{&nodes.x, &nodes.y, &nodes.z};
      for (size_t axis = 0; axis < 3; ++axis)
        for (const double x : *axes[axis])
          if (std::isfinite(x))
            ranges[axis] = {std::min(ranges[axis].first, x), std::max(ranges[axis].second, x)};
    });
  double size = 0;
  for (const auto& [low, high] : ranges) size = std::max(size, high - low);
  return size;
}

/// Sets of numbers that are joined in pairs.
class Classes {
 public:
  // GCC 12 takes std::iota into parents_(count) for a write beyond an empty vector, with a warning.
  explicit Classes(size_t count) {
    for (uint32_t n = 0; n < count; ++n) parents_.push_back(n);
  }

  uint32_t of(uint32_t n) {
    while (parents_[n] != n) n = parents_[n] = parents_[parents_[n]];
    return n;
  }
  void join(uint32_t a, uint32_t b) {
    const uint32_t first = of(a), second = of(b);
    parents_[std::max(first, second)] = std::min(first, second);
  }

 private:
  std::vector<uint32_t> parents_;
};

/// A number for the place of a node, rounded to `step`, so that nodes of other blocks are found.
uint64_t placeOf(double x, double y, double z, double step) {
  const auto bits = [&](double at) { return std::bit_cast<uint64_t>(std::round(at / step) + 0.0); };
  return mixed(bits(x) + 3 * mixed(bits(y) + 5 * mixed(bits(z))));
}

/// Edges of cells by their ends.
class EdgeList {
 public:
  explicit EdgeList(uint64_t all) : stride_(1 + all / kMaxEdges) {}

  void addEdge(uint64_t first, uint64_t last, uint32_t axis) {
    if (first == last) return;
    const uint64_t key = mixed(first + last);
    if (key % stride_ == 0) edges_.emplace_back(key, axis);
  }
  void join(Classes& classes) {
    std::sort(edges_.begin(), edges_.end());
    for (size_t n = 1; n < edges_.size(); ++n)
      if (edges_[n].first == edges_[n - 1].first) classes.join(edges_[n].second, edges_[n - 1].second);
  }

 private:
  uint64_t stride_;  // of the keys that are kept, the same in all blocks
  std::vector<std::pair<uint64_t, uint32_t>> edges_;
};

/// A row of a block that ends at an outer face.
struct RowEnd {
  uint64_t place;  // placeOf() its last node
  uint32_t block;
  uint32_t face;      // two of each axis
  double part;        // what it adds to its block's deviation, for a tangent of 1
  glm::dvec3 inward;  // of unit length

  bool operator<(const RowEnd& other) const {
    return place != other.place ? place < other.place : block < other.block;
  }
  /// Whether a row that ends in the same place goes on from this one: that of another block, or the same one's other end.
  bool goesOnIn(const RowEnd& other) const { return block != other.block || (face ^ other.face) == 1; }
};

/// Two layers of nodes at a face of a block: an outer one, and the one inside of it.
struct FaceLayers {
  uint32_t block, face;            // two faces of each axis
  std::array<uint64_t, 3> counts;  // of nodes in the layers
  const NodeArrays& nodes;

  size_t axis() const { return face / 2; }
  std::array<size_t, 2> acrossAxes() const { return {(axis() + 1) % 3, (axis() + 2) % 3}; }
  bool isUpper() const { return face % 2 != 0; }
  size_t stride(size_t along) const {
    return along == 0 ? 1 : along == 1 ? counts[0] : counts[0] * counts[1];
  }
  /// Whether a row ends at node n: one of the outer layer, but not at its border.
  bool isEnd(size_t n) const {
    return nodes.blank[n] == 0 && n / stride(axis()) % 2 == (isUpper() ? 1 : 0) &&
           std::ranges::all_of(acrossAxes(), [&](size_t across) {
             const uint64_t at = n / stride(across) % counts[across];
             return at > 0 && at + 1 < counts[across];
           });
  }
  /// The way from node n to the next one of its row.
  glm::dvec3 inwardFrom(size_t n) const {
    const size_t next = isUpper() ? n - stride(axis()) : n + stride(axis());
    return {nodes.x[next] - nodes.x[n], nodes.y[next] - nodes.y[n], nodes.z[next] - nodes.z[n]};
  }
};

/// The rows that end within the outer faces of all blocks. Those on the edges of faces lead along other faces as well.
std::vector<RowEnd> rowEndsOf(const GridSource& source, double step) {
  constexpr double kDeviation = 45;
  std::vector<RowEnd> ends;
  for (uint32_t number = 0; number < source.description().blocks.size(); ++number) {
    const GridBlock& block = source.description().blocks[number];
    const std::array<uint64_t, 3> whole{block.ni, block.nj, block.nk};
    if (std::ranges::min(whole) < 3) continue;
    uint32_t face = 0;
    const auto addEnds = [&](const NodeBox& box, const NodeArrays& nodes) {
      const FaceLayers layers{number, face++, {box.i1 - box.i0, box.j1 - box.j0, box.k1 - box.k0}, nodes};
      const auto along = static_cast<double>(whole[layers.axis()] - 1);
      double rows = 1;
      for (const size_t across : layers.acrossAxes()) rows *= static_cast<double>(layers.counts[across] - 2);
      const double part = kDeviation / (along * along * rows);
      for (size_t n = 0; n < nodes.x.size(); ++n) {
        if (!layers.isEnd(n)) continue;
        const glm::dvec3 inward = layers.inwardFrom(n);
        if (const double length = glm::length(inward); length > 0 && std::isfinite(length))
          ends.push_back({placeOf(nodes.x[n], nodes.y[n], nodes.z[n], step), number, layers.face, part,
                          inward / length});
      }
    };
    forEachFace(source, number, addEnds, 2);
  }
  std::ranges::stable_sort(ends, std::less<>());
  return ends;
}

}  // namespace

std::vector<double> deviationAtKinks(const GridSource& source) {
  constexpr double kSharpest = 5;  // tangent, beyond which blocks lie upon one another
  std::vector<double> deviations(source.description().blocks.size());
  const double size = sizeOf(source);
  if (!(size > 0)) return deviations;
  const std::vector<RowEnd> ends = rowEndsOf(source, size / kResolution);
  for (size_t first = 0, last = 0; first < ends.size(); first = last) {
    while (last < ends.size() && ends[last].place == ends[first].place) ++last;
    if (last - first != 2) continue;
    const RowEnd &a = ends[first], &b = ends[first + 1];
    const double tangent = glm::length(a.inward + b.inward) / glm::length(a.inward - b.inward);
    if (!a.goesOnIn(b) || !(tangent < kSharpest)) continue;
    for (const RowEnd* end : {&a, &b}) deviations[end->block] += end->part * tangent * tangent;
  }
  return deviations;
}

std::vector<std::array<uint32_t, 3>> joinedAxes(const GridSource& source) {
  const std::vector<GridBlock>& blocks = source.description().blocks;
  Classes classes(3 * blocks.size());
  const double size = sizeOf(source);
  if (blocks.size() > 1 && size > 0) {
    uint64_t edges = 0;
    for (const GridBlock& b : blocks) edges += 4 * (b.ni * b.nj + b.nj * b.nk + b.nk * b.ni);
    EdgeList list(edges);
    std::vector<uint64_t> nodes;
    for (uint32_t number = 0; number < blocks.size(); ++number)
      forEachFace(source, number, [&](const NodeBox& box, const NodeArrays& arrays) {
        nodes.resize(arrays.x.size());
        for (size_t n = 0; n < nodes.size(); ++n)
          nodes[n] = placeOf(arrays.x[n], arrays.y[n], arrays.z[n], size / kResolution);
        const std::array<uint64_t, 3> counts{box.i1 - box.i0, box.j1 - box.j0, box.k1 - box.k0};
        const std::array<size_t, 3> strides{1, counts[0], counts[0] * counts[1]};
        for (uint32_t axis = 0; axis < 3; ++axis)
          for (size_t n = 0; n < nodes.size(); ++n)
            if (n / strides[axis] % counts[axis] + 1 < counts[axis])
              list.addEdge(nodes[n], nodes[n + strides[axis]], 3 * number + axis);
      });
    list.join(classes);
  }
  std::vector<std::array<uint32_t, 3>> found(blocks.size());
  for (uint32_t n = 0; n < 3 * blocks.size(); ++n) found[n / 3][n % 3] = classes.of(n);
  return found;
}

}  // namespace curvisplat
