#include "preprocess/grid/grid_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <random>
#include <vector>

#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/grid_nodes.h"

namespace curvisplat {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

using NodeIndex = std::array<uint64_t, 3>;

/// SplitMix64: seeding the standard's engines for each node would take nearly all of the time.
struct NodeRandom {
  using result_type = uint64_t;
  static constexpr uint64_t min() { return 0; }
  static constexpr uint64_t max() { return ~uint64_t{0}; }
  uint64_t operator()() {
    uint64_t bits = state += 0x9e3779b97f4a7c15;
    bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111eb;
    return bits ^ (bits >> 31);
  }
  uint64_t state;
};

/// Random, and the same for the same node.
glm::dvec3 jolt(const NodeIndex& node, double size) {
  NodeRandom random{node[0] + 100 * node[1] + 10'000 * node[2] + 1};
  std::uniform_real_distribution<double> part(-size, size);
  const double x = part(random), y = part(random);
  return {x, y, part(random)};
}

/// A node of a lattice of uneven, skewed cells far from the origin.
glm::dvec3 unevenPosition(const NodeIndex& n) {
  const glm::dvec3 even(static_cast<double>(n[0]), static_cast<double>(n[1]), static_cast<double>(n[2]));
  return glm::dvec3(1e3, -3e2, 7.0) + even + 0.3 * even.z * glm::dvec3(1, 0.5, 0) + jolt(n, 0.3);
}

float unevenValue(const NodeIndex& n) {
  return static_cast<float>(jolt({n[0] + 50, n[1], n[2]}, 5.0).x);
}

using Change = std::function<void(const GridNode&, NodeValues&)>;

std::unique_ptr<FunctionGridSource> unevenGrid(const NodeIndex& nodes, const Change& change = {},
                                               Centring centring = Centring::kNode) {
  return std::make_unique<FunctionGridSource>(
      std::vector{gridBlock(nodes[0], nodes[1], nodes[2])}, 1,
      [=](const GridNode& node) {
        const NodeIndex n{node.i, node.j, node.k};
        NodeValues values;
        values.position = unevenPosition(n);
        values.scalars = {unevenValue(n)};
        if (change) change(node, values);
        return values;
      },
      centring);
}

size_t atOf(const GridBlock& block, const NodeIndex& n) {
  return (n[2] * block.nj + n[1]) * block.ni + n[0];
}

glm::dvec3 positionOf(const NodeArrays& nodes, size_t at) {
  return {nodes.x[at], nodes.y[at], nodes.z[at]};
}

template <typename Visit>
void forEachIndex(const GridBlock& block, const Visit& visit) {
  for (uint64_t k = 0; k < block.nk; ++k)
    for (uint64_t j = 0; j < block.nj; ++j)
      for (uint64_t i = 0; i < block.ni; ++i) visit(NodeIndex{i, j, k});
}

/// Weighted sum over the corners of the cell that a refined node lies in.
template <typename Value, typename Of>
Value trilinear(const NodeIndex& node, const CellCuts& cuts, const NodeIndex& counts, const Of& of) {
  Value sum{};
  for (unsigned corner = 0; corner < 8; ++corner) {
    NodeIndex n;
    double weight = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double share = static_cast<double>(node[axis] % cuts[axis]) / cuts[axis];
      const bool higher = (corner >> axis & 1) != 0;
      n[axis] = std::min(node[axis] / cuts[axis] + higher, counts[axis] - 1);
      weight *= higher ? share : 1 - share;
    }
    sum += weight * of(n);
  }
  return sum;
}

TEST(RefinedSource, CutsCellsByTheirTrilinearMap) {
  const NodeIndex counts{3, 4, 2};
  for (const CellCuts& cuts : {kWholeCells, CellCuts{2, 2, 2}, CellCuts{3, 3, 3}, CellCuts{16, 16, 16},
                               CellCuts{1, 2, 1}, CellCuts{4, 1, 2}, CellCuts{2, 3, 8}}) {
    const Refinement refinement({cuts});
    const auto fine = refined(unevenGrid(counts), refinement);
    const GridBlock& block = fine->description().blocks[0];
    EXPECT_EQ((NodeIndex{block.ni, block.nj, block.nk}),
              (NodeIndex{2 * cuts[0] + 1, 3 * cuts[1] + 1, cuts[2] + 1}));
    EXPECT_EQ(fine->description().refinement, refinement);
    const NodeArrays nodes = allNodes(*fine, 0);
    ASSERT_EQ(nodes.x.size(), block.nodes());
    forEachIndex(block, [&](const NodeIndex& n) {
      const size_t at = atOf(block, n);
      const glm::dvec3 found = positionOf(nodes, at);
      EXPECT_LT(glm::length(found - trilinear<glm::dvec3>(n, cuts, counts, unevenPosition)), 1e-12 * 1e3);
      EXPECT_NEAR(nodes.scalars[0][at], trilinear<double>(n, cuts, counts, unevenValue), 1e-5);
      EXPECT_EQ(nodes.blank[at], 0);
      if (n[0] % cuts[0] + n[1] % cuts[1] + n[2] % cuts[2] > 0) return;
      const NodeIndex old{n[0] / cuts[0], n[1] / cuts[1], n[2] / cuts[2]};
      EXPECT_EQ(found, unevenPosition(old));
      EXPECT_EQ(nodes.scalars[0][at], unevenValue(old));
    });
  }
}

/// Whether all nodes of the cell are there; along an axis with one plane it has no thickness.
template <typename IsThere>
bool isWhole(const GridBlock& block, const NodeIndex& cell, const IsThere& is_there) {
  for (unsigned corner = 0; corner < 8; ++corner) {
    const NodeIndex n{std::min(cell[0] + (corner & 1), block.ni - 1),
                      std::min(cell[1] + (corner >> 1 & 1), block.nj - 1),
                      std::min(cell[2] + (corner >> 2 & 1), block.nk - 1)};
    if (!is_there(n)) return false;
  }
  return true;
}

/// Why some nodes are gone: blanked, by value, not finite or not in a place.
enum class Gone { kBlanked, kByValue, kNotFinite, kNowhere };

std::unique_ptr<FunctionGridSource> gridWithGone(const NodeIndex& counts, uint64_t seed, Gone how,
                                                 Centring centring = Centring::kNode) {
  return unevenGrid(
      counts,
      [=](const GridNode& node, NodeValues& values) {
        NodeRandom random{seed + node.i + 20 * node.j + 400 * node.k};
        if (random() % 8 != 0) return;
        if (how == Gone::kBlanked) values.blank = true;
        if (how == Gone::kByValue) values.scalars[0] = -999;
        if (how == Gone::kNotFinite) values.scalars[0] = kNone;
        if (how == Gone::kNowhere) values.position.y = kNone;
      },
      centring);
}

TEST(RefinedSource, DrawsThePartsOfCellsThatAreDrawn) {
  const std::array<uint32_t, 1> scalar{0};
  const auto is_there = [](const NodeArrays& nodes, size_t at) {
    const float value = nodes.scalars[0][at];
    return nodes.blank[at] == 0 && std::isfinite(value) && value != -999 && std::isfinite(nodes.y[at]);
  };
  for (const Gone how : {Gone::kBlanked, Gone::kByValue, Gone::kNotFinite, Gone::kNowhere})
    for (const uint32_t parts : {2u, 3u})
      for (const NodeIndex& counts : {NodeIndex{6, 5, 4}, NodeIndex{7, 1, 6}, NodeIndex{2, 2, 2}}) {
        const auto grid = gridWithGone(counts, 77, how);
        const GridBlock& coarse = grid->description().blocks[0];
        const NodeArrays before = allNodes(*grid, 0);
        const auto fine = refined(gridWithGone(counts, 77, how), parts, -999);
        const GridBlock& block = fine->description().blocks[0];
        const NodeArrays nodes = allNodes(*fine, 0);
        uint64_t whole = 0;
        forEachIndex(block, [&](const NodeIndex& n) {
          const NodeIndex cell{n[0] / parts, n[1] / parts, n[2] / parts};
          if (n[0] % parts + n[1] % parts + n[2] % parts == 0) {
            EXPECT_EQ(nodes.blank[atOf(block, n)], before.blank[atOf(coarse, cell)]);
          }
          const auto ends = [](uint64_t at, uint64_t count) { return at + 1 >= count && count > 1; };
          if (ends(n[0], block.ni) || ends(n[1], block.nj) || ends(n[2], block.nk)) return;
          const bool is_drawn = isWhole(
              coarse, cell, [&](const NodeIndex& old) { return is_there(before, atOf(coarse, old)); });
          EXPECT_EQ(
              isWhole(block, n, [&](const NodeIndex& node) { return is_there(nodes, atOf(block, node)); }),
              is_drawn)
              << n[0] << ' ' << n[1] << ' ' << n[2];
          whole += is_drawn;
        });
        EXPECT_TRUE(whole > 0 || counts == (NodeIndex{2, 2, 2}));
        expectPartsOfRows(*fine, scalar);
      }
}

TEST(RefinedSource, ReadsLargeBoxesByPlanes) {
  const std::array<uint32_t, 1> scalar{0};
  const Refinement cut(std::vector<CellCuts>{{1, 1, 3}});
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    const auto fine = refined(gridWithGone({150, 130, 7}, 77, Gone::kBlanked, centring), cut);
    const GridBlock& block = fine->description().blocks[0];
    const NodeArrays whole = allNodes(*fine, 0);
    ASSERT_EQ(whole.x.size(), block.nodes());
    NodeArrays plane;
    for (uint64_t k = 0; k < block.nk; ++k) {
      fine->read(0, {0, block.nj, k, k + 1}, scalar, plane);
      const auto expectPart = [&](const auto& part, const auto& of) {
        EXPECT_TRUE(
            std::equal(part.begin(), part.end(), of.begin() + static_cast<ptrdiff_t>(k * part.size())))
            << k;
      };
      expectPart(plane.x, whole.x);
      expectPart(plane.z, whole.z);
      expectPart(plane.scalars[0], whole.scalars[0]);
      expectPart(plane.blank, whole.blank);
    }
  }
}

