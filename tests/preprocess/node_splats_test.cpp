#include "preprocess/splats/node_splats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <random>

#include "preprocess/shape/shape.h"
#include "stream/model/border_code.h"
#include "tests/reference/mapped_block.h"

namespace curvisplat {
namespace {

/// ‖A Aᵀ - J Jᵀ‖ relative to ‖J Jᵀ‖.
double covarianceError(const Splat& splat, const glm::dmat3& jacobian) {
  const glm::dmat3 a = splat.factor();
  const glm::dmat3 expected = jacobian * glm::transpose(jacobian), found = a * glm::transpose(a);
  double error = 0, size = 0;
  for (int n = 0; n < 9; ++n) {
    error = std::max(error, std::abs(found[n / 3][n % 3] - expected[n / 3][n % 3]));
    size = std::max(size, std::abs(expected[n / 3][n % 3]));
  }
  return error / size;
}

bool sameSplat(const NodeSplats& a, const NodeSplats& b, size_t n, size_t m) {
  const Splat &s = a.splats[n].splat, &t = b.splats[m].splat;
  return a.splats[n].node == b.splats[m].node && a.splats[n].regular == b.splats[m].regular &&
         a.splats[n].on_block_face == b.splats[m].on_block_face &&
         a.splats[n].node_position == b.splats[m].node_position &&
         a.splats[n].spacing == b.splats[m].spacing && s.position == t.position && s.axis == t.axis &&
         s.shear == t.shear && s.weight == t.weight && a.values[n].mean == b.values[m].mean &&
         a.values[n].slope == b.values[m].slope;
}

TEST(NodeSplats, OfAnAffineGridAreItsCellsAndSumToItsVolume) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 20; ++n) {
    glm::dmat3 jacobian(1.0);
    for (int column = 0; column < 3 && n > 0; ++column)
      jacobian[column] = glm::dvec3(normal(random), normal(random), normal(random));
    const glm::dvec3 origin(normal(random), 10, -3);
    const MappedBlock grid(
        5, 4, 6, [&](double i, double j, double k) { return origin + jacobian * glm::dvec3(i, j, k); });
    const NodeSplats out = grid.splats();
    ASSERT_EQ(out.splats.size(), 120u);
    const double determinant = glm::determinant(jacobian);
    EXPECT_NEAR(totalWeight(out) / std::abs(4 * 3 * 5 * determinant), 1, 1e-9);
    EXPECT_EQ(out.right_handed, determinant > 0 ? 120u : 0u);
    EXPECT_EQ(out.left_handed, determinant > 0 ? 0u : 120u);
    EXPECT_EQ(out.degenerate, 0u);

    const NodeSplat& inner = out.splats[grid.at(2, 1, 3)];
    EXPECT_EQ(inner.node, grid.at(2, 1, 3));
    EXPECT_TRUE(inner.regular);
    EXPECT_FALSE(inner.on_block_face);
    EXPECT_LT(glm::distance(inner.splat.position, origin + jacobian * glm::dvec3(2, 1, 3)), 1e-13);
    EXPECT_LT(covarianceError(inner.splat, jacobian), 1e-13);

    // A node of the edge i = 4, k = 0: half cells along i and k.
    const NodeSplat& edge = out.splats[grid.at(4, 1, 0)];
    EXPECT_TRUE(edge.on_block_face);
    const glm::dmat3 quarter(0.5 * jacobian[0], jacobian[1], 0.5 * jacobian[2]);
    EXPECT_LT(covarianceError(edge.splat, quarter), 1e-12);
    EXPECT_NEAR(edge.splat.weight, std::abs(determinant) / 4, 1e-9);
    EXPECT_LT(glm::distance(edge.splat.position, origin + jacobian * glm::dvec3(3.75, 1, 0.25)), 1e-13);
    EXPECT_NEAR(edge.spacing,
                std::min({glm::length(jacobian[0]), glm::length(jacobian[1]), glm::length(jacobian[2])}),
                1e-13);
  }
}

