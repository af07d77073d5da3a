#include <gtest/gtest.h>
#include <tbb/task_arena.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "preprocess/coincidence/coincidence_sweep.h"
#include "preprocess/seams/seams.h"
#include "preprocess/shape/shape.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/model/border_code.h"
#include "tests/preprocess/merged_seams.h"
#include "tests/reference/mapped_block.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr size_t kSweptDoubles = 7;  // of a record: its three numbers, the position, the spacing

class CoincidenceRanges : public testing::Test {
 protected:
  /// Ranges of these nodes, which are expected to be all, and to part none that coincide.
  std::vector<SweepRange> rangesOf(const std::vector<SweptNode>& nodes) const {
    RecordSorter sorter(kSweptDoubles, 1 << 20, folder_.path());
    LargestReach reach;
    for (size_t n = 0; n < nodes.size(); ++n) {
      const auto& [sweep, position, spacing] = nodes[n];
      const std::array<double, kSweptDoubles> record{
          sweep.along, sweep.across, std::bit_cast<double>(uint64_t{n}), position.x, position.y,
          position.z,  spacing};
      sorter.add(record);
      reach.add(position, spacing);
    }
    sorter.sort();
    const auto swept_of = [&](const double* record) { return nodes[RecordSorter::numberOf(record)]; };
    const std::vector<SweepRange> ranges = coincidenceRanges(sorter, 8, swept_of, reach, 8);
    EXPECT_EQ(ranges.front().from, -std::numeric_limits<double>::infinity());
    EXPECT_EQ(ranges.back().to, std::numeric_limits<double>::infinity());
    for (size_t n = 1; n < ranges.size(); ++n) EXPECT_EQ(ranges[n].from, ranges[n - 1].to);
    const auto range_of = [&](const SweptNode& node) {
      return std::ranges::find_if(ranges,
                                  [&](const SweepRange& range) { return node.sweep.along < range.to; }) -
             ranges.begin();
    };
    for (const SweptNode& a : nodes)
      for (const SweptNode& b : nodes)
        if (glm::distance(a.position, b.position) <= 1e-3 * std::min(a.spacing, b.spacing)) {
          EXPECT_EQ(range_of(a), range_of(b));
        }
    return ranges;
  }

  static SweptNode nodeAt(const glm::dvec3& position, double spacing) {
    return {seamPosition(position), position, spacing};
  }

  const TemporaryFolder folder_;
};

/// Points each with `copies` nodes, which are `off` apart at the most along each axis.
std::vector<glm::dvec3> points(size_t count, size_t copies, double off) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto place = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  std::vector<glm::dvec3> points;
  for (size_t n = 0; n < count; ++n) {
    const glm::dvec3 point = place();
    for (size_t copy = 0; copy < copies; ++copy) points.push_back(point + off * place());
  }
  return points;
}

TEST_F(CoincidenceRanges, PartNoNodesThatCoincide) {
  std::vector<SweptNode> nodes;
  for (const glm::dvec3& point : points(500, 4, 1e-5)) nodes.push_back(nodeAt(point, 0.1));
  EXPECT_GE(rangesOf(nodes).size(), 6u);
}

TEST_F(CoincidenceRanges, GoBetweenNodesThatReachPastOneAnother) {
  // Along the sweep a node reaches past some ten others, but none is near it.
  std::vector<SweptNode> nodes;
  for (const glm::dvec3& point : points(1000, 2, 0)) nodes.push_back(nodeAt(point, 10));
  EXPECT_GE(rangesOf(nodes).size(), 6u);
}

TEST_F(CoincidenceRanges, AreOneWhereEachNodeReachesTheNext) {
  std::vector<SweptNode> nodes;
  for (int n = 0; n < 2000; ++n) nodes.push_back(nodeAt(glm::dvec3(1e-4 * n), 0.2));
  EXPECT_EQ(rangesOf(nodes).size(), 1u);
}

TEST_F(CoincidenceRanges, OfFewNodesAreOne) {
  EXPECT_EQ(rangesOf({}).size(), 1u);
  EXPECT_EQ(rangesOf({nodeAt(glm::dvec3(1), 1)}).size(), 1u);
}

class Seams : public MergedSeams {};