/// Cells that grow by 1.4 along i, 1 long along j and k; `valueOf(i, j, k)` of those but the last along each axis.
std::unique_ptr<GridSource> growingCells(const std::function<double(const NodeIndex&)>& valueOf) {
  return std::make_unique<FunctionGridSource>(
      std::vector{gridBlock(9, 4, 5)}, 1,
      [=](const GridNode& node) {
        NodeValues values;
        values.position = {std::pow(1.4, node.i), node.j, node.k};
        const bool is_cell = node.i < 8 && node.j < 3 && node.k < 4;
        values.scalars = {is_cell ? static_cast<float>(valueOf({node.i, node.j, node.k})) : kNone};
        return values;
      },
      Centring::kCell);
}

double middleOf(uint64_t i) {
  const auto n = static_cast<double>(i);
  return 0.5 * (std::pow(1.4, n) + std::pow(1.4, n + 1));
}

TEST(RefinedSource, PartsOfCellsFollowALinearField) {
  const auto field = [](double x, double y, double z) { return 2 * x - 3 * y + z + 20; };
  const auto fine = refined(growingCells([&](const NodeIndex& n) {
                              return field(middleOf(n[0]), static_cast<double>(n[1]) + 0.5,
                                           static_cast<double>(n[2]) + 0.5);
                            }),
                            Refinement(std::vector<CellCuts>{{2, 1, 4}}));
  const NodeArrays nodes = allNodes(*fine, 0);
  const GridBlock& block = fine->description().blocks[0];
  forEachIndex(block, [&](const NodeIndex& n) {
    // Cells at a border where no cell beside them has a larger value have no values beyond their own.
    const bool at_border = n[0] < 2 || n[0] >= 14 || n[1] != 1 || n[2] < 4 || n[2] >= 12;
    if (at_border) return;
    const size_t at = atOf(block, n);
    const double x = 0.5 * (nodes.x[at] + nodes.x[at + 1]);
    const double expected = field(x, static_cast<double>(n[1]) + 0.5, (static_cast<double>(n[2]) + 0.5) / 4);
    EXPECT_NEAR(nodes.scalars[0][at], expected, 1e-4) << n[0] << ' ' << n[1] << ' ' << n[2];
  });
}

