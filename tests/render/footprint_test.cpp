#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "render/camera/camera.h"
#include "render/project/footprint.h"
#include "render/project/gradient_opacity.h"
#include "render/project/light.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

using std::numbers::pi;

/// ∫ of `f` over [0, kKernelSupport] by the midpoint rule.
template <typename F>
double integral(F f, int steps = 4000) {
  const double step = kKernelSupport / steps;
  double sum = 0;
  for (int n = 0; n < steps; ++n) sum += f((n + 0.5) * step) * step;
  return sum;
}

TEST(Kernel, IntegratesToOneAndHasItsDeviation) {
  EXPECT_NEAR(integral([](double r) { return 4 * pi * r * r * kernel(r); }), 1.0, 2e-5);
  const double variance = integral([](double r) { return 4 * pi * std::pow(r, 4) / 3 * kernel(r); });
  EXPECT_NEAR(std::sqrt(variance), kKernelSigma, 1e-5);
}

TEST(Kernel, IsContinuousWithItsSlopeAtTheKnotAndEndsSmoothly) {
  const double knot = 0.889392, step = 1e-5;
  EXPECT_NEAR(kernel(knot - 1e-9), kernel(knot + 1e-9), 1e-5);
  EXPECT_NEAR((kernel(knot - step) - kernel(knot - 2 * step)) / step,
              (kernel(knot + 2 * step) - kernel(knot + step)) / step, 1e-3);
  EXPECT_EQ(kernel(kKernelSupport), 0.0);
  EXPECT_LT(kernel(kKernelSupport - 1e-4), 1e-8);
}

TEST(Kernel, SumsToOneOverALattice) {
  for (double x : {0.0, 0.25, 0.5})
    for (double y : {0.0, 0.3, 0.5})
      for (double z : {0.0, 0.1, 0.5}) {
        double sum = 0;
        for (int i = -2; i <= 2; ++i)
          for (int j = -2; j <= 2; ++j)
            for (int k = -2; k <= 2; ++k) sum += kernel(std::hypot(x - i, y - j, z - k));
        EXPECT_NEAR(sum, 1.0, 0.0055) << x << ' ' << y << ' ' << z;
      }
}

TEST(Footprint, IntegratesToOne) {
  EXPECT_NEAR(integral([](double rho) { return 2 * pi * rho * footprint(rho); }), 1.0, 2e-5);
}

TEST(Footprint, IsTheIntegralAlongTheRay) {
  for (double rho : {0.0, 0.01, 0.4, 0.889, 0.9, 1.3, 1.55}) {
    double sum = 0;
    const double step = 2.5e-5;
    for (double t = 0.5 * step; t < kKernelSupport; t += step) sum += 2 * step * kernel(std::hypot(rho, t));
    EXPECT_NEAR(footprint(rho), sum, 1e-9) << rho;
  }
  EXPECT_EQ(footprint(kKernelSupport), 0.0);
}

TEST(Footprint, TableIsGoodToAHundredThousandth) {
  const int steps = 1024;
  const auto table = footprintTable(steps);
  ASSERT_EQ(table.size(), 1025u);
  for (double rho = 0; rho < kKernelSupport; rho += 0.00123) {
    const double at = rho * rho / (kKernelSupport * kKernelSupport) * steps;
    const auto cell = static_cast<size_t>(at);
    const double value = std::lerp(table[cell], table[cell + 1], at - std::floor(at));
    EXPECT_NEAR(value, footprint(rho), 1e-5) << rho;
  }
}

TEST(FootprintSkew, KeepsItsNumbers) {
  const FootprintSkew skew{{0.5f, -0.31f, 0.02f, -1.2f}};
  const FootprintSkew kept = FootprintSkew::unpack(skew.pack());
  for (size_t n = 0; n < 4; ++n) EXPECT_NEAR(kept.t[n], skew.t[n], 0.005) << n;
  EXPECT_EQ(FootprintSkew{}.pack(), 0u);
  EXPECT_NEAR(FootprintSkew::unpack(FootprintSkew{{99, -99, 0, 0}}.pack()).t[1], -1.27, 1e-6);
  // Cameras beyond single precision give such values. The undefined-behaviour sanitizer looks, too.
  EXPECT_EQ((FootprintSkew{{NAN, -NAN, NAN, 0.5f}}.pack()), (FootprintSkew{{0, 0, 0, 0.5f}}.pack()));
  const float infinite = std::numeric_limits<float>::infinity();
  EXPECT_EQ((FootprintSkew{{infinite, -infinite, 0, 0}}.pack()), (FootprintSkew{{99, -99, 0, 0}}.pack()));
}