/// Nodes [i0, i0+ni) x ... of an affine grid.
MappedBlock affineBlock(std::array<uint64_t, 3> first, std::array<uint64_t, 3> count, uint64_t first_node) {
  MappedBlock block(count[0], count[1], count[2], [&](double i, double j, double k) {
    const glm::dvec3 c(i + static_cast<double>(first[0]), j + static_cast<double>(first[1]),
                       k + static_cast<double>(first[2]));
    return glm::dvec3(c.x + 0.25 * c.y, c.y - 0.5 * c.z, 0.5 * c.z);
  });
  block.addScalar(field);
  block.first_node = first_node;
  return block;
}

void expectSameMerged(const std::map<std::array<long, 3>, Piece>& found,
                      const std::map<std::array<long, 3>, Piece>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (const auto& [place, whole] : expected) {
    const auto at = found.find(place);
    ASSERT_NE(at, found.end());
    const Piece& piece = at->second;
    EXPECT_NEAR(piece.node.splat.weight, whole.node.splat.weight, 1e-9);
    for (int n = 0; n < 3; ++n) {  // directions at seams are kept in single precision
      EXPECT_NEAR(piece.node.splat.axis[n], whole.node.splat.axis[n], 1e-7);
      EXPECT_NEAR(piece.node.splat.shear[n], whole.node.splat.shear[n], 1e-7);
    }
    EXPECT_NEAR(piece.value.mean, whole.value.mean, 1e-9);
    EXPECT_LT(glm::distance(piece.value.slope, whole.value.slope), 1e-7);
    EXPECT_NEAR(piece.value.variance, 0, 1e-9);
    const InwardAxes open = inwardAxes(piece.node.border_code), border = inwardAxes(whole.node.border_code);
    ASSERT_EQ(open.behind, border.behind);
    ASSERT_EQ(open.count, border.count);
    EXPECT_EQ(open.faces, border.faces);
    const uint32_t layers = layersOf(piece.node.border_code),
                   expected_layers = layersOf(whole.node.border_code);
    ASSERT_EQ(std::popcount(layers), std::popcount(expected_layers));
    for (int n = 0; n < 3; ++n) {
      const bool is_end = n < border.count;
      if (!is_end && (expected_layers >> n & 1) == 0) continue;
      double closest = -1;
      for (int m = 0; m < 3; ++m)
        if (is_end ? m < open.count : (layers >> m & 1) != 0)
          closest = std::max<double>(closest, glm::dot(open.axis[m], border.axis[n]));
      EXPECT_GT(closest, 0.999);
    }
  }
}

TEST_F(Seams, OfTwoBlocksVanish) {
  const Places whole = mergeBlocks({affineBlock({0, 0, 0}, {9, 5, 6}, 0)});
  EXPECT_EQ(merged_, 0u);
  const Places cut =
      mergeBlocks({affineBlock({0, 0, 0}, {4, 5, 6}, 0), affineBlock({3, 0, 0}, {6, 5, 6}, 4 * 5 * 6)});
  EXPECT_EQ(merged_, 30u);
  expectSameMerged(cut, whole);
  memory_bytes_ = 10000;  // some fifty splats: in runs on disk, and those that wait for probes as well
  expectSameMerged(
      mergeBlocks({affineBlock({3, 0, 0}, {6, 5, 6}, 4 * 5 * 6), affineBlock({0, 0, 0}, {4, 5, 6}, 0)}),
      whole);
}