TEST(RefinedSource, PartsOfCellsHaveItsMeanAndNoNewExtremes) {
  const std::array<double, 8> values{100, 0, 0, 1e6, 2e6, 1, -5, -5};  // a value of a border, and steps
  const auto fine = refined(growingCells([&](const NodeIndex& n) { return values[n[0]]; }), 4);
  const NodeArrays nodes = allNodes(*fine, 0);
  for (size_t i = 0; i < values.size(); ++i) {
    double sum = 0;
    for (size_t part = 0; part < 4; ++part) {
      const double value = nodes.scalars[0][4 * i + part];
      sum += value / 4;
      double least = values[i], most = values[i];
      for (const size_t beside : {i - std::min<size_t>(i, 1), std::min<size_t>(i + 1, 7)}) {
        least = std::min(least, values[beside]);
        most = std::max(most, values[beside]);
      }
      EXPECT_GE(value, least) << i;
      EXPECT_LE(value, most) << i;
    }
    EXPECT_NEAR(sum, values[i], 1e-6 * std::max(1.0, std::abs(values[i]))) << i;
  }
}

TEST(RefinedSource, PartsStayAmongTheCellsAround) {
  const auto valueOf = [](const NodeIndex& n) {
    return std::sin(3.0 * static_cast<double>(n[0])) * std::cos(2.0 * static_cast<double>(n[1])) +
           0.5 * static_cast<double>(n[2]);
  };
  const auto fine = refined(growingCells(valueOf), 2);
  const NodeArrays nodes = allNodes(*fine, 0);
  const GridBlock& block = fine->description().blocks[0];
  const NodeIndex cells{8, 3, 4};
  size_t differ = 0;
  forEachIndex(block, [&](const NodeIndex& n) {
    if (n[0] + 1 == block.ni || n[1] + 1 == block.nj || n[2] + 1 == block.nk) return;
    const NodeIndex cell{n[0] / 2, n[1] / 2, n[2] / 2};
    double least = valueOf(cell), most = least;
    for (size_t axis = 0; axis < 3; ++axis)
      for (const uint64_t beside :
           {cell[axis] - std::min<uint64_t>(cell[axis], 1), std::min(cell[axis] + 1, cells[axis] - 1)}) {
        NodeIndex other = cell;
        other[axis] = beside;
        least = std::min(least, valueOf(other));
        most = std::max(most, valueOf(other));
      }
    const double value = nodes.scalars[0][atOf(block, n)];
    EXPECT_GE(value, least - 1e-6) << n[0] << ' ' << n[1] << ' ' << n[2];
    EXPECT_LE(value, most + 1e-6) << n[0] << ' ' << n[1] << ' ' << n[2];
    differ += std::abs(value - valueOf(cell)) > 0.01;
  });
  EXPECT_GT(differ, 100u);
}

