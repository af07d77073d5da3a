#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "render/frame/first_picture.h"
#include "render/frame/frame_memory.h"
#include "render/frame/frame_statistics.h"
#include "render/project/screen_view.h"
#include "stream/base/error.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

FrameBudget::Fixed aPicture() {
  FrameBudget::Fixed fixed;
  fixed.index_bytes = 2 << 20;
  fixed.least_pager_bytes = 2 << 20;
  fixed.painter_bytes = 40 << 20;
  fixed.splats = 100'000'000;
  fixed.size = {1920, 1080};
  return fixed;
}

FrameBudget ofMegabytes(uint64_t megabytes, unsigned threads) {
  return FrameBudget::of(megabytes << 20, aPicture(), threads);
}

TEST(FrameBudget, OfManyThreadsLeavesHalfOfTheMemoryToSplats) {
  for (const uint64_t megabytes : {192u, 256u, 384u, 512u, 1024u}) {
    const FrameBudget few = ofMegabytes(megabytes, 2);
    for (const unsigned threads : {3u, 4u, 8u, 16u, 64u, 1000u}) {
      const FrameBudget many = ofMegabytes(megabytes, threads);
      EXPECT_GE(many.workers, few.workers) << megabytes;
      EXPECT_LE(many.workers, threads);
      EXPECT_GE(3 * many.sweep_splats, few.sweep_splats) << megabytes << " MiB, " << threads << " threads";
    }
  }
}

TEST(FrameBudget, GivesAllThreadsAWorkerWhereThereIsRoom) {
  EXPECT_EQ(ofMegabytes(2048, 16).workers, 16u);
  EXPECT_EQ(ofMegabytes(512, 4).workers, 4u);
  EXPECT_EQ(ofMegabytes(192, 2).workers, 2u);
}

TEST(FrameBudget, HasRoomForOneWorkerInTheLeastMemory) {
  unsigned least = 0;
  for (unsigned megabytes = 1; least == 0; ++megabytes) {
    try {
      const FrameBudget budget = ofMegabytes(megabytes, 16);
      EXPECT_EQ(budget.workers, 1u);
      EXPECT_GT(budget.sweep_splats, 0u);
      least = megabytes;
    } catch (const UsageError& error) {
      expectSays(error.what(), "give at least");
    }
  }
  EXPECT_GT(least, 64u);
}

TEST(ReducedSize, HasTwoPixelsADetailAndAtMostAnEighth) {
  const auto sizeFor = [](double detail_px) { return ReducedSize({600, 400}, detail_px).size(); };
  EXPECT_EQ(sizeFor(0).height, 400);
  EXPECT_EQ(sizeFor(2.9).height, 400);
  EXPECT_TRUE(ReducedSize({600, 400}, 2.9).isWhole());
  EXPECT_EQ(sizeFor(4).height, 200);
  EXPECT_EQ(sizeFor(4).width, 300);
  EXPECT_FALSE(ReducedSize({600, 400}, 4).isWhole());
  EXPECT_EQ(sizeFor(1e3).height, 50);
  EXPECT_EQ(sizeFor(INFINITY).height, 50);
  EXPECT_EQ(sizeFor(INFINITY).width, 75);
}

TEST(ReducedSize, SmallImagesStayImages) {
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{3, 2}, ImageSize{1, 400}, ImageSize{400, 1}}) {
    const ReducedSize reduced(size, 1e3);
    EXPECT_GE(reduced.size().width, 1);
    EXPECT_GE(reduced.size().height, 1);
    Image picture(reduced.size());
    picture.rgba.assign(picture.rgba.size(), 0.25f);
    const Image image = reduced.enlarge(picture);
    EXPECT_EQ(image.size.width, size.width);
    EXPECT_EQ(image.size.height, size.height);
    for (const float value : image.rgba) EXPECT_EQ(value, 0.25f);
  }
}

// The enlarged image has at the same place what a camera shows at a pixel of the whole image: a plane of
// values in the world stays that plane.
TEST(ReducedSize, ShowsWhatTheCameraShowsInTheWholeImage) {
  Camera camera;
  camera.parallel_scale = 2;
  const auto colourAt = [](double x, double y) { return static_cast<float>(0.5 + 0.1 * x - 0.07 * y); };
  for (const ImageSize size : {ImageSize{600, 400}, ImageSize{601, 397}, ImageSize{100, 333}})
    for (const double detail_px : {3.0, 5.3, 16.0}) {
      const ReducedSize reduced(size, detail_px);
      const auto paint = [&](ImageSize wanted) {
        const ScreenView view = ScreenView::of(camera, wanted, glm::dvec3(1), 1.5, 1);
        Image image(wanted);
        for (int y = 0; y < wanted.height; ++y)
          for (int x = 0; x < wanted.width; ++x)
            for (int c = 0; c < 4; ++c)
              image.pixel(x, y)[c] = colourAt((x + 0.5 - 0.5 * wanted.width) / view.focal_px,
                                              (y + 0.5 - 0.5 * wanted.height) / view.focal_px);
        return image;
      };
      const Image whole = paint(size), enlarged = reduced.enlarge(paint(reduced.size()));
      const int margin = 9;  // at the edges the nearest pixel goes on
      for (int y = margin; y < size.height - margin; ++y)
        for (int x = margin; x < size.width - margin; ++x)
          ASSERT_NEAR(enlarged.pixel(x, y)[1], whole.pixel(x, y)[1], 1e-5) << x << ' ' << y;
    }
}

/// The number's place in the table, and `more`.
FrameStatistics numberedStatistics(double more) {
  FrameStatistics statistics;
  double n = more;
  for (const auto& field : statisticsFields())
    field.visit(statistics, [&](auto& number) { number = static_cast<std::decay_t<decltype(number)>>(n++); });
  return statistics;
}

TEST(FrameStatistics, EachNumberHasANameAndAPlaceOfItsOwn) {
  const FrameStatistics statistics = numberedStatistics(0);
  std::set<std::string> names;
  double n = 0;
  for (const auto& field : statisticsFields()) {
    EXPECT_TRUE(names.insert(field.name).second) << field.name;
    field.visit(statistics,
                [&](const auto& number) { EXPECT_EQ(static_cast<double>(number), n++) << field.name; });
  }
  EXPECT_EQ(names.size(), 63u);
}

TEST(FrameStatistics, RanksAddUpOrHaveTheSame) {
  FrameStatistics whole = numberedStatistics(0), other = numberedStatistics(100);
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
  FrameStatistics sum = numberedStatistics(0);
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
