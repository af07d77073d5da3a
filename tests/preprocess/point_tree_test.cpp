// Trees that find the boxes that hold a point, and the points that lie in a hexahedron: compared with looking
// at all of them.
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {
namespace {

BoundingBox boxOf(const glm::dvec3& lower, const glm::dvec3& upper) {
  BoundingBox box;
  box.add(lower);
  box.add(upper);
  return box;
}

TEST(BoxTree, FindsWhatASearchOfAllBoxesFinds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(0, 1);
  for (const size_t count : {1, 2, 5, 9, 1000}) {
    std::vector<Bounds> boxes;
    for (size_t n = 0; n < count; ++n) {
      const glm::dvec3 lower(place(random), place(random), place(random));
      const glm::dvec3 size(place(random), place(random), place(random));
      boxes.push_back({n % 10 == 9 ? BoundingBox{} : boxOf(lower, lower + 0.2 * size), {}});
    }
    const BoxTree tree(boxes);
    size_t held = 0;
    for (int query = 0; query < 1000; ++query) {
      const glm::dvec3 point(place(random), place(random), place(random));
      const auto except = static_cast<uint32_t>(random() % count);
      bool expected = false;
      for (uint32_t n = 0; n < count; ++n) expected |= n != except && boxes[n].holds(point);
      EXPECT_EQ(tree.anotherHolds(point, except), expected) << count << " boxes";
      held += expected;
    }
    if (count == 1000) {
      EXPECT_GT(held, 100u);
    }
  }
}

TEST(BoxTree, FindsWhetherAnotherBoxTouches) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(0, 10), size(0, 1);
  std::vector<Bounds> boxes;
  for (int n = 0; n < 200; ++n) {
    const glm::dvec3 at(place(random), place(random), place(random));
    boxes.push_back({{at, at + glm::dvec3(size(random), size(random), size(random))}, {}});
  }
  boxes.push_back({{boxes[3].box.upper, boxes[3].box.upper + 0.1}, {}});  // a corner in common
  boxes.emplace_back();
  const BoxTree tree(boxes);
  uint32_t touching = 0;
  for (uint32_t n = 0; n < boxes.size(); ++n) {
    bool expected = false;
    for (uint32_t other = 0; other < boxes.size(); ++other)
      expected |= other != n && boxes[other].box.touches(boxes[n].box);
    EXPECT_EQ(tree.anotherTouches(boxes[n].box, n), expected) << n;
    touching += expected;
  }
  EXPECT_GT(touching, 10u);
  EXPECT_LT(touching, 190u);
  EXPECT_TRUE(tree.anotherTouches(boxes[3].box, 3));
}

TEST(BoxTree, KnowsABoxFromItself) {
  const Bounds unit{boxOf({0, 0, 0}, {1, 1, 1}), {}};
  const std::vector<Bounds> same(100, unit);
  EXPECT_FALSE(BoxTree(std::vector{unit}).anotherHolds({0.5, 0.5, 0.5}, 0));
  EXPECT_TRUE(BoxTree(same).anotherHolds({1, 0, 0.5}, 99));  // a point of a face
  EXPECT_FALSE(BoxTree(same).anotherHolds({1.01, 0, 0.5}, 99));
  EXPECT_FALSE(BoxTree({}).anotherHolds({0, 0, 0}, 0));
  EXPECT_FALSE(BoxTree(std::vector<Bounds>(3)).anotherHolds({0, 0, 0}, 0));
}

TEST(BoxTree, HoldsWhatBothOfItsBoxesHold) {
  // A unit square along i and j, turned by 45 degrees.
  const double h = std::sqrt(0.5);
  std::array<glm::dvec3, 8> corner;
  for (size_t c = 0; c < 8; ++c) {
    const double i = c & 1 ? 1 : 0, j = c & 2 ? 1 : 0;
    corner[c] = {h * (i - j), h * (i + j), c & 4 ? 1 : 0};
  }
  Bounds turned{boxOf({-h, 0, 0}, {h, 2 * h, 1}), SlantedBox(corner)};
  const auto holds = [&](const glm::dvec3& point) {
    return BoxTree(std::span(&turned, 1)).anotherHolds(point, 1);
  };
  EXPECT_TRUE(holds({0, 0.1, 0.5}));
  EXPECT_FALSE(holds({0.5, 0.1, 0.5}));  // in the axis-parallel box
  EXPECT_FALSE(holds({0, 0.1, 1.5}));
  // Give it more nodes than the corners.
  turned.slanted = SlantedBox(corner, [&](const auto& visit) {
    for (const glm::dvec3& node : corner) visit(node);
    visit({0.5, 0.05, 0.5});
  });
  EXPECT_TRUE(holds({0.5, 0.1, 0.5}));
  EXPECT_FALSE(holds({-0.5, 0.1, 0.5}));
}

struct TestPoint {
  glm::dvec3 position{0.0};
};

using Corners = std::array<glm::dvec3, 8>;

/// A hexahedron with edges `size` long along three directions that no axis is parallel to, corners moved by
/// up to `twist` of it.
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