TEST(RefinedSource, PartsOfPositiveCellsArePositive) {
  // Along each axis alone all parts are; the changes along three add up.
  const auto valueOf = [](const NodeIndex& n) { return std::pow(2.5, n[0] + n[1] + n[2]); };
  const auto fine = refined(growingCells(valueOf), 4);
  const NodeArrays nodes = allNodes(*fine, 0);
  const GridBlock& block = fine->description().blocks[0];
  double of_cell = 0;
  forEachIndex(block, [&](const NodeIndex& n) {
    if (n[0] + 1 == block.ni || n[1] + 1 == block.nj || n[2] + 1 == block.nk) return;
    const float value = nodes.scalars[0][atOf(block, n)];
    EXPECT_GE(value, 0) << n[0] << ' ' << n[1] << ' ' << n[2];
    if (n[0] / 4 == 3 && n[1] / 4 == 1 && n[2] / 4 == 2) of_cell += double{value} / 64;
  });
  EXPECT_NEAR(of_cell, valueOf({3, 1, 2}), 1e-5 * of_cell);
}

TEST(RefinedSource, PartsOfCellsLeaveOutWhatHasNoValue) {
  // Beside a cell without a value and one that is infinite, as at a border: their own values.
  const auto fine = refined(growingCells([&](const NodeIndex& n) {
                              if (n[0] == 4) return static_cast<double>(kNone);
                              return n[0] == 0 ? std::numeric_limits<double>::infinity() : middleOf(n[0]);
                            }),
                            Refinement(std::vector<CellCuts>{{2, 1, 1}}));
  const NodeArrays nodes = allNodes(*fine, 0);
  EXPECT_TRUE(std::isinf(nodes.scalars[0][0]) && std::isinf(nodes.scalars[0][1]));
  EXPECT_TRUE(std::isnan(nodes.scalars[0][8]) && std::isnan(nodes.scalars[0][9]));
  for (const size_t n : {4, 5, 12, 13})
    EXPECT_NEAR(nodes.scalars[0][n], 0.5 * (nodes.x[n] + nodes.x[n + 1]), 1e-4) << n;
  for (const size_t n : {2, 3, 6, 7, 10, 11, 14, 15})
    EXPECT_NEAR(nodes.scalars[0][n], middleOf(n / 2), 1e-4) << n;
  EXPECT_EQ(nodes.blank[0], 0) << "a cell without a value blanks no nodes";
  expectPartsOfRows(*fine);
}

