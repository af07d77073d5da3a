// How the splats of nodes are corrected where cells grow, shrink or bend: their places, lengths and means.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <vector>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/shape/shape.h"
#include "preprocess/splats/face_layers.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "tests/reference/mapped_block.h"

namespace curvisplat {
namespace {

// Spectral elements: neighbouring cells 1.6 times as long as one another, again and again. Splats at the
// nodes would lie at uneven distances, and a constant field would show stripes.
TEST(NodeSplats, OfAnUnevenGridTileIt) {
  const std::vector<double> x{0, 1, 2.6, 3.6, 4.3, 5.4, 6.1, 6.6};
  const MappedBlock grid(
      8, 3, 3, [&](double i, double j, double k) { return glm::dvec3(x[static_cast<size_t>(i)], j, k); });
  SplatCorrections corrections;
  corrections.stretch = false;
  const NodeSplats out = grid.splats(corrections);
  double end = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const NodeSplat& node = out.splats[grid.at(i, 1, 1)];
    EXPECT_NEAR(node.splat.position.x - 0.5 * node.splat.axis[0], end, 1e-12) << i;
    end = node.splat.position.x + 0.5 * node.splat.axis[0];
    EXPECT_NEAR(node.splat.position.y, 1, 1e-12);
  }
  EXPECT_NEAR(end, x.back(), 1e-12);
}

/// The middle of a node's cell between straight-edged cells, by sampling: with `on_face`, of the part that lies in the
/// plane k = 0.
glm::dvec3 sampledMiddle(const std::function<glm::dvec3(double, double, double)>& node, const glm::dvec3& at,
                         bool on_face) {
  constexpr int kSamples = 8;
  const auto trilinear = [&](const glm::dvec3& p) {
    const glm::dvec3 low = glm::floor(p), part = p - low;
    glm::dvec3 sum(0.0);
    for (int c = 0; c < 8; ++c) {
      const glm::dvec3 step(c & 1, c >> 1 & 1, c >> 2);
      const glm::dvec3 share = glm::mix(1.0 - part, part, step), corner = low + step;
      sum += share.x * share.y * share.z * node(corner.x, corner.y, corner.z);
    }
    return sum;
  };
  glm::dvec3 sum(0.0);
  double weight = 0;
  const int samples_k = on_face ? 1 : kSamples;
  for (int i = 0; i < kSamples; ++i)
    for (int j = 0; j < kSamples; ++j)
      for (int k = 0; k < samples_k; ++k) {
        constexpr double kStep = 1e-4;
        const auto from = [](int n) { return (n + 0.5) / kSamples - 0.5; };
        const double w = on_face ? 0 : at.z > 0 ? from(k) : 0.5 * (from(k) + 0.5);
        const glm::dvec3 p = at + glm::dvec3(from(i), from(j), w), here = trilinear(p);
        glm::dmat3 jacobian;
        for (int axis = 0; axis < 3; ++axis) {
          glm::dvec3 next = p;
          next[axis] += kStep;
          jacobian[axis] = (trilinear(next) - here) / kStep;
        }
        const double volume = std::abs(glm::determinant(jacobian));
        sum += volume * here;
        weight += volume;
      }
  return sum / weight;
}

// Few cells around a bend, as rays see them: polygons. The middles of cells lie on the inner side of their nodes, and
// the faces that splats are cut at on that of the face's nodes.
TEST(NodeSplats, OfABentGridLieInTheMiddleOfTheirKinkedCells) {
  const auto node = [](double i, double j, double k) {
    const double angle = 0.3 * i + 0.01 * i * i, radius = 3 + 0.3 * k;
    return glm::dvec3(radius * std::cos(angle), radius * std::sin(angle), 0.4 * j);
  };
  MappedBlock grid(7, 5, 6, node);
  grid.addScalar([](const glm::dvec3& p) { return p.x + 2 * p.y - p.z; });
  SplatCorrections corrections;
  corrections.stretch = corrections.growth = corrections.bends = false;
  const NodeSplats out = grid.splats(corrections);
  for (uint64_t k : {0, 1, 3}) {
    const size_t at = grid.at(3, 2, k);
    const Splat& splat = out.splats[at].splat;
    const glm::dvec3 expected = sampledMiddle(node, glm::dvec3(3, 2, k), false);
    EXPECT_LT(glm::distance(splat.position, expected), 0.005) << k;
    EXPECT_GT(glm::distance(splat.position, node(3, 2, std::max(k + 0.0, 0.25))), 0.03) << k;
    EXPECT_NEAR(out.values[at].mean, expected.x + 2 * expected.y - expected.z, 0.015) << k;
    if (k == 3) continue;
    // The plane that it is cut at.
    const InwardAxes inward = inwardAxes(out.splats[at].border_code);
    ASSERT_TRUE(inward.hasFace(0)) << k;
    const glm::dvec3 normal = glm::normalize(gradientOf(splat, glm::dvec3(inward.axis[0])));
    const double distance = inward.distance * glm::dot(normal, splat.factor() * glm::dvec3(inward.axis[0]));
    const glm::dvec3 on_face = sampledMiddle(node, glm::dvec3(3, 2, 0), true);
    EXPECT_NEAR(glm::dot(normal, splat.position - on_face), distance, 0.01) << k;
    EXPECT_GT(std::abs(glm::dot(normal, splat.position - node(3, 2, 0)) - distance), 0.03) << k;
  }
}

// The cells of OfAnUnevenGridTileIt: a splat's axes are stretched, its weight is the cell's, and so is its middle.
TEST(NodeSplats, OfAnUnevenGridAreStretchedButKeepVolumeAndMiddle) {
  const std::vector<double> x{0, 1, 2.6, 3.6, 4.6, 6.2, 7.2, 8.2, 9.8, 10.8, 11.8, 13.4, 14.4};
  MappedBlock grid(13, 5, 5, [&](double i, double j, double k) {
    return glm::dvec3(x[static_cast<size_t>(i)], j + 0.2 * x[static_cast<size_t>(i)], k);
  });
  grid.addScalar([](const glm::dvec3& p) { return p.x; });
  SplatCorrections corrections;
  corrections.stretch = false;
  SplatCorrections even;
  even.growth = false;
  const NodeSplats plain = grid.splats(corrections), stretched = grid.splats(even);
  EXPECT_NEAR(totalWeight(stretched) / totalWeight(plain), 1, 1e-12);
  for (uint64_t i = 0; i < 13; ++i) {
    const size_t n = grid.at(i, 2, 2);
    const Splat &before = plain.splats[n].splat, &after = stretched.splats[n].splat;
    const double s = after.axis[0] / before.axis[0];
    // Nodes between two elements of three steps have the smallest cells.
    if (i % 3 == 0) {
      EXPECT_GT(s, 1.05) << i;
    } else {
      EXPECT_LT(s, 0.99) << i;
    }
    EXPECT_NEAR(after.weight / before.weight, 1, 1e-12);
    // Across the stretched column the cell is as it was.
    EXPECT_NEAR(after.axis[1] / before.axis[1], 1, 1e-12);
    EXPECT_NEAR(after.shear[0], before.shear[0], 1e-12);
    // The middle of a half cell follows the stretch from the border on; others stay.
    const bool at_border = i == 0 || i == 12;
    const double moved = at_border ? (s - 1) * 0.5 * before.axis[0] * (i == 0 ? 1 : -1) : 0;
    EXPECT_NEAR(after.position.x, before.position.x + moved, 1e-12) << i;
    // The gradient stays.
    EXPECT_NEAR(stretched.values[n].slope.x / after.axis[0], plain.values[n].slope.x / before.axis[0], 1e-5);
    EXPECT_NEAR(stretched.values[n].mean, after.position.x, 1e-5);
  }
}

// Splats drift towards the larger cells, the scalar along with them; half cells stay.
TEST(NodeSplats, OfAGrowingGridDrift) {
  MappedBlock grid(13, 5, 5, [](double i, double j, double k) { return glm::dvec3(std::pow(1.2, i), j, k); });
  grid.addScalar([](const glm::dvec3& p) { return p.x; });
  SplatCorrections even;
  even.growth = false;
  const NodeSplats without = grid.splats(even), drifted = grid.splats();
  for (uint64_t i = 0; i < 13; ++i) {
    const size_t n = grid.at(i, 2, 2);
    const Splat &before = without.splats[n].splat, &after = drifted.splats[n].splat;
    const double moved = i == 0 || i == 12 ? 0 : static_cast<double>(kDrift) * std::log(1.2) * before.axis[0];
    EXPECT_NEAR(after.position.x, before.position.x + moved, 2e-3 * before.axis[0]) << i;
    EXPECT_EQ(after.weight, before.weight);
    EXPECT_NEAR(drifted.values[n].mean - without.values[n].mean, after.position.x - before.position.x,
                2e-3 * before.axis[0]);
  }
}

TEST(NodeSplats, BesideABlankAreStretchedAsAtTheEndOfABlock) {
  const auto x = [](double i) { return i + 0.3 * std::sin(2 * i); };
  const auto mapping = [&](double i, double j, double k) { return glm::dvec3(x(k), x(i), x(j)); };
  MappedBlock holed(9, 8, 14, mapping);
  for (uint64_t j = 0; j < 8; ++j)
    for (uint64_t i = 0; i < 9; ++i) holed.nodes.blank[holed.at(i, j, 8)] = 1;
  // Cells in the layers behind several faces are fitted to where they are cut; beside a blank there is no such layer.
  SplatCorrections corrections;
  corrections.layers = false;
  const NodeSplats found = holed.splats(corrections),
                   expected = MappedBlock(9, 8, 8, mapping).splats(corrections);
  for (size_t n = 0; n < expected.splats.size(); ++n) {
    EXPECT_EQ(found.splats[n].splat.axis, expected.splats[n].splat.axis) << n;
    EXPECT_EQ(found.splats[n].splat.weight, expected.splats[n].splat.weight) << n;
  }
}

// The weighted mean of tangents x² about the nodes: at a node it must be the node's own value, wherever the
// cells grow.
/// The volume of the cells all of whose nodes are there.
double volumeOf(const MappedBlock& grid) {
  const GridBlock& block = grid.block;
  double volume = 0;
  for (uint64_t k = 0; k + 1 < block.nk; ++k)
    for (uint64_t j = 0; j + 1 < block.nj; ++j)
      for (uint64_t i = 0; i + 1 < block.ni; ++i) {
        const size_t at = grid.at(i, j, k);
        if (cornerMarks(grid.nodes.blank.data(), at, block.ni, block.ni * block.nj) != 0) continue;
        volume += Hexahedron(cornersAt(grid.nodes.x.data(), grid.nodes.y.data(), grid.nodes.z.data(), at,
                                       block.ni, block.ni * block.nj))
                      .volume();
      }
  return std::abs(volume);
}

TEST(NodeSplats, WeighAsMuchAsTheGrid) {
  const auto radius = [](double n) { return 1 + 0.01 * std::expm1(0.35 * n) / 0.35; };
  const std::vector<MappedBlock> grids{
      // A wall from which cells grow, around a sphere and beyond.
      {13, 9, 15,
       [&](double i, double j, double k) {
         const double a = 0.2 * i, b = 0.25 * (j - 4);
         return radius(k) * glm::dvec3(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b));
       }},
      // Rows that wind along field lines, with a twist in each cell.
      {9, 21, 9,
       [](double i, double j, double k) {
         const double r = 1 + 0.1 * i, a = 0.3 * j + 0.1 * r * k;
         return glm::dvec3(r * std::cos(a), r * std::sin(a), 0.5 * k);
       }},
      // Layers over a mountain.
      {12, 11, 10, [](double i, double j, double k) {
         const double ground = 3 * std::exp(-0.1 * ((i - 5) * (i - 5) + (j - 5) * (j - 5)));
         return glm::dvec3(i, j, ground + 0.1 * k * (5 - ground));
       }}};
  for (MappedBlock grid : grids) {
    EXPECT_NEAR(totalWeight(grid.splats()) / volumeOf(grid), 1, 1e-4);
    for (uint64_t k = 3; k < 6; ++k)
      grid.nodes.blank[grid.at(4, 5, k)] = grid.nodes.blank[grid.at(0, 3, k)] = 1;
    EXPECT_NEAR(totalWeight(grid.splats()) / volumeOf(grid), 1, 1e-4);
  }
}

