#include "render/project/footprint_skew.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "render/project/kernel.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

TEST(FootprintSkew, KeepsItsNumbers) {
  const FootprintSkew skew{{0.5f, -0.31f, 0.02f, -1.2f}};
  const FootprintSkew kept = FootprintSkew::unpack(skew.pack());
  for (size_t n = 0; n < 4; ++n) EXPECT_NEAR(kept.t[n], skew.t[n], 0.005) << n;
  EXPECT_EQ(FootprintSkew{}.pack(), 0u);
  EXPECT_NEAR(FootprintSkew::unpack(FootprintSkew{{99, -99, 0, 0}}.pack()).t[1], -1.27, 1e-6);
  // Of cameras that are beyond single precision. The undefined-behaviour sanitizer looks, too.
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

}  // namespace
}  // namespace curvisplat