/// The refined nodes of a plane of a block, sorted.
std::vector<std::array<double, 3>> sortedPlane(const GridSource& grid, uint32_t number, size_t axis,
                                               uint64_t plane) {
  const GridBlock& block = grid.description().blocks[number];
  const NodeArrays nodes = allNodes(grid, number);
  std::vector<std::array<double, 3>> positions;
  forEachIndex(block, [&](const NodeIndex& n) {
    if (n[axis] != plane) return;
    const glm::dvec3 at = positionOf(nodes, atOf(block, n));
    positions.push_back({at.x, at.y, at.z});
  });
  std::sort(positions.begin(), positions.end());
  return positions;
}

TEST(RefinedSource, BlocksShareTheNodesOfAJointBitForBit) {
  constexpr uint64_t kAcross = 5, kUp = 4;
  // The first block ends at its last i with the face (j, k); the others have that face turned and mirrored.
  const auto faceNode = [](uint64_t j, uint64_t k) { return unevenPosition({40, j, k}); };
  const auto position = [=](const GridNode& n) {
    const auto away = [](uint64_t planes) { return glm::dvec3(static_cast<double>(planes), 0, 0); };
    switch (n.block) {
      case 0:
        return faceNode(n.j, n.k) - away(2 - n.i);
      case 1:
        return faceNode(kAcross - 1 - n.k, n.i) + away(n.j);  // at its first j
      case 2:
        return faceNode(n.i, kUp - 1 - n.j) + away(2 - n.k);  // at its last k
      default:
        return faceNode(n.j, kUp - 1 - n.k) + 0.5 * away(n.i);  // at its first i
    }
  };
  const auto blocks = std::vector{gridBlock(3, kAcross, kUp), gridBlock(kUp, 3, kAcross),
                                  gridBlock(kAcross, kUp, 3), gridBlock(3, kAcross, kUp)};
  for (uint32_t parts = 2; parts <= 16; ++parts) {
    const auto fine =
        refined(std::make_unique<FunctionGridSource>(blocks, 1,
                                                     [&](const GridNode& node) {
                                                       return NodeValues{position(node), {0.0f}, false};
                                                     }),
                parts);
    const auto of_first = sortedPlane(*fine, 0, 0, uint64_t{2} * parts);
    EXPECT_EQ(sortedPlane(*fine, 1, 1, 0), of_first) << parts;
    EXPECT_EQ(sortedPlane(*fine, 2, 2, uint64_t{2} * parts), of_first) << parts;
    EXPECT_EQ(sortedPlane(*fine, 3, 0, 0), of_first) << parts;
  }
}

TEST(RefinedSource, CollapsedFacesStayCollapsed) {
  // All i of the first j are at a point of the axis along k, and all nodes of the first k are at one point.
  const auto position = [](const GridNode& n) {
    if (n.k == 0) return unevenPosition({0, 0, 0});
    return n.j == 0 ? unevenPosition({0, 0, n.k}) : unevenPosition({n.i, n.j, n.k});
  };
  for (const uint32_t parts : {2u, 3u, 7u}) {
    const auto fine =
        refined(std::make_unique<FunctionGridSource>(std::vector{gridBlock(5, 3, 4)}, 1,
                                                     [&](const GridNode& node) {
                                                       return NodeValues{position(node), {0.0f}, false};
                                                     }),
                parts);
    const GridBlock& block = fine->description().blocks[0];
    const NodeArrays nodes = allNodes(*fine, 0);
    forEachIndex(block, [&](const NodeIndex& n) {
      const glm::dvec3 found = positionOf(nodes, atOf(block, n));
      if (n[2] == 0) {
        EXPECT_EQ(found, positionOf(nodes, 0));
      }
      if (n[1] == 0) {
        EXPECT_EQ(found, positionOf(nodes, atOf(block, {0, 0, n[2]})));
      }
    });
  }
}