glm::dvec3 halfAnnulus(double u, double v, double w) {
  const double theta = M_PI * u, r = 0.3 + 0.7 * std::expm1(2.5 * v) / std::expm1(2.5);
  return {-r * std::sin(theta), r * std::cos(theta), w + 0.15 * r * std::sin(3 * theta)};
}

TEST(NodeSplats, OfTheHalfAnnulusSumToItsVolume) {
  const MappedBlock grid(65, 33, 33,
                         [](double i, double j, double k) { return halfAnnulus(i / 64, j / 32, k / 32); });
  EXPECT_NEAR(totalWeight(grid.splats()) / (M_PI / 2 * (1 - 0.09)), 1, 0.01);
}

TEST(NodeSplats, OfALinearFieldCarryItExactly) {
  // On any grid, half cells included: the mean is the field at the splat's centre and the slope is Aᵀ∇f.
  const glm::dvec3 gradient(0.5, -2, 0.25);
  const auto field = [&](const glm::dvec3& p) { return 1.5 + glm::dot(gradient, p); };
  MappedBlock grid(12, 7, 9, [](double i, double j, double k) { return halfAnnulus(i / 11, j / 6, k / 8); });
  grid.addScalar([](const glm::dvec3& p) { return p.x; });
  grid.addScalar(field);
  const NodeSplats out = grid.splats();
  ASSERT_EQ(out.values.size(), 2 * out.splats.size());
  for (size_t n = 0; n < out.splats.size(); ++n) {
    const Splat& splat = out.splats[n].splat;
    const SplatScalar& value = out.values[2 * n + 1];
    EXPECT_NEAR(value.mean, field(splat.position), 1e-6);
    EXPECT_LT(glm::distance(value.slope, glm::transpose(splat.factor()) * gradient), 1e-6);
    EXPECT_EQ(value.variance, 0);
    EXPECT_NEAR(out.values[2 * n].mean, splat.position.x, 1e-6);
  }
}

TEST(NodeSplats, BesideBlankedNodesAreHalfCells) {
  MappedBlock grid(7, 7, 7, [](double i, double j, double k) { return glm::dvec3(i, j, k); });
  grid.addScalar([](const glm::dvec3& p) { return p.x; });
  const size_t hole = grid.at(3, 3, 3);
  grid.nodes.blank[hole] = 1;
  grid.nodes.x[hole] = grid.nodes.y[hole] = NAN;
  grid.nodes.scalars[0][hole] = INFINITY;
  const NodeSplats out = grid.splats();
  ASSERT_EQ(out.splats.size(), 342u);
  EXPECT_TRUE(allFinite(out));
  // The eight cells around it are not there; older caches kept what is in the pieces of nodes across an edge or a corner.
  EXPECT_NEAR(totalWeight(out), 216 - 8, 1e-12);
  SplatRules older;
  older.octants = older.dual_cells = false;
  EXPECT_NEAR(totalWeight(grid.splats({}, older)), 216 - 1 - 6 * 0.5, 1e-12);

  const NodeSplat& above = out.splats[grid.at(3, 3, 4) - 1];
  ASSERT_EQ(above.node, grid.at(3, 3, 4));
  EXPECT_EQ(above.splat.position, glm::dvec3(3, 3, 4.25));
  EXPECT_EQ(above.splat.axis, (std::array{1.0, 1.0, 0.5}));
  const InwardAxes inward = inwardAxes(above.border_code);
  ASSERT_EQ(inward.count, 1);
  EXPECT_LT(glm::distance(inward.axis[0], glm::vec3(0, 0, 1)), 0.01f);
  EXPECT_FALSE(above.on_block_face);
  const NodeSplat& before = out.splats[grid.at(2, 3, 3)];
  EXPECT_EQ(before.splat.position, glm::dvec3(1.75, 3, 3));
  EXPECT_EQ(out.values[grid.at(2, 3, 3)].mean, 1.75);
  EXPECT_EQ(out.values[grid.at(2, 3, 3)].slope, glm::dvec3(0.5, 0, 0));
}

