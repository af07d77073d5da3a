#include "stream/cache/kept_values.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>

namespace curvisplat {
namespace {

KeptValues::Values valuesOf(size_t splats) {
  auto values = std::make_shared<SplatVariable>();
  values->resize(splats);
  return values;
}

TEST(KeptValues, LetsGoOfTheLeastRecentlyUsed) {
  KeptValues kept(3 * KeptValues::charge(100));
  const auto first = valuesOf(100);
  kept.keep({0, 0, 7}, first);
  kept.keep({1, 0, 7}, valuesOf(100));
  kept.keep({1, 0, 8}, valuesOf(100));
  EXPECT_EQ(kept.find({0, 0, 7}), first);
  kept.keep({2, 0, 7}, valuesOf(100));
  EXPECT_EQ(kept.find({0, 0, 7}), first);
  EXPECT_EQ(kept.find({1, 0, 7}), nullptr);
  EXPECT_NE(kept.find({1, 0, 8}), nullptr);
  EXPECT_NE(kept.find({2, 0, 7}), nullptr);
  EXPECT_EQ(kept.statistics().bytes, kept.capacity());
  EXPECT_EQ(kept.statistics().hits, 4u);
}

TEST(KeptValues, StaysWithinItsCapacity) {
  KeptValues kept(3 * KeptValues::charge(100));
  kept.keep({0, 0, 0}, valuesOf(1000));  // too large
  EXPECT_EQ(kept.find({0, 0, 0}), nullptr);
  for (uint32_t brick = 0; brick < 50; ++brick) kept.keep({0, 0, brick}, valuesOf(50 + brick));
  EXPECT_GT(kept.statistics().peak_bytes, 0u);
  EXPECT_LE(kept.statistics().peak_bytes, kept.capacity());
  kept.keep({0, 0, 49}, valuesOf(1));  // has it
  EXPECT_EQ(kept.find({0, 0, 49})->size(), 99u);
  KeptValues none(0);
  none.keep({0, 0, 0}, valuesOf(1));
  EXPECT_EQ(none.find({0, 0, 0}), nullptr);
}

}  // namespace
}  // namespace curvisplat
