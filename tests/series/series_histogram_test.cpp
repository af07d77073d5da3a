// Histograms of each step and of a series.
#include "stream/cache/series_histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_verify.h"
#include "tests/series/step_series.h"
#include "tests/stream/test_bricks.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class SeriesHistograms : public testing::Test {
 protected:
  SeriesHistograms() { convertQuietly(inputOf({{0}, {1}, {2, 0.5}, {3, 0.5}, {4}}), optionsFor(path)); }

  /// The bytes of the file of values of variable 0 at step 1, and where its histogram begins.
  std::pair<std::string, size_t> valuesOfStep() const {
    const CacheReader reader = CacheReader(path).atStep(1);
    std::string bytes = bytesOfFile(reader.valuesPath(0));
    const size_t table = bytes.size() - reader.bricks().size() * sizeof(VariableRecord);
    return {std::move(bytes), table - sizeof(HistogramRecord)};
  }

  const TemporaryFolder folder;
  const fs::path path = folder / "series.splats";
};

/// The verification computes them anew from the decoded leaves.
TEST_F(SeriesHistograms, AreThoseOfTheLeavesAtEachStep) {
  const CacheReader first(path);
  for (uint64_t step = 0; step < 5; ++step) {
    const CacheReader reader = first.atStep(step);
    EXPECT_EQ(verifyCache(reader).findings, std::vector<std::string>{});
    for (size_t v = 0; v < 2; ++v) {
      const auto histogram = stepHistogram(reader, v);
      ASSERT_TRUE(histogram) << step;
      EXPECT_EQ(histogram->lower, reader.manifest().variables[v].min);
      EXPECT_EQ(histogram->upper, reader.manifest().variables[v].max);
      EXPECT_NEAR(histogram->volume, reader.manifest().volume, 1e-6 * histogram->volume);
    }
  }
  EXPECT_FALSE(stepHistogram(first.at({0, 0.5}), 0));
}

TEST_F(SeriesHistograms, OfAllStepsIsTheirSum) {
  const CacheReader first(path);
  for (size_t v = 0; v < 2; ++v) {
    const auto sum = seriesHistogram(first, v);
    ASSERT_TRUE(sum);
    const VariableInfo& info = first.seriesManifest().variables[v];
    EXPECT_EQ(sum->lower, info.min);
    EXPECT_EQ(sum->upper, info.max);
    // The volume of all splats of all steps below a value.
    for (const double part : {0.1, 0.5, 0.9}) {
      const double value = sum->percentile(part);
      double below = 0, total = 0;
      for (uint64_t step = 0; step < 5; ++step) {
        const CacheReader reader = first.atStep(step);
        SplatGeometry geometry;
        SplatVariable values;
        for (uint32_t brick = 0; brick < reader.bricks().size(); ++brick) {
          if (!reader.bricks()[brick].isLeaf()) continue;
          reader.readGeometry(brick, geometry);
          reader.readVariable(brick, v, values);
          for (size_t n = 0; n < values.size(); ++n) {
            total += geometry.weight[n];
            if (double{values.mean[n]} < value) below += geometry.weight[n];
          }
        }
      }
      EXPECT_NEAR(below / total, part, 0.01) << v;
    }
  }
}

TEST_F(SeriesHistograms, ThatAreDamagedOrWrongAreFound) {
  const fs::path file = path / "var.0.1.bin";
  const auto [good, at] = valuesOfStep();
  std::string bad = good;
  bad[at + 100] ^= 1;
  overwriteFile(file, bad);
  const auto findings = [&] { return verifyCache(CacheReader(path).atStep(1)).findings; };
  ASSERT_EQ(findings().size(), 1u);
  EXPECT_NE(findings()[0].find("histogram at offset"), std::string::npos) << findings()[0];
  EXPECT_THROW(seriesHistogram(CacheReader(path), 0), Error);

  // A writer's bug: the checksum is right, two shares are not.
  overwriteFile(file, good);
  ValueHistogram wrong = *readHistogram(InputFile(file), at + sizeof(HistogramRecord));
  const size_t largest =
      static_cast<size_t>(std::max_element(wrong.shares.begin(), wrong.shares.end()) - wrong.shares.begin());
  std::swap(wrong.shares[largest], wrong.shares[largest == 0 ? 1 : 0]);
  const HistogramRecord record = recordOf(wrong);
  bad = good;
  std::memcpy(&bad[at], &record, sizeof record);
  overwriteFile(file, bad);
  ASSERT_EQ(findings().size(), 1u);
  EXPECT_NE(findings()[0].find("of its histogram has a share"), std::string::npos) << findings()[0];
}

TEST_F(SeriesHistograms, AreMissingInCachesOfEarlierPrograms) {
  const CacheReader kept(fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/series.splats");
  EXPECT_FALSE(stepHistogram(kept, 0));
  EXPECT_FALSE(seriesHistogram(kept, 0));
}

}  // namespace
}  // namespace curvisplat