TEST(FootprintSkew, NeitherWeighsNorMoves) {
  const FootprintSkew skew{{0.2f, -0.1f, 0.05f, 0.15f}};
  double weight = 0, x = 0, y = 0, third = 0;
  constexpr double kStep = 0.01;
  for (double v0 = -7; v0 < 7; v0 += kStep)
    for (double v1 = -7; v1 < 7; v1 += kStep) {
      const double gauss = std::exp(-0.5 * (v0 * v0 + v1 * v1)) / (2 * M_PI) * kStep * kStep;
      const double here = gauss * skew.at(kKernelSigma * v0, kKernelSigma * v1);
      weight += here;
      x += v0 * here;
      y += v1 * here;
      third += v0 * v0 * v0 * here;
    }
  EXPECT_NEAR(weight, 1, 1e-3);
  EXPECT_NEAR(x, 0, 2e-3);
  EXPECT_NEAR(y, 0, 2e-3);
  EXPECT_NEAR(third, 0.2, 0.02);
}

TEST(FootprintSkew, OfManySplatsAtOnceIsThatOfEach) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<uint32_t> codes(GrowthBlock::kMaxSplats, kNoGrowth);
  std::vector<Shape> shapes;
  for (uint32_t& code : codes) {
    const auto number = [&] { return static_cast<float>(any(random)); };
    shapes.push_back(
        {1.1f + number(), 0.01f * (1.1f + number()), 100 * (1.1f + number()), number(), number(), number()});
    if (random() % 4 == 0) continue;
    const glm::dquat turn = glm::normalize(glm::dquat(any(random), any(random), any(random), any(random)));
    const glm::dmat3 axes = glm::mat3_cast(turn);
    code = packGrowthCode({axes[0], axes[1], axes[2]},
                          {0.5 * any(random), random() % 2 * any(random), random() % 2 * any(random)});
  }
  const auto block = std::make_unique<GrowthBlock>();
  ASSERT_TRUE(block->fill(codes));
  const ScreenRows rows{5, 1, -2, 0.5f, 4, 3};
  for (size_t n = 0; n < codes.size(); ++n) {
    const Ellipse e = ellipseOf(rows, shapes[n], {}, 0, 1, {0.3f, 1e-6f});
    EXPECT_EQ(block->skewOf(n, rows, shapes[n], {e.l11, e.l21, e.l22}),
              skewOf(rows, growthAxes(shapes[n], codes[n]), e))
        << n;
  }
  EXPECT_FALSE(block->fill(std::vector<uint32_t>(3, kNoGrowth)));
}