bool isFringe(uint64_t i, uint64_t j, uint64_t k) {
  return k < 2 || (i + j + k) % 2 == 0;
}

/// Nodes of a grid that remembers the most that one read of it took.
class CountingSource : public GridSource {
 public:
  explicit CountingSource(uint64_t& most) : most_(most), grid_(unevenGrid({9, 40, 50})) {
    description_ = grid_->description();
    description_.boundaries.push_back({"Wall", "BCWall", 0, {0, 3, 2}, {8, 3, 5}});
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    grid_->read(block, box, scalars, out);
    most_ = std::max<uint64_t>(most_, out.x.size());
  }
  bool readFringe(uint32_t, const NodeBox& box, std::vector<uint8_t>& out) const override {
    out.clear();
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < 9; ++i) out.push_back(isFringe(i, j, k));
    return true;
  }

 private:
  uint64_t& most_;
  std::unique_ptr<FunctionGridSource> grid_;
  GridDescription description_;
};

TEST(RefinedSource, ReadsTheRowsAroundABoxAlone) {
  uint64_t most = 0;
  const auto fine = refined(std::make_unique<CountingSource>(most), 4);
  const std::array<uint32_t, 1> scalar{0};
  NodeArrays nodes;
  fine->read(0, {17, 18, 101, 102}, scalar, nodes);
  EXPECT_EQ(nodes.x.size(), 33u);
  EXPECT_EQ(most, 2u * 2 * 9) << "between two planes along j and k";
  most = 0;
  fine->read(0, {16, 17, 100, 101}, scalar, nodes);
  EXPECT_EQ(most, 3u * 3 * 9) << "on a plane of the grid: the cells on both sides decide on blanking";
  fine->readPartOfRows(0, {8, 12, 8, 12, 4, 6}, scalar, nodes);
  EXPECT_EQ(nodes.x.size(), 32u);
  EXPECT_EQ(fine->rowsInMemory(scalar), 1u) << "the default reads whole rows of the grid";
}

TEST(RefinedSource, FringeAndBoundariesAreThoseOfTheGrid) {
  uint64_t most = 0;
  const auto fine = refined(std::make_unique<CountingSource>(most), 3);
  const GridBoundary& boundary = fine->description().boundaries.at(0);
  EXPECT_EQ(boundary.first, (NodeIndex{0, 9, 6}));
  EXPECT_EQ(boundary.last, (NodeIndex{24, 9, 15}));
  std::vector<uint8_t> fringe;
  ASSERT_TRUE(fine->readFringe(0, {3, 5, 2, 7}, fringe));
  ASSERT_EQ(fringe.size(), 25u * 2 * 5);
  size_t at = 0;
  for (uint64_t k = 2; k < 7; ++k)
    for (uint64_t j = 3; j < 5; ++j)
      for (uint64_t i = 0; i < 25; ++i, ++at) {
        bool all = true;
        for (unsigned corner = 0; corner < 8; ++corner)
          all &= isFringe((i + (corner & 1) * 2) / 3, (j + (corner >> 1 & 1) * 2) / 3,
                          (k + (corner >> 2) * 2) / 3);
        EXPECT_EQ(fringe[at], all) << i << ' ' << j << ' ' << k;
      }
  expectPartsOfRows(*fine);
}

TEST(RefinedSource, SaysWhenThereAreTooManyNodes) {
  for (const NodeIndex& counts :
       {NodeIndex{uint64_t{1} << 61, 1, 1}, NodeIndex{uint64_t{1} << 21, 1 << 20, 1 << 20}}) {
    auto grid = std::make_unique<FunctionGridSource>(std::vector{gridBlock(counts[0], counts[1], counts[2])},
                                                     0, [](const GridNode&) { return NodeValues{}; });
    EXPECT_THROW(refined(std::move(grid), 16), Error);
  }
}

}  // namespace
}  // namespace curvisplat
