// Which points lie in a hexahedron, by the tree and by looking at all of them.
#include "preprocess/survey/point_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <random>

#include "preprocess/grid/hexahedron_location.h"

namespace curvisplat {
namespace {

struct TestPoint {
  glm::dvec3 position{0.0};
};

using Corners = std::array<glm::dvec3, 8>;

/// With edges `size` long along three directions that no axis is parallel to, corners moved by up to `twist` of it.
Corners slanted(const glm::dvec3& lower, const glm::dvec3& size, double twist, std::mt19937& random) {
  std::uniform_real_distribution<double> moved(-twist, twist);
  const glm::dvec3 u = glm::normalize(glm::dvec3(1, 1, 1)), v = glm::normalize(glm::dvec3(1, -2, 1)),
                   w = glm::cross(u, v);
  Corners corner;
  for (size_t n = 0; n < 8; ++n) {
    const glm::dvec3 at =
        size * glm::dvec3((n & 1) + moved(random), (n >> 1 & 1) + moved(random), (n >> 2) + moved(random));
    corner[n] = lower + at.x * u + at.y * v + at.z * w;
  }
  return corner;
}

bool isInside(const Corners& corner, const glm::dvec3& point) {
  const std::optional<glm::dvec3> u = locateInHexahedron(corner, point);
  return u && std::abs(u->x) < 1 && std::abs(u->y) < 1 && std::abs(u->z) < 1;
}

struct Cloud {
  std::vector<TestPoint> points;
  std::vector<uint32_t> numbers;

  Cloud(size_t count, const glm::dvec3& origin, std::mt19937& random) {
    std::uniform_real_distribution<double> place(0, 1);
    for (uint32_t n = 0; n < count; ++n) {
      points.push_back({origin + glm::dvec3(place(random), place(random), place(random))});
      numbers.push_back(n);
    }
  }
  PointTree tree() const { return PointTree(std::span<const TestPoint>(points), numbers); }
};

TEST(PointTree, FindsEveryPointThatLiesInACell) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(0, 1);
  for (const double far : {0.0, 1e9}) {  // there rounding is as large as the thinnest cells
    const Cloud cloud(3000, glm::dvec3(far), random);
    const PointTree tree = cloud.tree();
    size_t inside = 0;
    for (int query = 0; query < 200; ++query) {
      const glm::dvec3 lower =
          glm::dvec3(far) + 0.5 * glm::dvec3(place(random), place(random), place(random));
      const glm::dvec3 size(std::pow(10, -4 * place(random)), std::pow(10, -4 * place(random)),
                            place(random));
      const Corners corner = slanted(lower, size, query % 3 * 0.2, random);
      std::vector<bool> found(cloud.points.size());
      tree.forEachNear(corner, [&](uint32_t n) { found[n] = true; });
      for (const uint32_t n : cloud.numbers) {
        if (!isInside(corner, cloud.points[n].position)) continue;
        ASSERT_TRUE(found[n]) << "point " << n << " of cell " << query;
        ++inside;
      }
    }
    EXPECT_GT(inside, 1000u);
  }
}

TEST(PointTree, GivesFewPointsThatALongThinCellDoesNotHold) {
  std::mt19937 random(5);
  const Cloud cloud(100'000, glm::dvec3(0.0), random);
  const PointTree tree = cloud.tree();
  for (const glm::dvec3& size : {glm::dvec3(1.7, 0.02, 0.02), glm::dvec3(1.7, 1.7, 1e-3)}) {
    const Corners corner = slanted(glm::dvec3(0.0), size, 0, random);
    size_t inside = 0, near = 0;
    for (const TestPoint& point : cloud.points) inside += isInside(corner, point.position);
    tree.forEachNear(corner, [&](uint32_t) { ++near; });
    EXPECT_GT(inside, 10u);
    EXPECT_LE(near, inside + 300);  // those of the first few nodes are tested by the bounding box alone
  }
}

TEST(PointTree, OfNoPointsFindsNone) {
  const PointTree tree(std::span<const TestPoint>{}, {});
  EXPECT_EQ(tree.size(), 0u);
  std::mt19937 random(1);
  tree.forEachNear(slanted(glm::dvec3(0.0), glm::dvec3(1.0), 0, random), [](uint32_t) { FAIL(); });
}

TEST(PointTree, OfPointsThatCoincideFindsThemAll) {
  const std::vector<TestPoint> points(1000, TestPoint{glm::dvec3(0.5)});
  std::vector<uint32_t> numbers;
  for (uint32_t n = 0; n < 1000; n += 2) numbers.push_back(n);
  const PointTree tree(std::span<const TestPoint>(points), numbers);
  Corners unit;
  for (size_t n = 0; n < 8; ++n) unit[n] = glm::dvec3(n & 1, n >> 1 & 1, n >> 2);
  size_t found = 0;
  tree.forEachNear(unit, [&](uint32_t n) { found += n % 2 == 0; });
  EXPECT_EQ(found, numbers.size());
}

}  // namespace
}  // namespace curvisplat
