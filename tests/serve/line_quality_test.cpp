// Pictures become as large as the line is fast: against a line that is simulated.
#include "tools/serve/line_quality.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <vector>

namespace curvisplat {
namespace {

/// A line with a delay and a rate, and a page that reports each picture. Pictures are drawn in 40 ms; their bytes
/// halve from level to level.
struct Line {
  double bytes_per_s, delay_s;
  LineQuality quality = {};
  double now_s = 0, free_at_s = 0;
  uint64_t pictures = 0;
  std::deque<std::pair<double, uint64_t>> reports = {};  // when each arrives

  double bytes() const { return 100'000.0 / (1 << quality.level()); }

  void report() {
    now_s = std::max(now_s, reports.front().first);
    quality.shown(reports.front().second, now_s);
    reports.pop_front();
  }

  /// Draws and sends for a while; returns pictures a second.
  double run(double seconds) {
    const double end_s = now_s + seconds;
    const uint64_t before = pictures;
    while (now_s < end_s) {
      now_s += 0.04;
      while (!reports.empty() && reports.front().first <= now_s) report();
      while (!quality.isOpen()) report();
      free_at_s = std::max(free_at_s, now_s) + bytes() / bytes_per_s;
      quality.sent(++pictures, now_s, true);
      reports.emplace_back(free_at_s + delay_s, pictures);
      EXPECT_LE(reports.size(), LineQuality::kMaxOnTheWay);
    }
    return static_cast<double>(pictures - before) / seconds;
  }
};

TEST(LineQuality, StaysFineOnAFastLine) {
  Line line{100e6, 0.001};
  EXPECT_GT(line.run(20), 24);
  EXPECT_EQ(line.quality.level(), 0);
}

TEST(LineQuality, IsNotMistakenForSlowWhenTheLineIsLong) {
  Line line{100e6, 0.15};
  line.run(20);
  EXPECT_EQ(line.quality.level(), 0);
}

TEST(LineQuality, KeepsAFrameRateOnASlowLine) {
  Line line{300e3, 0.02};  // 3 full pictures a second
  line.run(10);
  EXPECT_GT(line.quality.level(), 0);
  EXPECT_GT(line.run(20), 10);
}

TEST(LineQuality, ComesBackWhenTheLineDoes) {
  Line line{200e3, 0.02};
  line.run(20);
  EXPECT_GT(line.quality.level(), 0);
  line.bytes_per_s = 100e6;
  line.run(20);
  EXPECT_EQ(line.quality.level(), 0);
}

TEST(LineQuality, EndsAtTheCoarsest) {
  Line line{2e3, 0.02};
  line.run(2000);
  EXPECT_EQ(line.quality.level(), LineQuality::kCoarsest);
}

TEST(LineQuality, IgnoresReportsOfPicturesThatWereNotSent) {
  LineQuality quality;
  quality.shown(7, 1);
  for (uint64_t n = 1; n <= 3; ++n) quality.sent(n, 1, true);
  EXPECT_FALSE(quality.isOpen());
  quality.shown(99, 2);
  quality.shown(0, 2);
  EXPECT_FALSE(quality.isOpen());
  quality.shown(2, 2);
  EXPECT_EQ(quality.onTheWay(), 1u) << "the first was shown before the second";
  quality.shown(2, 2);
  EXPECT_EQ(quality.onTheWay(), 1u);
}

TEST(LineQuality, LearnsNothingFromLosslessPictures) {
  LineQuality quality;
  double now_s = 0;
  for (uint64_t n = 1; n < 100; n += 2) {
    quality.sent(n, now_s, false);
    quality.sent(n + 1, now_s, true);
    now_s += 3;
    quality.shown(n, now_s);
    quality.shown(n + 1, now_s);
  }
  EXPECT_EQ(quality.level(), 0);
}

}  // namespace
}  // namespace curvisplat