TEST(NodeSplats, OfSteepTerrainLieInTheirColumns) {
  // Layers of 0.5 over hills: grid lines along i and j are up to four times as long as others, and all cells have one volume. Fitted
  // to the lines' lengths, splats moved aside by a fifth of a cell, and an even medium looked mottled from above: by 10 %.
  MappedBlock grid(14, 13, 12, [](double i, double j, double k) {
    return glm::dvec3(i, j, 4 * std::sin(0.9 * i) * std::cos(0.8 * j) + 0.5 * k);
  });
  const NodeSplats out = grid.splats();
  for (uint64_t k = 3; k < 9; ++k)
    for (uint64_t j = 3; j < 10; ++j)
      for (uint64_t i = 3; i < 11; ++i) {
        const Splat& splat = out.splats[grid.at(i, j, k)].splat;
        EXPECT_NEAR(splat.position.x, static_cast<double>(i), 1e-9);
        EXPECT_NEAR(splat.position.y, static_cast<double>(j), 1e-9);
        EXPECT_NEAR(splat.axis[0] * splat.axis[1] * splat.axis[2], 0.5, 1e-9);
      }
}

TEST(NodeSplats, OfThinLayersThatBendKeepTheirValues) {
  // Layers of 1 km on a sphere, 5 degrees apart: they bend by 24 of their cells along either axis.
  MappedBlock grid(9, 9, 9, [](double i, double j, double k) {
    const double a = M_PI / 36 * i, b = M_PI / 36 * (j - 4);
    return (6371 + k) * glm::dvec3(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b));
  });
  grid.addScalar([](const glm::dvec3& p) { return glm::length(p) - 6371; });
  const NodeSplats out = grid.splats();
  for (uint64_t k = 1; k < 8; ++k)
    EXPECT_NEAR(out.values[grid.at(4, 4, k)].mean, static_cast<double>(k), 0.25) << k;
}