TEST(NodeSplats, BehindABlocksFaceKnowHowFarItIs) {
  const glm::dmat3 jacobian(glm::dvec3(2, 0.3, 0), glm::dvec3(-0.5, 0.1, 0.2), glm::dvec3(0.1, 0, 1));
  MappedBlock grid(6, 5, 3, [&](double i, double j, double k) {
    return jacobian * glm::dvec3(i, j < 1 ? 0 : 0.5 + 0.5 * j, k);  // at 0, 1, 1.5, 2, 2.5
  });
  SplatCorrections corrections;
  corrections.stretch = false;  // the splats are then as long as the cells
  const NodeSplats out = grid.splats(corrections);
  const auto expectBehind = [&](size_t at, size_t face, const glm::dvec3& along, double distance) {
    const NodeSplat& node = out.splats[at];
    const InwardAxes inward = inwardAxes(node.border_code);
    ASSERT_TRUE(inward.behind) << at;
    EXPECT_TRUE(node.behind_face);
    EXPECT_FALSE(node.on_block_face);
    EXPECT_EQ(node.node_position, out.splats[face].node_position);
    EXPECT_EQ(node.spacing, out.splats[face].spacing);
    const glm::dvec3 expected = glm::normalize(glm::inverse(node.splat.factor()) * along);
    EXPECT_LT(glm::distance(glm::dvec3(inward.axis[0]), expected), 0.02) << at;
    EXPECT_NEAR(inward.distance, distance, 0.01) << at;
  };
  expectBehind(grid.at(1, 2, 1), grid.at(0, 2, 1), jacobian[0], 1);
  expectBehind(grid.at(4, 2, 1), grid.at(5, 2, 1), -jacobian[0], 1);
  // The cell reaches from 0.5 to 1.25, and its middle lies at 7/8.
  expectBehind(grid.at(2, 1, 1), grid.at(2, 0, 1), jacobian[1], 0.875 / 0.75);
  EXPECT_EQ(out.splats[grid.at(2, 2, 1)].border_code, kNoBorder);
  EXPECT_FALSE(out.splats[grid.at(2, 2, 1)].behind_face);
  EXPECT_FALSE(inwardAxes(out.splats[grid.at(0, 1, 1)].border_code).behind);
}

TEST(NodeSplats, BehindSeveralFacesKnowAllOfThem) {
  const glm::dmat3 jacobian(glm::dvec3(2, 0.3, 0), glm::dvec3(-0.5, 0.1, 0.2), glm::dvec3(0.1, 0, 1));
  MappedBlock grid(6, 5, 4, [&](double i, double j, double k) { return jacobian * glm::dvec3(i, j, k); });
  const NodeSplats out = grid.splats();
  // Where the node is, and along i, j and k: 2 at a face, 1 behind one.
  const struct {
    std::array<uint64_t, 3> node;
    std::array<int, 3> along;
  } cases[] = {{{1, 1, 2}, {1, 1, -1}},  {{0, 1, 1}, {2, 1, 1}},  {{5, 0, 2}, {-2, 2, -1}},
               {{2, 3, 2}, {0, -1, -1}}, {{2, 4, 1}, {0, -2, 1}}, {{0, 2, 0}, {2, 0, 2}},
               {{4, 2, 0}, {-1, 0, 2}}};
  for (const auto& at : cases) {
    const size_t n = grid.at(at.node[0], at.node[1], at.node[2]);
    const NodeSplat& node = out.splats[n];
    const InwardAxes inward = inwardAxes(node.border_code);
    const uint32_t all_layers = layersOf(node.border_code);
    int found = 0, layers = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (at.along[axis] == 0) continue;
      const bool is_layer = std::abs(at.along[axis]) == 1;
      const double side = at.along[axis] < 0 ? -1 : 1;
      const glm::dvec3 expected = glm::normalize(glm::inverse(node.splat.factor()) * (side * jacobian[axis]));
      for (int m = 0; m < 3; ++m) {
        if (is_layer ? (all_layers >> m & 1) == 0 : m >= inward.count || !inward.hasFace(m)) continue;
        if (glm::distance(glm::dvec3(inward.axis[m]), expected) > 0.02) continue;
        ++found;
        EXPECT_EQ(latticeAxis(node.layers, m), is_layer ? axis : -1);
      }
      if (!is_layer) continue;
      ++layers;
      std::array<uint64_t, 3> beside = at.node;
      beside[axis] = side < 0 ? beside[axis] + 1 : beside[axis] - 1;
      const NodeSplat& face = out.splats[grid.at(beside[0], beside[1], beside[2])];
      EXPECT_TRUE(std::any_of(out.probes.begin(), out.probes.end(), [&](const NodeSplats::Probe& probe) {
        return probe.splat == n && probe.probe.axis == axis && probe.probe.face_node == face.node_position &&
               probe.probe.spacing == face.spacing;
      }));
    }
    EXPECT_EQ(found, std::count_if(at.along.begin(), at.along.end(), [](int along) { return along != 0; }))
        << n;
    EXPECT_EQ(std::popcount(all_layers), layers);
    EXPECT_EQ(std::count_if(out.probes.begin(), out.probes.end(),
                            [&](const auto& probe) { return probe.splat == n; }),
              layers);
  }
}