TEST_F(Seams, LeaveNoFaceToTheLayerBehindThem) {
  const Places cut =
      mergeBlocks({affineBlock({0, 0, 0}, {6, 6, 6}, 0), affineBlock({5, 0, 0}, {6, 6, 6}, 6 * 6 * 6)});
  const auto bitsAt = [&](int i, int j, int k) {
    const glm::dvec3 p = glm::dvec3(i + 0.25 * j, j - 0.5 * k, 0.5 * k) * 1024.0;
    return cut.at({std::lround(p.x), std::lround(p.y), std::lround(p.z)}).node.border_code;
  };
  const auto codeAt = [&](int i, int j, int k) { return inwardAxes(bitsAt(i, j, k)); };
  EXPECT_EQ(codeAt(4, 2, 2).count, 0);
  EXPECT_EQ(codeAt(6, 2, 2).count, 0);
  EXPECT_TRUE(codeAt(1, 2, 2).behind);
  EXPECT_TRUE(codeAt(9, 3, 2).behind);
  EXPECT_TRUE(codeAt(3, 2, 4).behind);
  // The nodes on the seam.
  EXPECT_EQ(codeAt(5, 2, 2).count, 0);
  EXPECT_EQ(layersOf(bitsAt(5, 2, 2)), 0u);
  EXPECT_TRUE(codeAt(5, 2, 1).behind);
  EXPECT_EQ(layersOf(bitsAt(5, 1, 1)), 3u);
  // Nodes behind the seam and two faces.
  EXPECT_EQ(codeAt(4, 1, 1).count, 0);
  EXPECT_EQ(layersOf(bitsAt(4, 1, 1)), 3u);
  EXPECT_EQ(layersOf(bitsAt(1, 1, 1)), 7u);
}

TEST_F(Seams, OfEightBlocksVanishAtTheirCommonCornerToo) {
  std::vector<MappedBlock> blocks;
  for (int octant = 0; octant < 8; ++octant) {
    std::array<uint64_t, 3> first{}, count{};
    for (int axis = 0; axis < 3; ++axis) {
      const bool upper = octant >> axis & 1;
      first[axis] = upper ? 3 : 0;
      count[axis] = upper ? 5 : 4;
    }
    blocks.push_back(affineBlock(first, count, blocks.empty() ? 0 : blocks.back().first_node + 1000));
  }
  const Places cut = mergeBlocks(blocks);
  EXPECT_EQ(merged_, 9u * 9 * 9 - 8 * 8 * 8);
  expectSameMerged(cut, mergeBlocks({affineBlock({0, 0, 0}, {8, 8, 8}, 0)}));
  // The corner's node is the lowest of the eight.
  const glm::dvec3 corner = affineBlock({3, 3, 3}, {1, 1, 1}, 0).splats().splats[0].node_position * 1024.0;
  const Piece& piece = cut.at({std::lround(corner.x), std::lround(corner.y), std::lround(corner.z)});
  EXPECT_EQ(piece.node.node, blocks[0].at(3, 3, 3));
  EXPECT_FALSE(piece.node.regular);
}

TEST_F(Seams, AcrossAWallLayerAreAlikeIfTheirCellsAre) {
  // Cells 500 times as long, across the joint, as they are high; at an angle, so that codes of directions are rounded.
  const auto sheet = [](double first, uint64_t first_node) {
    MappedBlock block(4, 4, 4, [&](double i, double j, double k) {
      const double x = first + i, y = 0.002 * j;
      return glm::dvec3(0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, k);
    });
    block.addScalar(field);
    block.first_node = first_node;
    return block;
  };
  std::vector<Piece> faces = facesOf(sheet(0, 0));
  for (const Piece& face : facesOf(sheet(3, 64))) faces.push_back(face);
  merge(faces);
  EXPECT_EQ(merged_, 16u);
}

/// A pipe whose wall layer begins at radius 1 with `spacing`, closed along i after 128 steps. In float
/// arithmetic, as a grid generator would.
MappedBlock closedPipe(float spacing) {
  MappedBlock block(129, 7, 5, [&](double i, double j, double k) {
    const float theta = static_cast<float>(i) * (6.2831853f / 128.0f);
    const float r = 1.0f + spacing * static_cast<float>(j);
    return glm::dvec3(r * std::cos(theta), r * std::sin(theta), static_cast<float>(k));
  });
  block.addScalar([](const glm::dvec3& p) { return p.z; });
  return block;
}

TEST_F(Seams, OfAPeriodicAxisCloseThoughRoundedDifferently) {
  const MappedBlock block = closedPipe(0.1f);
  ASSERT_NE(block.nodes.y[block.at(0, 2, 2)], block.nodes.y[block.at(128, 2, 2)]);
  const std::vector<Piece> out = merge(facesOf(block), 64 << 20, 4);
  EXPECT_EQ(merged_, 7u * 5u);

  // A node of the seam comes out as its neighbours around the pipe, up to the angle's square.
  const NodeSplats splats = block.splats();
  const NodeSplat& beside = splats.splats[block.at(1, 3, 2)];
  const auto seam = std::find_if(out.begin(), out.end(),
                                 [&](const Piece& piece) { return piece.node.node == block.at(0, 3, 2); });
  ASSERT_NE(seam, out.end());
  EXPECT_NEAR(seam->node.splat.weight / beside.splat.weight, 1, 1e-3);
  const auto found = singularValues(seam->node.splat.factor()),
             expected = singularValues(beside.splat.factor());
  for (int n = 0; n < 3; ++n) EXPECT_NEAR(found[n] / expected[n], 1, 2e-3);
}