TEST(NodeSplats, MeansMakeUpForWhatTangentsMiss) {
  for (const double growth : {1.0, 1.1}) {
    const auto x = [&](double i) { return growth == 1 ? i : (std::pow(growth, i) - 1) / (growth - 1); };
    MappedBlock block(9, 5, 5, [&](double i, double j, double k) { return glm::dvec3(x(i), j, k); });
    block.addScalar([](const glm::dvec3& p) { return p.x * p.x; });
    const NodeSplats splats = block.splats();
    for (uint64_t i = 1; i + 1 < 9; ++i) {
      const size_t n = block.at(i, 2, 2);
      const Splat& splat = splats.splats[n].splat;
      const double spacing = splat.axis[0], here = splat.position.x;
      // Half the second derivative, 1, times the kernel's variance.
      EXPECT_NEAR(splats.values[n].mean, here * here + 0.1994 * spacing * spacing,
                  growth == 1 ? 1e-4 * here * here : 0.02 * spacing * spacing)
          << growth << " " << i;
    }
  }
}

TEST(NodeSplats, MeansStayWithinTheNeighboursValues) {
  MappedBlock block(9, 9, 9, [](double i, double j, double k) { return glm::dvec3(i, j, k); });
  block.addScalar([](const glm::dvec3& p) { return p.x + p.y > 8 ? 1.0 : 0.0; });
  for (const SplatScalar& value : block.splats().values) {
    EXPECT_GE(value.mean, 0);
    EXPECT_LE(value.mean, 1);
  }
}