TEST(NodeSplats, AwayFromABlankAreAsWithoutIt) {
  MappedBlock grid(9, 8, 7, [](double i, double j, double k) { return halfAnnulus(i / 8, j / 7, k / 6); });
  grid.addScalar([](const glm::dvec3& p) { return p.x * p.y; });
  const NodeSplats whole = grid.splats();
  grid.nodes.blank[grid.at(4, 4, 3)] = 1;
  const NodeSplats holed = grid.splats();
  EXPECT_EQ(holed.splats.size(), whole.splats.size() - 1);
  for (size_t n = 0; n < holed.splats.size(); ++n) {
    const uint64_t node = holed.splats[n].node;
    const std::array<uint64_t, 3> index{node % 9, node / 9 % 8, node / 72}, hole{4, 4, 3};
    uint64_t steps = 0, axes = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const uint64_t away = std::max(index[axis], hole[axis]) - std::min(index[axis], hole[axis]);
      steps += away;
      axes += away > 0;
    }
    const bool touches = steps == axes;  // is a node of one of the cells around it
    // On its grid lines, extents next to it count in others; nowhere else.
    if (touches) {
      EXPECT_FALSE(sameSplat(holed, whole, n, node)) << node;
    } else if (axes > 1) {
      EXPECT_TRUE(sameSplat(holed, whole, n, node)) << node;
    }
  }
}

TEST(NodeSplats, WithoutNeighboursHaveNoVolumeButAreThere) {
  MappedBlock grid(3, 3, 3, [](double i, double j, double k) { return glm::dvec3(i, j, k); });
  grid.addScalar([](const glm::dvec3& p) { return p.y; });
  std::fill(grid.nodes.blank.begin(), grid.nodes.blank.end(), 1);
  grid.nodes.blank[grid.at(1, 1, 1)] = 0;
  const NodeSplats out = grid.splats();
  ASSERT_EQ(out.splats.size(), 1u);
  EXPECT_TRUE(allFinite(out));
  EXPECT_EQ(out.splats[0].splat.weight, 0);
  EXPECT_EQ(out.splats[0].splat.position, glm::dvec3(1, 1, 1));
  EXPECT_EQ(out.values[0].mean, 1);
  EXPECT_EQ(out.degenerate, 1u);
}

