// The truth for real grids is held to fields that trilinear interpolation has exactly, on bent, sheared and
// collapsed cells.
#include "tests/reference/grid_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/cell_grid.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/reference_march.h"

namespace curvisplat {
namespace {

// A quarter of a pipe, twisted; with `inner` = 0 its j = 0 face is a line.
glm::dvec3 pipe(double inner, double u, double v, double w) {
  const double angle = 0.5 * std::numbers::pi * u + 0.4 * w, radius = inner + (1 - inner) * v * v;
  return {radius * std::cos(angle), radius * std::sin(angle), w + 0.1 * u * v};
}

class PipeGrid : public FunctionGridSource {
 public:
  explicit PipeGrid(double inner, bool with_hole = false)
      : FunctionGridSource({gridBlock(13, 9, 7)}, 1, [=](const GridNode& n) {
          NodeValues node;
          node.position = pipe(inner, n.i / 12.0, n.j / 8.0, n.k / 6.0);
          node.scalars = {static_cast<float>(n.i)};
          node.blank = with_hole && n.i == 5 && n.j == 4 && n.k == 3;
          return node;
        }) {}
};

TEST(GridField, FindsEveryPointOfEveryCell) {
  for (const double inner : {0.3, 0.0}) {
    const PipeGrid source(inner);
    const GridField field(source, 0);
    const auto probe = field.probe();
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> unit(0, 1);
    NodeArrays nodes;
    const uint32_t scalar = 0;
    source.read(0, {0, 9, 0, 7}, std::span(&scalar, 1), nodes);
    for (int n = 0; n < 3000; ++n) {
      const size_t i = random() % 12, j = random() % 8, k = random() % 6;
      const double u = unit(random), v = unit(random), w = unit(random);
      glm::dvec3 point(0.0);
      for (int corner = 0; corner < 8; ++corner) {
        const size_t at = ((k + (corner >> 2)) * 9 + j + (corner >> 1 & 1)) * 13 + i + (corner & 1);
        const double weight = (corner & 1 ? u : 1 - u) * (corner & 2 ? v : 1 - v) * (corner & 4 ? w : 1 - w);
        point += weight * glm::dvec3(nodes.x[at], nodes.y[at], nodes.z[at]);
      }
      const auto found = probe->at(point);
      ASSERT_TRUE(found.has_value()) << i << " " << j << " " << k;
      EXPECT_NEAR(*found, static_cast<double>(i) + u, inner == 0 && j == 0 ? 1e-3 : 1e-7);
    }
  }
}

TEST(GridField, KnowsWhatIsOutside) {
  const PipeGrid source(0.3);
  const GridField field(source, 0);
  const auto probe = field.probe();
  EXPECT_FALSE(probe->at({0.1, 0.1, 0.5}).has_value());    // in the hole of the pipe
  EXPECT_FALSE(probe->at({0.9, 0.9, 0.5}).has_value());    // beyond its outside
  EXPECT_FALSE(probe->at({0.5, 0.5, -0.01}).has_value());  // below
  EXPECT_TRUE(probe->at({0.5, 0.5, 0.5}).has_value());
  EXPECT_FALSE(probe->at({0.5, 0.5, 5.0}).has_value());
}

TEST(GridField, LeavesOutCellsWithBlankNodes) {
  const PipeGrid source(0.3, true);
  const GridField field(source, 0);
  const auto probe = field.probe();
  EXPECT_FALSE(probe->at(pipe(0.3, 5.0 / 12, 4.0 / 8, 3.0 / 6)).has_value());
  EXPECT_TRUE(probe->at(pipe(0.3, 7.0 / 12, 4.0 / 8, 3.0 / 6)).has_value());
}

TEST(GridField, TellsHowFarACellReaches) {
  const FunctionGridSource source({gridBlock(5, 5, 5)}, 1, [](const GridNode& n) {
    return NodeValues{
        {4.0 * static_cast<double>(n.i), 2.0 * static_cast<double>(n.j), static_cast<double>(n.k)},
        {0.0f},
        false};
  });
  const GridField field(source, 0);
  const auto probe = field.probe();
  ASSERT_TRUE(probe->at({3, 3, 3}).has_value());
  EXPECT_NEAR(probe->cellLength({1, 0, 0}), 4, 1e-9);
  EXPECT_NEAR(probe->cellLength({0, 1, 0}), 2, 1e-9);
  EXPECT_NEAR(probe->cellLength(glm::dvec3(0, 0.6, 0.8)), 1 / 0.8, 1e-9);
}

OpticalProperties uniform(double) {
  return {{0.25, 0.5, 0.75}, 1.5};
}

// One step passes all of the field: its ends are known, however thin its parts are.
TEST(GridField, IsMarchedBetweenItsFaces) {
  // Two slabs of bent cells, 0.004 and 0.001 thick at any place, and 0.3 apart.
  const FunctionGridSource source({gridBlock(5, 7, 3), gridBlock(5, 7, 3)}, 1, [](const GridNode& n) {
    const double u = static_cast<double>(n.i) / 4, v = static_cast<double>(n.j) / 6;
    const double thickness = n.block == 0 ? 0.004 : 0.001;
    const double z = 0.1 * u * v + 0.3 * n.block + thickness * static_cast<double>(n.k) / 2;
    return NodeValues{{u + 0.05 * v * v, v, z}, {1.0f}};
  });
  Camera camera;
  camera.position = {0.5, 0.5, 3};
  camera.focal_point = {0.5, 0.5, 0};
  camera.parallel_scale = 0.83;
  MarchSteps steps;
  steps.step = 10;
  steps.cells = 1e9;
  const ReferenceImage image = referenceMarch(GridField(source, 0), uniform, camera, {24, 24}, steps);
  int hit = 0;
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 24; ++x) {
      // Pixels' centres; the grid's sides are at x = 0.05 v^2 and 1 + 0.05 v^2, between nodes a little off.
      const double across = 0.5 + 0.83 * (2 * (x + 0.5) / 24 - 1), up = 0.5 + 0.83 * (1 - 2 * (y + 0.5) / 24);
      const double side = 0.05 * up * up;
      if (std::min(std::abs(across - side), std::abs(across - 1 - side)) < 0.003) continue;
      const bool inside = up > 0 && up < 1 && across > side && across < 1 + side;
      EXPECT_NEAR(image.at(x, y).transmittance, inside ? std::exp(-1.5 * 0.005) : 1, 1e-8) << x << " " << y;
      hit += inside;
    }
  EXPECT_GT(hit, 150);
}

// Rays along the faces of cells, and through their edges.
TEST(GridField, IsMarchedAlongTheFacesOfItsCells) {
  const FunctionGridSource source({gridBlock(9, 9, 9)}, 1, [](const GridNode& n) {
    return NodeValues{glm::dvec3(n.i, n.j, n.k) / 8.0, {static_cast<float>(n.k) / 8}};
  });
  const GridField field(source, 0);
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0};
  camera.parallel_scale = 0.75;  // 12 pixels of 1/8: with an odd number of pixels they are at nodes
  for (const int pixels : {12, 13}) {
    camera.parallel_scale = 0.0625 * pixels;
    const ReferenceImage image = referenceMarch(field, uniform, camera, {pixels, pixels}, MarchSteps());
    for (int y = 0; y < pixels; ++y)
      for (int x = 0; x < pixels; ++x) {
        const double across = 0.5 + 0.125 * (x - 0.5 * (pixels - 1)),
                     up = 0.5 + 0.125 * (y - 0.5 * (pixels - 1));
        if (std::abs(std::abs(across - 0.5) - 0.5) < 1e-9 || std::abs(std::abs(up - 0.5) - 0.5) < 1e-9)
          continue;  // the outline itself
        const bool inside = across > 0 && across < 1 && up > 0 && up < 1;
        EXPECT_NEAR(image.at(x, y).transmittance, inside ? std::exp(-1.5) : 1, 1e-7) << x << " " << y;
      }
  }
}

