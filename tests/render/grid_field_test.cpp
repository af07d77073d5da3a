// The truth for real grids is held to fields that trilinear interpolation has exactly, on bent, sheared and
// collapsed cells.
#include "tests/reference/grid_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "preprocess/scenes/scenes.h"
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