TEST(NodeSplats, DoNotDependOnTheWindow) {
  // Cells are uneven, so that each is stretched by its neighbours.
  const auto uneven = [](double n) { return n + 0.2 * std::sin(2 * n); };
  MappedBlock grid(8, 13, 14, [&](double i, double j, double k) {
    return halfAnnulus(uneven(i) / 8, uneven(j) / 13, uneven(k) / 14);
  });
  grid.addScalar([](const glm::dvec3& p) { return p.z; });
  grid.first_node = 1000;
  grid.nodes.blank[grid.at(5, 3, 4)] = grid.nodes.blank[grid.at(0, 12, 13)] = 1;
  const NodeSplats whole = grid.splats();

  NodeScratch scratch;
  NodeSplats part;
  size_t seen = 0;
  for (uint64_t k = 0; k < 14; ++k) {
    for (const auto& [j0, j1] : {std::pair<uint64_t, uint64_t>{0, 6}, {6, 13}}) {
      const NodeBox window{
          j0 - std::min(j0, kNodeSplatHalo.before), std::min<uint64_t>(j1 + kNodeSplatHalo.after, 13),
          k - std::min(k, kNodeSplatHalo.before), std::min<uint64_t>(k + 1 + kNodeSplatHalo.after, 14)};
      NodeArrays rows;
      rows.scalars.resize(1);
      for (uint64_t wk = window.k0; wk < window.k1; ++wk) {
        for (uint64_t wj = window.j0; wj < window.j1; ++wj) {
          for (uint64_t i = 0; i < 8; ++i) {
            const size_t at = grid.at(i, wj, wk);
            rows.x.push_back(grid.nodes.x[at]);
            rows.y.push_back(grid.nodes.y[at]);
            rows.z.push_back(grid.nodes.z[at]);
            rows.blank.push_back(grid.nodes.blank[at]);
            rows.scalars[0].push_back(grid.nodes.scalars[0][at]);
          }
        }
      }
      computeNodeSplats({grid.block, grid.first_node, window, &rows}, {j0, j1, k, k + 1}, scratch, part);
      for (size_t n = 0; n < part.splats.size(); ++n) {
        const auto found = std::lower_bound(whole.splats.begin(), whole.splats.end(), part.splats[n].node,
                                            [](const NodeSplat& a, uint64_t node) { return a.node < node; });
        ASSERT_NE(found, whole.splats.end());
        EXPECT_TRUE(sameSplat(part, whole, n, static_cast<size_t>(found - whole.splats.begin())));
        ++seen;
      }
    }
  }
  EXPECT_EQ(seen, whole.splats.size());
  EXPECT_EQ(whole.splats.front().node, 1000u);
}

TEST(NodeSplats, OfPartsOfRowsAreThoseOfTheWhole) {
  const auto uneven = [](double n) { return n + 0.2 * std::sin(2 * n); };
  MappedBlock grid(23, 5, 6, [&](double i, double j, double k) {
    return halfAnnulus(uneven(i) / 23, uneven(j) / 5, uneven(k) / 6);
  });
  grid.addScalar([](const glm::dvec3& p) { return p.z * p.x; });
  grid.nodes.blank[grid.at(11, 3, 4)] = 1;
  const NodeSplats whole = grid.splats();
  NodeScratch scratch;
  NodeSplats part;
  for (const uint64_t nodes : {1u, 2u, 5u, 16u, 22u}) {
    std::vector<size_t> seen(whole.splats.size());
    for (uint64_t i0 = 0; i0 < 23; i0 += nodes) {
      // Half of them of windows that have no more than the part and its halo.
      BlockWindow window = grid.window();
      window.i0 = i0;
      window.i1 = i0 + nodes;
      NodeArrays cut;
      if (i0 / nodes % 2 == 0) {
        window = cutWindow(grid.window(), i0, i0 + nodes, kNodeSplatHalo, cut);
      }
      computeNodeSplats(window, {0, 5, 0, 6}, scratch, part);
      for (size_t n = 0; n < part.splats.size(); ++n) {
        const auto found = std::lower_bound(whole.splats.begin(), whole.splats.end(), part.splats[n].node,
                                            [](const NodeSplat& a, uint64_t node) { return a.node < node; });
        ASSERT_NE(found, whole.splats.end());
        EXPECT_TRUE(sameSplat(part, whole, n, static_cast<size_t>(found - whole.splats.begin())));
        ++seen[static_cast<size_t>(found - whole.splats.begin())];
      }
    }
    EXPECT_EQ(std::count(seen.begin(), seen.end(), 1u), static_cast<ptrdiff_t>(seen.size())) << nodes;
  }
}