TEST_F(Seams, OfAClosedRowOfThinLayersLeaveItAsIfItHadNeverBeenCut) {
  // Ten degrees apart, and layers of 2 m: moments of the two halves are 10,000 times as thick.
  constexpr int kAround = 36;
  MappedBlock block(kAround + 1, 5, 7, [](double i, double j, double k) {
    const double angle = 2 * M_PI / kAround * std::fmod(i, kAround), r = 6371 + 0.002 * k;
    return glm::dvec3(r * std::cos(angle), r * std::sin(angle), 100 * j);
  });
  block.addScalar([](const glm::dvec3& p) { return 10 + 500 * (std::hypot(p.x, p.y) - 6371); });
  const std::vector<Piece> out = merge(facesOf(block));
  EXPECT_EQ(merged_, 5u * 7u);
  const NodeSplats splats = block.splats();
  for (const uint64_t k : {2u, 3u, 4u}) {
    const size_t beside = block.at(5, 2, k);
    const auto seam = std::find_if(out.begin(), out.end(),
                                   [&](const Piece& piece) { return piece.node.node == block.at(0, 2, k); });
    ASSERT_NE(seam, out.end());
    EXPECT_EQ(seam->node.border_code, kNoBorder);
    const auto found = singularValues(seam->node.splat.factor()),
               expected = singularValues(splats.splats[beside].splat.factor());
    for (int n = 0; n < 3; ++n) EXPECT_NEAR(found[n] / expected[n], 1, 0.02) << n;
    EXPECT_NEAR(seam->value.mean, splats.values[beside].mean, 0.15);  // of layers that differ by 1
    EXPECT_NEAR(seam->node.splat.weight / splats.splats[beside].splat.weight, 1, 1e-3);
    EXPECT_NEAR(glm::length(seam->node.splat.position), glm::length(splats.splats[beside].splat.position), 1);
  }
}

TEST_F(Seams, OfAClosedRowEndAtItsFirstAndLastLayerAlone) {
  // Ten degrees apart on a sphere, and layers of 20 m: in the frame of a half cell the row of the other half points
  // across the layers.
  constexpr int kAround = 36;
  MappedBlock block(kAround + 1, 7, 9, [](double i, double j, double k) {
    const double angle = 2 * M_PI / kAround * std::fmod(i, kAround), latitude = M_PI / 18 * (j - 3),
                 r = 6371 + 0.02 * k;
    return r * glm::dvec3(std::cos(latitude) * std::cos(angle), std::cos(latitude) * std::sin(angle),
                          std::sin(latitude));
  });
  block.addScalar([](const glm::dvec3& p) { return 10 + 50 * (glm::length(p) - 6371); });
  const Places places = mergeBlocks({block});
  const NodeSplats splats = block.splats();
  for (const uint64_t j : {0u, 1u, 3u, 6u})
    for (const uint64_t k : {0u, 1u, 4u, 8u}) {
      const size_t beside = block.at(5, j, k);
      const auto at_seam = std::find_if(places.begin(), places.end(), [&](const auto& place) {
        return place.second.node.node == block.at(0, j, k);
      });
      ASSERT_NE(at_seam, places.end());
      const Piece* const seam = &at_seam->second;
      const InwardAxes ends = inwardAxes(seam->node.border_code),
                       expected_ends = inwardAxes(splats.splats[beside].border_code);
      EXPECT_EQ(ends.behind ? 0 : ends.count, expected_ends.behind ? 0 : expected_ends.count)
          << j << ' ' << k;
      const auto found = singularValues(seam->node.splat.factor()),
                 expected = singularValues(splats.splats[beside].splat.factor());
      for (int n = 0; n < 3; ++n) EXPECT_NEAR(found[n] / expected[n], 1, 0.03) << j << ' ' << k << ' ' << n;
      EXPECT_NEAR(seam->value.mean, splats.values[beside].mean, 0.15)
          << j << ' ' << k;  // of layers that differ by 1
    }
}

