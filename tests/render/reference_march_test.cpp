// The specification itself is held to closed forms; the truth for real grids, to fields that trilinear
// interpolation has exactly, on bent, sheared and collapsed cells.
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/reference_march.h"

namespace curvisplat {
namespace {

// The box [0, 2] x [0, 1] x [0, 1] with f = x / 2.
class Box : public Scene {
 public:
  Box() : Scene("box") {}
  std::optional<glm::dvec3> inverse(const glm::dvec3& world) const override {
    const glm::dvec3 uvw(world.x / 2, world.y, world.z);
    for (int axis = 0; axis < 3; ++axis)
      if (!(uvw[axis] >= 0 && uvw[axis] <= 1)) return std::nullopt;
    return uvw;
  }
  double scalar(const glm::dvec3& world) const override { return world.x / 2; }
  double volume() const override { return 2; }
  // Larger than the box, so that its faces have to be found.
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return {{-0.3, -0.4, -0.5}, {2.3, 1.4, 1.5}}; }
  glm::dvec3 alongU(double u) const override { return {2 * u, 0, 0}; }
  glm::dvec3 alongV(double v) const override { return {0, v, 0}; }
  glm::dvec3 alongW(double w) const override { return {0, 0, w}; }
  glm::dvec3 join(const glm::dvec3& u, const glm::dvec3& v, const glm::dvec3& w) const override {
    return u + v + w;
  }
};

OpticalProperties homogeneous(double) {
  return {{0.25, 0.5, 0.75}, 1.5};
}

// Looks along the x axis, half a pixel's height being 0.1.
Camera alongX(Projection projection) {
  Camera camera;
  camera.position = {-3, 0.5, 0.5};
  camera.focal_point = {0, 0.5, 0.5};
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  camera.parallel_scale = 1;
  camera.view_angle_deg = 40;
  return camera;
}

TEST(ReferenceMarch, MatchesAHomogeneousBox) {
  Camera camera = alongX(Projection::kOrthographic);
  camera.parallel_scale = 0.9;
  const ReferenceImage image = referenceMarch(Box(), homogeneous, camera, {10, 10}, 0.03);
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      const bool hit = x >= 2 && x < 8 && y >= 2 && y < 8;  // centres 0.09, 0.27, ... from the middle
      const double t = hit ? std::exp(-1.5 * 2) : 1;
      EXPECT_NEAR(image.at(x, y).transmittance, t, 1e-12) << x << " " << y;
      EXPECT_NEAR(image.at(x, y).colour.r, t + (1 - t) * 0.25, 1e-12);
      EXPECT_NEAR(image.at(x, y).colour.b, t + (1 - t) * 0.75, 1e-12);
    }
}

TEST(ReferenceMarch, MatchesAHomogeneousBoxInPerspective) {
  const int n = 40;
  const ReferenceImage image =
      referenceMarch(Box(), homogeneous, alongX(Projection::kPerspective), {2 * n, n}, 0.03);
  const double half_height = std::tan(20 * 3.14159265358979323846 / 180);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < 2 * n; ++x) {
      // From the eye at distance 3: the slab x in [0, 2], cut by the walls at half a unit from the axis.
      const double right = half_height * (2 * (x + 0.5) / n - 2), up = half_height * (1 - 2 * (y + 0.5) / n);
      const double leaves = std::min(5.0, 0.5 / std::max(std::abs(right), std::abs(up)));
      const double length = std::max(0.0, leaves - 3) * std::sqrt(1 + right * right + up * up);
      if (length > 0 && length < 0.03) continue;
      EXPECT_NEAR(image.at(x, y).transmittance, std::exp(-1.5 * length), 1e-12) << x << " " << y;
    }
}

