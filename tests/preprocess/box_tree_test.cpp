// Which boxes hold a point, by the tree and by looking at all of them.
#include "preprocess/survey/box_tree.h"

#include <gtest/gtest.h>

#include <random>

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
    std::vector<BoundingBox> boxes;
    for (size_t n = 0; n < count; ++n) {
      const glm::dvec3 lower(place(random), place(random), place(random));
      const glm::dvec3 size(place(random), place(random), place(random));
      boxes.push_back(n % 10 == 9 ? BoundingBox{} : boxOf(lower, lower + 0.2 * size));
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
  std::vector<BoundingBox> boxes;
  for (int n = 0; n < 200; ++n) {
    const glm::dvec3 at(place(random), place(random), place(random));
    boxes.push_back({at, at + glm::dvec3(size(random), size(random), size(random))});
  }
  boxes.push_back({boxes[3].upper, boxes[3].upper + 0.1});  // a corner in common
  boxes.emplace_back();
  const BoxTree tree(boxes);
  uint32_t touching = 0;
  for (uint32_t n = 0; n < boxes.size(); ++n) {
    bool expected = false;
    for (uint32_t other = 0; other < boxes.size(); ++other)
      expected |= other != n && boxes[other].touches(boxes[n]);
    EXPECT_EQ(tree.anotherTouches(boxes[n], n), expected) << n;
    touching += expected;
  }
  EXPECT_GT(touching, 10u);
  EXPECT_LT(touching, 190u);
  EXPECT_TRUE(tree.anotherTouches(boxes[3], 3));
}

TEST(BoxTree, KnowsABoxFromItself) {
  const BoundingBox unit = boxOf({0, 0, 0}, {1, 1, 1});
  const std::vector<BoundingBox> same(100, unit);
  EXPECT_FALSE(BoxTree(std::vector{unit}).anotherHolds({0.5, 0.5, 0.5}, 0));
  EXPECT_TRUE(BoxTree(same).anotherHolds({1, 0, 0.5}, 99));  // a point of a face
  EXPECT_FALSE(BoxTree(same).anotherHolds({1.01, 0, 0.5}, 99));
  EXPECT_FALSE(BoxTree({}).anotherHolds({0, 0, 0}, 0));
  EXPECT_FALSE(BoxTree(std::vector<BoundingBox>(3)).anotherHolds({0, 0, 0}, 0));
}

}  // namespace
}  // namespace curvisplat