TEST_F(Seams, DoNotJoinTheNodesOfAWallLayer) {
  // Eight units in the last place apart: still the seam's 35 pairs and no others.
  merge(facesOf(closedPipe(1e-6f)), 64 << 20, 4);
  EXPECT_EQ(merged_, 7u * 5u);
  // In double precision, far below any float's rounding.
  MappedBlock thin(5, 9, 5, [](double i, double j, double k) { return glm::dvec3(100 + i, 1e-10 * j, k); });
  thin.addScalar(field);
  merge(facesOf(thin), 64 << 20, 4);
  EXPECT_EQ(merged_, 0u);
}

TEST_F(Seams, LeaveSinglesAsTheyAre) {
  const std::vector<Piece> faces = facesOf(affineBlock({0, 0, 0}, {3, 3, 3}, 10));
  std::vector<Piece> out = merge(faces);
  EXPECT_EQ(merged_, 0u);
  std::sort(out.begin(), out.end(), [](const Piece& a, const Piece& b) { return a.node.node < b.node.node; });
  for (size_t n = 0; n < faces.size(); ++n) {
    EXPECT_EQ(out[n].node.node, faces[n].node.node);
    EXPECT_EQ(out[n].node.splat.position, faces[n].node.splat.position);
    EXPECT_EQ(out[n].node.splat.axis, faces[n].node.splat.axis);
    EXPECT_TRUE(out[n].node.regular);
  }
}

TEST_F(Seams, JoinAPolarAxisIntoOneSplatANode) {
  MappedBlock block(25, 4, 6, [](double i, double j, double k) {
    return glm::dvec3(5 + 0.1 * j * std::cos(i * M_PI / 12), 0.1 * j * std::sin(i * M_PI / 12), 0.2 * k);
  });
  block.addScalar(field);
  const std::vector<Piece> out = merge(facesOf(block));
  EXPECT_EQ(merged_, 24u * 6u + 3 * 6u);
  size_t on_axis = 0;
  for (const Piece& piece : out) {
    if (piece.node.node_position.x != 5 || piece.node.node_position.y != 0) continue;
    ++on_axis;
    // The wedges around it are a prism of 24 sides, at half the distance to its neighbours.
    const bool at_end = piece.node.node_position.z == 0 || piece.node.node_position.z == 1;
    const double height = at_end ? 0.1 : 0.2;
    EXPECT_NEAR(piece.node.splat.weight, 12 * 0.05 * 0.05 * std::sin(M_PI / 12) * height, 1e-7);
    EXPECT_NEAR(piece.node.splat.position.x, 5, 1e-9);
    const auto sigma = singularValues(piece.node.splat.factor());
    EXPECT_NEAR(sigma[0], height, 1e-6);
    EXPECT_NEAR(sigma[2], std::sqrt(3.0) * 0.05, 1e-3);  // 12 times the variance of a disc
    EXPECT_TRUE(std::isfinite(glm::length(piece.value.slope)));
  }
  EXPECT_EQ(on_axis, 6u);
}

std::vector<Piece> randomFaces(size_t count, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Piece> faces(count);
  for (size_t n = 0; n < count; ++n) {
    NodeSplat& node = faces[n].node;
    node.node = n;
    node.on_block_face = true;
    node.regular = n % 3 == 0;
    node.spacing = 0.01;
    // Places on a lattice, each taken a few times: some exactly, others off by less than the tolerance.
    const double off = n % 2 == 0 ? 0.0 : 1e-6;
    const auto place = [&] { return 0.01 * std::floor(10 * unit(random)) + off * unit(random); };
    node.node_position = {place(), place(), place()};
    node.splat.position = node.node_position + glm::dvec3(1e-3 * unit(random));
    node.splat.weight = unit(random);
    faces[n].value = {unit(random), {unit(random), unit(random), unit(random)}, unit(random)};
  }
  return faces;
}