TEST(FootprintSkew, IsTheSkewedKernelsIntegralAlongTheRay) {
  // A splat of unequal axes that grows along two of its lattice's, under a map that turns and shears.
  const Shape shape{0.8f, 0.3f, 0.5f, 0.4f, -0.2f, 0.6f};
  const glm::dmat3 turn = glm::mat3_cast(glm::angleAxis(0.3, glm::normalize(glm::dvec3(1, 2, -1))));
  const uint32_t code = packGrowthCode({turn[0], turn[1], turn[2]}, {0.3, -0.2, 0});
  const CellGrowth cell = cellGrowth(code);
  const ScreenRows rows{5, 1, -2, 0.5f, 4, 3};
  const Ellipse ellipse = ellipseOf(rows, shape, {}, 0, 1, {0, 1e-6f});
  const FootprintSkew skew = FootprintSkew::unpack(skewOf(rows, growthAxes(shape, code), ellipse));

  // In the frame of A, in deviations: the screen's u is W v with orthonormal rows, and the ray goes along their
  // cross product.
  const auto seen = [&](int axis) {
    glm::vec3 unit(0.0f);
    unit[axis] = 1;
    const glm::vec3 e = inSpace(shape, unit);
    const double u0 = (rows.x0 * e.x + rows.y0 * e.y + rows.z0 * e.z) / ellipse.l11;
    return glm::dvec2(u0, (rows.x1 * e.x + rows.y1 * e.y + rows.z1 * e.z - ellipse.l21 * u0) / ellipse.l22);
  };
  glm::dvec3 w0, w1;
  for (int axis = 0; axis < 3; ++axis) {
    w0[axis] = seen(axis).x;
    w1[axis] = seen(axis).y;
  }
  EXPECT_NEAR(glm::dot(w0, w0), 1, 1e-5);
  EXPECT_NEAR(glm::dot(w0, w1), 0, 1e-5);
  const glm::dvec3 ray = glm::cross(w0, w1);
  for (const double v0 : {-1.2, 0.0, 0.7})
    for (const double v1 : {-0.8, 0.3, 1.5}) {
      double sum = 0, all = 0;
      for (double t = -6; t < 6; t += 0.01) {
        const glm::dvec3 v = v0 * w0 + v1 * w1 + t * ray;
        double factor = 1;
        for (size_t a = 0; a < 3; ++a) {
          const double along = glm::dot(glm::dvec3(cell.axis[a]), v);
          factor += kSkewOfGrowth * cell.growth[a] * (along * along * along - 3 * along) / 6;
        }
        sum += factor * std::exp(-0.5 * t * t);
        all += std::exp(-0.5 * t * t);
      }
      EXPECT_NEAR(skew.at(kKernelSigma * v0, kKernelSigma * v1), sum / all, 0.01) << v0 << " " << v1;
    }
}

constexpr ImageSize kFootprintPicture{100, 80};

glm::dmat3 factorMatrix(const Shape& s) {
  return glm::dmat3(glm::dvec3(s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20),
                    glm::dvec3(0, s.axis1, s.axis1 * s.shear21), glm::dvec3(0, 0, s.axis2));
}

ScreenView viewOf(Projection projection, const glm::dvec3& scale = glm::dvec3(1)) {
  Camera camera;
  camera.position = {3, -4, 2};
  camera.focal_point = {0.5, 0, 0.25};
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  return ScreenView::of(camera, kFootprintPicture, scale, kLowPass, 1e-3);
}

TEST(Light, IsPackedWithTheHalfWidth) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int n = 0; n < 1000; ++n) {
    const float width = std::exp(80 * (unit(random) - 0.5f));
    const Lit lit{unit(random), unit(random)};
    const float packed = packLit(width, lit);
    EXPECT_TRUE(std::isnormal(packed));
    EXPECT_NEAR(unpackHalfWidth(packed) / width, 1, 0.008);
    EXPECT_NEAR(unpackLit(packed).diffuse, lit.diffuse, 0.5 / 511 + 1e-6);
    EXPECT_NEAR(unpackLit(packed).specular, lit.specular, 0.5 / 127 + 1e-6);
  }
  for (const float width : {0.0f, 1e-42f, std::numeric_limits<float>::max()}) {
    const float packed = packLit(width, {});
    EXPECT_TRUE(std::isnormal(packed)) << width;
    EXPECT_EQ(unpackLit(packed).diffuse, 1);
    EXPECT_EQ(unpackLit(packed).specular, 0);
  }
  EXPECT_LT(unpackHalfWidth(packLit(0, {})), 1e-37f);
}

