#include "preprocess/survey/joined_axes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
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

/// Calls `take` with the nodes of each outer face of the block and their box.
template <typename Take>
void forEachFace(const GridSource& source, uint32_t number, const Take& take) {
  const GridBlock& block = source.description().blocks[number];
  const std::array<uint64_t, 3> counts{block.ni, block.nj, block.nk};
  NodeArrays nodes;
  for (size_t axis = 0; axis < 3; ++axis)
    for (const uint64_t plane : {uint64_t{0}, counts[axis] - 1}) {
      if (plane == 0 || counts[axis] > 1) {
        std::array<uint64_t, 3> first{}, end = counts;
        first[axis] = plane;
        end[axis] = plane + 1;
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
  explicit Classes(size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0u); }

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

/// Edges of cells by their ends, which are rounded, so that those of other blocks are found.
class EdgeList {
 public:
  EdgeList(double resolution, uint64_t all) : step_(resolution), stride_(1 + all / kMaxEdges) {}

  /// A number for the place of a node.
  uint64_t nodeAt(double x, double y, double z) const {
    const auto bits = [&](double at) { return std::bit_cast<uint64_t>(std::round(at / step_) + 0.0); };
    return mixed(bits(x) + 3 * mixed(bits(y) + 5 * mixed(bits(z))));
  }
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
  double step_;
  uint64_t stride_;  // of the keys that are kept, the same in all blocks
  std::vector<std::pair<uint64_t, uint32_t>> edges_;
};

}  // namespace

std::vector<std::array<uint32_t, 3>> joinedAxes(const GridSource& source) {
  const std::vector<GridBlock>& blocks = source.description().blocks;
  Classes classes(3 * blocks.size());
  const double size = sizeOf(source);
  if (blocks.size() > 1 && size > 0) {
    uint64_t edges = 0;
    for (const GridBlock& b : blocks) edges += 4 * (b.ni * b.nj + b.nj * b.nk + b.nk * b.ni);
    EdgeList list(size / kResolution, edges);
    std::vector<uint64_t> nodes;
    for (uint32_t number = 0; number < blocks.size(); ++number)
      forEachFace(source, number, [&](const NodeBox& box, const NodeArrays& arrays) {
        nodes.resize(arrays.x.size());
        for (size_t n = 0; n < nodes.size(); ++n)
          nodes[n] = list.nodeAt(arrays.x[n], arrays.y[n], arrays.z[n]);
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