void expectIdentical(const std::vector<Piece>& a, const std::vector<Piece>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t n = 0; n < a.size(); ++n) {
    EXPECT_EQ(a[n].node.node, b[n].node.node);
    EXPECT_EQ(a[n].node.regular, b[n].node.regular);
    EXPECT_EQ(a[n].node.on_block_face, b[n].node.on_block_face);
    EXPECT_EQ(a[n].node.node_position, b[n].node.node_position);
    EXPECT_EQ(a[n].node.spacing, b[n].node.spacing);
    EXPECT_EQ(a[n].node.splat.position, b[n].node.splat.position);
    EXPECT_EQ(a[n].node.splat.axis, b[n].node.splat.axis);
    EXPECT_EQ(a[n].node.splat.shear, b[n].node.splat.shear);
    EXPECT_EQ(a[n].node.splat.weight, b[n].node.splat.weight);
    EXPECT_EQ(a[n].value.mean, b[n].value.mean);
    EXPECT_EQ(a[n].value.slope, b[n].value.slope);
    EXPECT_EQ(a[n].value.variance, b[n].value.variance);
  }
}

TEST_F(Seams, DependNeitherOnTheOrderNorOnTheMemory) {
  std::vector<Piece> faces = randomFaces(3000, 1);
  const std::vector<Piece> expected = merge(faces);
  EXPECT_GT(expected.size(), 900u);
  EXPECT_LE(expected.size(), 1000u);
  std::mt19937_64 random(2);
  for (const uint64_t memory_bytes : {uint64_t{1}, uint64_t{1000}, uint64_t{100000}, uint64_t{64} << 20}) {
    std::shuffle(faces.begin(), faces.end(), random);
    expectIdentical(merge(faces, memory_bytes), expected);
    EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  }
}

TEST_F(Seams, AreTheSameByManyThreads) {
  const auto by_node = [](std::vector<Piece> pieces) {
    std::ranges::sort(pieces, {}, [](const Piece& piece) { return piece.node.node; });
    return pieces;
  };
  const std::vector<Piece> faces = randomFaces(20000, 5);
  const std::vector<Piece> expected = by_node(merge(faces));
  const auto merged = merged_;
  for (const uint64_t memory_bytes : {uint64_t{100000}, uint64_t{64} << 20}) {
    SeamMerger seams(1, memory_bytes, folder_.path());
    addEach(seams, faces);
    Mutex mutex;
    std::vector<Piece> out;
    tbb::task_arena(8).execute([&] {
      EXPECT_EQ(seams.finishInParallel(8,
                                       [&](const NodeSplat& node, std::span<const SplatScalar> values) {
                                         const MutexLock lock(mutex);
                                         out.push_back({node, values[0]});
                                       }),
                merged);
    });
    expectIdentical(by_node(out), expected);
    EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  }
}

TEST_F(Seams, JoinACrowdInOnePoint) {
  std::vector<Piece> faces = randomFaces(100000, 3);
  double weight = 0;
  for (Piece& face : faces) {
    face.node.node_position = {0.1, 0.2, 0.3};
    weight += face.node.splat.weight;
  }
  const std::vector<Piece> out = merge(faces, 1 << 20);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_NEAR(out[0].node.splat.weight / weight, 1, 1e-9);
  EXPECT_EQ(out[0].node.node, 0u);

  // A collapsed block knows no spacing: exact coincidence counts.
  for (Piece& face : faces) face.node.spacing = 0;
  faces[77].node.node_position.x = std::nextafter(0.1, 1.0);
  EXPECT_EQ(merge(faces).size(), 2u);
}

TEST_F(Seams, OfNothingAreNothing) {
  EXPECT_TRUE(merge({}).empty());
}

TEST_F(Seams, SayWhenTheDiskIsFull) {
  struct FullDisk : SystemCalls {
    ssize_t pwrite(int, const void*, size_t, int64_t) override {
      errno = ENOSPC;
      return -1;
    }
  } full;
  const std::vector<Piece> faces = randomFaces(100, 4);
  const ScopedSystemCalls scope(full);
  SeamMerger seams(1, 1000, folder_.path());
  expectError([&] { addEach(seams, faces); }, {folder_.path().string()});
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

}  // namespace
}  // namespace curvisplat