TEST(NodeSplats, OnAPolarAxisHaveTheVolumeAndShapeOfTheirWedges) {
  MappedBlock grid(13, 5, 4, [](double i, double j, double k) {
    return glm::dvec3(j * std::cos(i * M_PI / 6), j * std::sin(i * M_PI / 6), k);
  });
  grid.addScalar([](const glm::dvec3& p) { return p.x; });
  const NodeSplats out = grid.splats();
  EXPECT_TRUE(allFinite(out));
  EXPECT_EQ(out.degenerate, 0u);
  EXPECT_NEAR(totalWeight(out), 12 * 0.5 * 16 * std::sin(M_PI / 6) * 3, 1e-9);
  // Between two straight sides and half way along the chord: a triangle of the height 1/2 cos(15 degrees).
  const NodeSplat& axis = out.splats[grid.at(3, 0, 1)];
  EXPECT_NEAR(axis.splat.weight, 0.25 * 0.5 * std::sin(M_PI / 6), 1e-9);
  EXPECT_NEAR(singularValues(axis.splat.factor())[0], 1, 1e-9);
  EXPECT_NEAR(glm::length(glm::dvec2(axis.splat.position)), 2.0 / 3 * 0.5 * std::cos(M_PI / 12), 0.02);
  const InwardAxes inward = inwardAxes(out.splats[grid.at(3, 0, 0)].border_code);
  ASSERT_EQ(inward.count, 1);  // at the block's lower end, but not across the axis
  EXPECT_GT(glm::normalize(out.splats[grid.at(3, 0, 0)].splat.factor() * glm::dvec3(inward.axis[0])).z, 0.99);
}

TEST(NodeSplats, AtAPoleThatIsNoPointStayAmongTheSamples) {
  // The cosine of 90 degrees is 6e-17: the nodes of the first row lie 4e-13 km from the axis, and a component of the wind
  // differs from one to the next.
  MappedBlock grid(25, 5, 3, [](double i, double j, double k) {
    const double east = i * M_PI / 12, north = M_PI / 2 - j * M_PI / 240, r = 6371 + 2 * k;
    return glm::dvec3(r * std::cos(north) * std::cos(east), r * std::cos(north) * std::sin(east),
                      r * std::sin(north));
  });
  std::vector<float>& wind = grid.nodes.scalars.emplace_back();
  for (size_t n = 0; n < grid.block.nodes(); ++n)
    wind.push_back(static_cast<float>(std::sin(static_cast<double>(n % 25) * M_PI / 12)));
  const NodeSplats out = grid.splats();
  EXPECT_EQ(out.degenerate, 0u);
  for (size_t n = 0; n < out.splats.size(); ++n) {
    EXPECT_LE(std::abs(out.values[n].mean), 1) << n;
    EXPECT_LE(glm::length(out.values[n].slope), 2) << n;
  }
  const SplatScalar& pole = out.values[grid.at(6, 0, 1)];
  EXPECT_LT(glm::length(pole.slope), 0.1) << "it is 1 there, and around it along j and k";
}

