#include "render/frame/frame_statistics.h"

#include <gtest/gtest.h>

#include <set>

namespace curvisplat {
namespace {

/// The number's place in the table, and `more`.
FrameStatistics numbered(double more) {
  FrameStatistics statistics;
  double n = more;
  for (const auto& field : statisticsFields())
    field.visit(statistics, [&](auto& number) { number = static_cast<std::decay_t<decltype(number)>>(n++); });
  return statistics;
}

TEST(FrameStatistics, EachNumberHasANameAndAPlaceOfItsOwn) {
  const FrameStatistics statistics = numbered(0);
  std::set<std::string> names;
  double n = 0;
  for (const auto& field : statisticsFields()) {
    EXPECT_TRUE(names.insert(field.name).second) << field.name;
    field.visit(statistics,
                [&](const auto& number) { EXPECT_EQ(static_cast<double>(number), n++) << field.name; });
  }
  EXPECT_EQ(names.size(), 49u);
}

TEST(FrameStatistics, RanksAddUpOrHaveTheSame) {
  FrameStatistics whole = numbered(0), other = numbered(100);
  other.total_s = 1e6;
  whole.bricks_unreadable = {{3, "a"}, {7, "b"}};
  other.bricks_unreadable = {{5, "c"}, {7, "d"}};
  const FrameStatistics before = whole;
  combine(whole, other);
  EXPECT_EQ(whole.splats_drawn, before.splats_drawn + other.splats_drawn);
  EXPECT_EQ(whole.read_s, before.read_s + other.read_s);
  EXPECT_EQ(whole.workers, before.workers + other.workers);
  EXPECT_EQ(whole.slabs, other.slabs);
  EXPECT_EQ(whole.bricks_culled, other.bricks_culled);
  EXPECT_EQ(whole.total_s, 1e6);
  ASSERT_EQ(whole.bricks_unreadable.size(), 3u);
  EXPECT_EQ(whole.bricks_unreadable[1].reason, "c");
  EXPECT_EQ(whole.bricks_unreadable[2].reason, "b");
}

TEST(FrameStatistics, AThreadAddsItsStageAlone) {
  FrameStatistics sum = numbered(0);
  const FrameStatistics before = sum;
  PrepareStatistics part;
  part.project_s = 2;
  part.splats_clipped = 5;
  combine(sum, part);
  EXPECT_EQ(sum.project_s, before.project_s + 2);
  EXPECT_EQ(sum.splats_clipped, before.splats_clipped + 5);
  EXPECT_EQ(sum.draw_s, before.draw_s);
}

}  // namespace
}  // namespace curvisplat
