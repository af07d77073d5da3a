// Which boxes hold a point, by the tree and by looking at all of them.
#include "preprocess/survey/box_tree.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

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
  // Of more nodes than the corners.
  turned.slanted = SlantedBox(corner, [&](const auto& visit) {
    for (const glm::dvec3& node : corner) visit(node);
    visit({0.5, 0.05, 0.5});
  });
  EXPECT_TRUE(holds({0.5, 0.1, 0.5}));
  EXPECT_FALSE(holds({-0.5, 0.1, 0.5}));
}

}  // namespace
}  // namespace curvisplat
