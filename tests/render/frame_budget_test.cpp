#include "render/frame/frame_budget.h"

#include <gtest/gtest.h>

#include <string>

#include "stream/base/error.h"

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
      EXPECT_NE(std::string(error.what()).find("give at least"), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(least, 64u);
}

}  // namespace
}  // namespace curvisplat