/// Nodes at distances of 1 along i and j, the last half as far; along k they are even.
MappedBlock withShortLastCells() {
  const auto at = [](double n) { return n < 9 ? n : 8.5; };
  return {10, 10, 9, [at](double i, double j, double k) { return glm::dvec3(at(i), at(j), k); }};
}

/// How far beyond the upper face of i the renderer takes the face to be that the node at (8, j, k) is behind.
double beyondFace(const MappedBlock& grid, const SplatRules& rules, uint64_t j, uint64_t k) {
  const NodeSplat node = grid.splats({}, rules).splats[grid.at(8, j, k)];
  EXPECT_NE(layersOf(node.border_code), 0u);
  const CellGrowth growth = cellGrowth(node.growth_code);
  float inwards = 0;
  for (size_t n = 0; n < 3; ++n)
    if (growth.growth[n] != 0) inwards -= growth.growth[n] * growth.axis[n].x;
  return node.splat.position.x + node.splat.axis[0] * static_cast<double>(layerDistance(inwards)) - 8.5;
}

// Codes of cells behind several faces have no distances.
TEST(NodeSplats, BehindSeveralFacesAreCutAtThem) {
  const MappedBlock grid = withShortLastCells();
  SplatRules earlier;
  earlier.steep = false;
  for (const auto& [j, k] : {std::pair<uint64_t, uint64_t>{8, 4}, {4, 1}, {4, 0}}) {
    EXPECT_GT(beyondFace(grid, earlier, j, k), 0.08) << j << " " << k;
    EXPECT_LT(std::abs(beyondFace(grid, {}, j, k)), 0.055) << j << " " << k;
  }
}