TEST(GridField, HasCellsOfOneValueAndLeavesOutBlankOnes) {
  const FunctionGridSource nodes({gridBlock(4, 4, 4)}, 1, [](const GridNode& n) {
    return NodeValues{glm::dvec3(n.i, n.j, n.k), {0.0f}};
  });
  const CellGridSource source(nodes, {[](const GridCell& cell) {
                                return cell.i == 1 && cell.j == 1 && cell.k == 1
                                           ? std::numeric_limits<double>::quiet_NaN()
                                           : static_cast<double>(cell.i);
                              }});
  const GridField field(source, 1);
  EXPECT_EQ(field.range(), std::pair(0.0, 2.0));
  const auto probe = field.probe();
  EXPECT_EQ(probe->at({2.9, 1.5, 1.5}), 2.0);
  EXPECT_EQ(probe->at({0.9, 0.1, 0.1}), 0.0);
  EXPECT_FALSE(probe->at({1.5, 1.5, 1.5}).has_value());
}

// A scene and its grid are two ways to the same picture.
TEST(GridField, HasTheAnalyticScenesPicture) {
  const auto scene = std::shared_ptr<const Scene>(makeScene("half-annulus"));
  const SceneGridSource source(scene, {192, 96, 96});
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    Camera camera = halfAnnulusCamera();
    camera.projection = projection;
    MarchSteps steps;
    steps.step = 0.016;
    steps.cells = 2;
    const auto picture = [&](const ReferenceField& field) {
      return toImage(referenceMarch(field, smoothFunction, camera, {40, 40}, steps));
    };
    EXPECT_GE(compareImages(picture(GridField(source, 0)), picture(SceneField(*scene))).psnr_db, 55);
  }
}

}  // namespace
}  // namespace curvisplat