TEST(NodeSplats, OnAPolarAxisWereFlooredAndHadNoVolume) {
  MappedBlock grid(13, 5, 4, [](double i, double j, double k) {
    return glm::dvec3(j * std::cos(i * M_PI / 6), j * std::sin(i * M_PI / 6), k);
  });
  grid.addScalar([](const glm::dvec3& p) { return p.x; });
  SplatRules older;
  older.dual_cells = false;
  const NodeSplats out = grid.splats({}, older);
  EXPECT_TRUE(allFinite(out));
  EXPECT_EQ(out.degenerate, 13u * 4u);
  for (const NodeSplat& node : out.splats) {
    const auto sigma = singularValues(node.splat.factor());
    const bool on_axis = node.node / 13 % 5 == 0;
    EXPECT_EQ(node.regular, !on_axis);
    EXPECT_EQ(node.splat.weight == 0, on_axis);
    EXPECT_NEAR(sigma[2] / sigma[0] / kAxisFloor, on_axis ? 1 : sigma[2] / sigma[0] / kAxisFloor, 1e-6);
  }
}

TEST(NodeSplats, OfBlocksWithoutThicknessOrExtentAreFinite) {
  for (const auto& [ni, nj, nk] :
       {std::array<uint64_t, 3>{1, 5, 4}, {5, 1, 4}, {5, 4, 1}, {1, 1, 6}, {6, 1, 1}, {1, 1, 1}}) {
    MappedBlock grid(ni, nj, nk,
                     [](double i, double j, double k) { return glm::dvec3(1 + i, 2 * j, 3 * k); });
    grid.addScalar([](const glm::dvec3& p) { return p.y; });
    const NodeSplats out = grid.splats();
    EXPECT_EQ(out.splats.size(), ni * nj * nk);
    EXPECT_EQ(out.degenerate, ni * nj * nk);
    EXPECT_TRUE(allFinite(out));
    EXPECT_EQ(totalWeight(out), 0);
    for (const NodeSplat& node : out.splats) EXPECT_TRUE(node.on_block_face);
  }
  for (const glm::dvec3& point : {glm::dvec3(0, 0, 0), glm::dvec3(3, 4, 5)}) {
    const NodeSplats out = MappedBlock(4, 4, 4, [&](double, double, double) { return point; }).splats();
    EXPECT_TRUE(allFinite(out));
    EXPECT_EQ(out.degenerate, 64u);
    EXPECT_EQ(totalWeight(out), 0);
    EXPECT_EQ(out.splats[0].splat.position, point);
    EXPECT_EQ(out.splats[0].spacing, 0);
  }
}

TEST(NodeSplats, OfThinCellsKeepTheirShape) {
  // A wall layer of aspect ratio 1e5, turned: its cells are not degenerate.
  std::mt19937_64 random(7);
  const glm::dmat3 turn = randomRotation(random);
  MappedBlock grid(4, 6, 4, [&](double i, double j, double k) {
    return turn * glm::dvec3(i + 0.5 * j * 1e-5, 1e-5 * j, 0.3 * k);
  });
  const NodeSplats out = grid.splats();
  EXPECT_EQ(out.degenerate, 0u);
  for (const NodeSplat& node : out.splats) EXPECT_TRUE(node.regular);
  EXPECT_NEAR(totalWeight(out) / (3 * 5e-5 * 3 * 0.3), 1, 1e-9);
  const auto sigma = singularValues(out.splats[grid.at(1, 2, 1)].splat.factor());
  EXPECT_NEAR(sigma[0], 1, 1e-9);
  EXPECT_NEAR(sigma[1], 0.3, 1e-9);
  EXPECT_NEAR(sigma[2] / 1e-5, 1, 1e-8);
}

TEST(NodeSplats, CountsInvertedCells) {
  MappedBlock grid(6, 6, 6, [](double i, double j, double k) { return glm::dvec3(i, k, j); });
  EXPECT_EQ(grid.splats().left_handed, 216u);
  // One node pushed past its second neighbours along i turns the cells of its two neighbours over.
  grid.nodes.x[grid.at(3, 2, 2)] += 2.5;
  const NodeSplats out = grid.splats();
  EXPECT_EQ(out.right_handed, 1u);
  EXPECT_EQ(out.left_handed, 215u);
  EXPECT_TRUE(allFinite(out));
}

}  // namespace
}  // namespace curvisplat