TEST(ReferenceMarch, CastsTheShadowsOfAHomogeneousBox) {
  const Box box;
  const SceneField field(box);
  const Camera camera = alongX(Projection::kOrthographic);
  ReferenceLight light;
  light.ambient = 1;  // colours are those of the function, but for shadows
  light.diffuse = light.specular = 0;
  const auto redAt = [&](int x, int y) {
    const ReferenceImage image =
        referenceMarch(field, homogeneous, camera, {20, 20}, MarchSteps{0.02}, {&light});
    return image.at(x, y).colour.r - image.at(x, y).transmittance;
  };
  const double passed = std::exp(-1.5 * 2), opaque = 1 - passed;
  // From the top the distance is the same all along the ray; pixels are 0.1 high, the box's top is at 5.
  light.towards = glm::dvec3(0, 0, 3);
  light.shadow = 0.5;
  EXPECT_NEAR(redAt(10, 8), 0.25 * opaque * (0.5 + 0.5 * std::exp(-1.5 * 0.35)), 1e-4);
  // From the viewer's side light passes what the viewer sees through.
  light.towards = glm::dvec3(-1, 0, 0);
  EXPECT_NEAR(redAt(10, 10), 0.25 * (0.5 * opaque + 0.25 * (1 - passed * passed)), 1e-4);
  // Nothing is nearer to the middle of the box than 0.45 but its faces at both ends.
  light.shadow = 0;
  light.ambient_occlusion = 1;
  light.occlusion_reach = 0.2;
  double expected = 0;
  constexpr int kParts = 4000;
  for (int n = 0; n < kParts; ++n) {
    const double x = (n + 0.5) / kParts * 2, r = 0.2, slanted = std::sqrt(3.0);
    const auto through = [](double length) { return std::exp(-1.5 * length); };
    const double along = through(std::min(r, x)) + through(std::min(r, 2 - x));
    const double corners = 4 * (through(std::min(r, slanted * x)) + through(std::min(r, slanted * (2 - x))));
    expected += 0.25 * 1.5 * std::exp(-1.5 * x) * (4 * through(r) + along + corners) / 14 * 2 / kParts;
  }
  EXPECT_NEAR(redAt(10, 10), expected, 2e-4);
}

TEST(ReferenceMarch, HasTheImageTheRightWayUp) {
  Camera camera = alongX(Projection::kOrthographic);
  camera.focal_point += glm::dvec3(0, 0.5, 0.5);  // the box moves to the lower right: -y is on the right
  camera.position += glm::dvec3(0, 0.5, 0.5);
  const ReferenceImage image = referenceMarch(Box(), homogeneous, camera, {10, 10}, 0.03);
  EXPECT_LT(image.at(6, 8).transmittance, 1);
  EXPECT_EQ(image.at(3, 8).transmittance, 1);
  EXPECT_EQ(image.at(6, 1).transmittance, 1);
}

TEST(ReferenceMarch, IntegratesTransferFunctions) {
  const Camera camera = alongX(Projection::kOrthographic);
  const auto centre = [&](const OpticalFunction& function) {
    return referenceMarch(Box(), function, camera, {1, 1}, 0.03).at(0, 0).transmittance;
  };
  // f = x / 2 over a length of 2: twice the integral over f.
  EXPECT_NEAR(centre(smoothFunction), std::exp(-2 * 8 / 3.0), 1e-6);
  EXPECT_NEAR(centre(stepFunction), std::exp(-16.0), 1e-9);
  EXPECT_NEAR(centre(bandFunction), std::exp(-2 * 24 * std::sqrt(3.14159265358979323846 * 0.0018)), 1e-5);
}

TEST(ReferenceMarch, MeetsAJumpWhereItIs) {
  // From the other side, where the jump is seen first: colour comes from the very edge of f > 0.5.
  const auto edge = [](double f) {
    return OpticalProperties{glm::dvec3(f > 0.37 ? 1 : 0, 0, 0), f > 0.37 ? 0.5 : 0.0};
  };
  const auto pixel = referenceMarch(Box(), edge, alongX(Projection::kOrthographic), {1, 1}, 0.03).at(0, 0);
  EXPECT_NEAR(pixel.transmittance, std::exp(-0.5 * 2 * 0.63), 2e-5);
  EXPECT_NEAR(pixel.colour.r, 1, 1e-12);
}

double decibels(const ReferenceImage& a, const ReferenceImage& b) {
  double sum = 0;
  for (size_t n = 0; n < a.pixels.size(); ++n) {
    const glm::dvec3 d = a.pixels[n].colour - b.pixels[n].colour;
    sum += glm::dot(d, d) / 3;
  }
  return sum > 0 ? -10 * std::log10(sum / static_cast<double>(a.pixels.size())) : 400;
}