TEST(NodeSplats, BehindOneFaceAndElsewhereStayAsTheyAre) {
  const MappedBlock grid = withShortLastCells();
  SplatRules earlier;
  earlier.steep = false;
  const NodeSplats before = grid.splats({}, earlier), after = grid.splats();
  for (const auto& [i, j] : {std::pair<uint64_t, uint64_t>{8, 4}, {9, 4}, {4, 4}, {7, 5}}) {
    const NodeSplat &a = before.splats[grid.at(i, j, 4)], &b = after.splats[grid.at(i, j, 4)];
    EXPECT_EQ(a.splat.axis, b.splat.axis) << i << " " << j;
    EXPECT_EQ(a.splat.position, b.splat.position) << i << " " << j;
    EXPECT_EQ(a.growth_code, b.growth_code) << i << " " << j;
  }
}

TEST(NodeSplats, BehindSeveralFacesHaveTheVolume) {
  const MappedBlock grid = withShortLastCells();
  double volume = 0;
  for (const NodeSplat& node : grid.splats().splats) volume += node.splat.weight;
  EXPECT_NEAR(volume, 8.5 * 8.5 * 8, 1e-9);
}

/// A line across a face: of the half cell at it, or of the cell one away.
JointLine lineOfSteps(const std::array<double, 6>& steps, bool at_face) {
  std::array<double, 7> x{};
  for (size_t n = 0; n < steps.size(); ++n) x[n + 1] = x[n] + steps[n];
  const std::array<double, 7> zero{};
  const NodePositions nodes{x.data(), zero.data(), zero.data()};
  const int before = at_face ? 0 : 1;
  return JointLine::ofExtents(extentsOnLine({nodes}, before, 1, before, kStretchReach),
                              at_face ? 0.5 * steps[0] : 0.5 * (steps[0] + steps[1]));
}

TEST(LayerFit, LeavesCellsThatFitAlone) {
  // Even cells, elements of three steps, and cells that grow from the face inwards and towards it.
  for (const std::array<double, 6>& steps : {std::array<double, 6>{1, 1, 1, 1, 1, 1},
                                             {1, 1.618, 1, 1, 1.618, 1},
                                             {1, 1.2, 1.44, 1.728, 2.074, 2.488},
                                             {1, 0.8, 0.64, 0.512, 0.41, 0.328}}) {
    EXPECT_EQ(fitBehindFace(lineOfSteps(steps, false)).factor, 1);
    EXPECT_EQ(fitBehindFace(lineOfSteps(steps, false)).drift, 0);
    EXPECT_EQ(fitAtFace(lineOfSteps(steps, true)).factor, 1);
  }
}

TEST(LayerFit, IsTheSameOfBothCellsAtAFace) {
  for (const std::array<double, 6>& steps :
       {std::array<double, 6>{0.5, 1, 1, 1, 1, 1}, {1.5, 3, 1.58, 0.83, 0.44, 0.23}}) {
    const LayerFit behind = fitBehindFace(lineOfSteps(steps, false)),
                   at = fitAtFace(lineOfSteps(steps, true));
    EXPECT_NEAR(behind.drift, 0.016, 0.001);
    EXPECT_NEAR(at.growth, behind.growth / 1.25, 0.005);
  }
  EXPECT_GT(fitBehindFace(lineOfSteps({1e-9, 1, 1, 1, 1, 1}, false)).factor, 0.9);
}

}  // namespace
}  // namespace curvisplat