TEST(Light, IsThatOfTheGradientInTheWorld) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> around(-1, 1);
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective})
    for (int n = 0; n < 200; ++n) {
      const glm::dvec3 scale(1, n % 3 == 0 ? 1 : 2, n % 2 == 0 ? 1 : 0.25);
      const ScreenView view = viewOf(projection, scale);
      const glm::dvec3 origin(0.25, -0.5, 0.125), at(around(random), around(random), around(random));
      const Shape shape{
          static_cast<float>(1.5 + around(random)), static_cast<float>(0.1 * (1.5 + around(random))),
          static_cast<float>(1.5 + around(random)), static_cast<float>(around(random)),
          static_cast<float>(around(random)),       static_cast<float>(around(random))};
      const Slope slope{static_cast<float>(around(random)), static_cast<float>(around(random)),
                        static_cast<float>(around(random))};
      Light light;
      if (n % 4 != 0) light.towards = glm::dvec3(around(random), around(random), around(random));
      const double g0 = 0.5;
      const Lit found =
          LocalLight(light, g0, view, origin)
              .of(static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(at.z), shape, slope);

      const glm::dvec3 w(slope.w0, slope.w1, slope.w2);
      const glm::dvec3 g = glm::inverse(glm::transpose(factorMatrix(shape))) * w / scale;
      const double strength = glm::dot(g, g) / (glm::dot(g, g) + g0 * g0);
      const glm::dvec3 viewer = projection == Projection::kPerspective
                                    ? glm::normalize(view.eye - scale * (origin + at))
                                    : -view.forward;
      const glm::dvec3 towards = light.towards ? glm::normalize(*light.towards) : viewer;
      const double facing = std::abs(glm::dot(glm::normalize(g), towards));
      const double shine = std::abs(glm::dot(glm::normalize(g), glm::normalize(towards + viewer)));
      EXPECT_NEAR(found.diffuse, 1 - strength + strength * (0.3 + 0.7 * facing), 1e-4);
      EXPECT_NEAR(found.specular, strength * 0.25 * std::pow(shine, 32), 1e-3);
    }
}

TEST(Light, LeavesWhatHasNoGradient) {
  const LocalLight light({}, 1, viewOf(Projection::kOrthographic), glm::dvec3(0));
  for (const Slope& slope : {Slope{0, 0, 0}, Slope{NAN, 0, 0}, Slope{1e30f, 0, 0}}) {
    const Lit lit = light.of(0, 0, 0, {1e-3f, 1, 1, 0, 0, 0}, slope);
    EXPECT_EQ(lit.diffuse, 1);
    EXPECT_EQ(lit.specular, 0);
  }
}

/// The 1000 magnitudes are the squares of their ranks, each with a volume of its own.
TEST(GradientOpacity, IsLinearOverTheShareOfTheVolumeThatIsLessSteep) {
  std::vector<float> magnitudes, volumes;
  std::vector<double> below;  // share of the volume, of each
  double volume = 0;
  for (int n = 1000; n-- > 0;) {
    magnitudes.push_back(static_cast<float>(n * n));
    volumes.push_back(n < 500 ? 1 : 3);
  }
  for (int n = 0; n < 1000; ++n) {
    below.push_back(volume / 2000);
    volume += n < 500 ? 1 : 3;
  }
  const GradientPercentiles percentiles(magnitudes, volumes);
  const std::vector<OpacityPoint> points{{0, 0.25}, {0.25, 0.75}, {0.25, 0}, {0.5, 1}, {1, 0}};
  const GradientOpacity opacity(points, percentiles);
  for (int n = 0; n < 1000; ++n) {
    const double share = below[n];
    const double expected = share <= 0.25 ? 0.25 + 2 * share
                            : share < 0.5 ? 4 * (share - 0.25)
                                          : 2 * (1 - share);
    EXPECT_NEAR(opacity.of(static_cast<float>(n * n)), expected, share > 0.25 && share < 0.254 ? 0.76 : 0.006)
        << n;
  }
  EXPECT_EQ(opacity.of(1e9f), 0);
  EXPECT_EQ(opacity.of(-1), 0.25f);
  // Where magnitudes are equal, the lowest share counts.
  const GradientPercentiles flat({2, 0, 0, 0, 0, 0, 0, 1}, std::vector<float>(8, 1.0f));
  const GradientOpacity of_flat(std::vector<OpacityPoint>{{0, 0}, {0.2, 1}, {1, 1}}, flat);
  EXPECT_EQ(of_flat.of(0), 0);
  EXPECT_EQ(of_flat.of(1), 1);
  EXPECT_EQ(GradientOpacity(points, GradientPercentiles({}, {})).of(3), 0);
}

}  // namespace
}  // namespace curvisplat