TEST(ReferenceMarch, ConvergesOnTheHalfAnnulus) {
  const auto scene = makeScene("half-annulus");
  const auto difference = [&](const OpticalFunction& function) {
    return decibels(referenceMarch(*scene, function, halfAnnulusCamera(), {48, 48}, 0.004),
                    referenceMarch(*scene, function, halfAnnulusCamera(), {48, 48}, 0.001));
  };
  EXPECT_GT(difference(smoothFunction), 90);
  EXPECT_GT(difference(bandFunction), 80);
  EXPECT_GT(difference(stepFunction), 75);
}

// A field that does not tell its crossings.
class SilentField : public ReferenceField {
 public:
  explicit SilentField(const ReferenceField& field) : field_(field) {}
  std::unique_ptr<FieldProbe> probe() const override { return field_.probe(); }
  std::pair<glm::dvec3, glm::dvec3> bounds() const override { return field_.bounds(); }

 private:
  const ReferenceField& field_;
};

// Cameras whose rays are oblique, along the z axis, along the y axis, and from inside.
std::vector<Camera> camerasAroundAPipe() {
  std::vector<Camera> cameras(4, halfAnnulusCamera());
  cameras[1].position = cameras[1].focal_point + glm::dvec3(0, 0, 4);
  cameras[1].view_up = {0, 1, 0};
  cameras[2].position = cameras[2].focal_point + glm::dvec3(0, 4, 0);
  cameras[3].projection = Projection::kPerspective;
  cameras[3].position = {-0.55, 0.1, 0.6};
  cameras[3].focal_point = {-0.3, -0.7, 0.35};
  cameras[3].view_angle_deg = 100;
  return cameras;
}

TEST(ReferenceMarch, SceneFieldsEndWhereASearchFindsThem) {
  for (const char* name : {"half-annulus", "o-grid", "axis"}) {
    const auto scene = makeScene(name);
    const SceneField whole(*scene);
    const ClippedField clipped(whole,
                               {{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}}, {{-0.5, 0.1, 0.4}, {0.1, -0.9, -0.6}}});
    const auto cameras = camerasAroundAPipe();
    for (size_t n = 0; n < cameras.size(); ++n)
      for (const ReferenceField* field :
           {static_cast<const ReferenceField*>(&whole), static_cast<const ReferenceField*>(&clipped)}) {
        const auto march = [&](const ReferenceField& of, double step) {
          MarchSteps steps;
          steps.step = step;
          return referenceMarch(of, homogeneous, cameras[n], {24, 24}, steps);
        };
        // A uniform medium, which no step is too long for.
        const double db = decibels(march(*field, 10), march(SilentField(*field), 0.001));
        EXPECT_GT(db, 120) << name << ", camera " << n << (field == &clipped ? ", clipped" : "");
      }
  }
}

TEST(ReferenceMarch, GoesInStepsThatAreShortEnough) {
  const auto scene = makeScene("half-annulus");
  const SceneField field(*scene);
  const auto cameras = camerasAroundAPipe();
  // Only among many rays are some that touch what the step function shows.
  const struct {
    const char* name;
    OpticalFunction function;
    size_t camera;
    ImageSize size;
    double fine_step;
  } pictures[] = {
      {"smooth", smoothFunction, 0, {32, 32}, 0.001}, {"smooth", smoothFunction, 3, {32, 32}, 0.001},
      {"band", bandFunction, 0, {32, 32}, 0.001},     {"band", bandFunction, 3, {32, 32}, 0.001},
      {"step", stepFunction, 0, {256, 256}, 0.004},   {"step", stepFunction, 3, {32, 32}, 0.001}};
  for (const auto& [name, function, camera, size, fine_step] : pictures) {
    MarchSteps fine;
    fine.step = fine_step;
    const double db = decibels(referenceMarch(field, function, cameras[camera], size, stepsFor(field)),
                               referenceMarch(SilentField(field), function, cameras[camera], size, fine));
    EXPECT_GT(db, 100) << name << ", camera " << camera;
  }
}

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
