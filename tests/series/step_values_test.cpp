// Values of steps: which are kept in memory; streams that are predicted in time, which decode to the same
// numbers as those of the step alone; and histograms of each step and of a series.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/series_values.h"
#include "stream/cache/value_histogram.h"
#include "stream/codec/prediction.h"
#include "stream/codec/values_codec.h"
#include "tests/series/step_series.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

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

constexpr uint32_t kCount = 3000;

/// Values at a time: waves that move, and noise that depends on the seed alone.
std::vector<SplatScalar> valuesAt(double time, unsigned noise_seed, double noise) {
  std::mt19937 random(noise_seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<SplatScalar> values(kCount);
  for (uint32_t n = 0; n < kCount; ++n) {
    const double x = 0.7 * n;
    values[n].mean = 5 + time + noise * uniform(random) + 0.1 * std::sin(x);
    values[n].slope = {0.1 * std::cos(x + time), 0.02 * uniform(random), -0.5 * noise};
    values[n].variance = n % 3 ? 0 : 1e-3 * (1 + 0.1 * time);
  }
  return values;
}

SplatVariable decoded(std::span<const std::byte> bytes, const TimeReferences& references = {}) {
  SplatVariable values;
  values.resize(kCount);
  decodeValuesStream(kCount, bytes, arraysOf(values), references);
  return values;
}

void expectSameVariable(const SplatVariable& a, const SplatVariable& b) {
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.slope0, b.slope0);
  EXPECT_EQ(a.slope1, b.slope1);
  EXPECT_EQ(a.slope2, b.slope2);
  EXPECT_EQ(a.variance, b.variance);
}

TEST(TimePrediction, DecodesToTheSameNumbersInFewerBytes) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0.1, 1, 1), third = valuesAt(0.2, 1, 1);
  const auto first_stream = encodeValuesStream(rows, first);
  const SplatVariable first_values = decoded(first_stream);

  TimeReferences one;
  one.steps_back = {1, 0};
  one.values[0] = arraysOf(first_values);
  auto second_alone = second;
  const auto alone = encodeValuesStream(rows, second_alone), timed = encodeValuesStream(rows, second, one);
  EXPECT_EQ(stepsBackOf(alone), (std::array<uint8_t, 2>{0, 0}));
  EXPECT_EQ(stepsBackOf(timed), (std::array<uint8_t, 2>{1, 0}));
  EXPECT_LT(timed.size(), alone.size() * 6 / 10);
  expectSameVariable(decoded(timed, one), decoded(alone));
  for (uint32_t n = 0; n < kCount; ++n) EXPECT_EQ(second[n].mean, second_alone[n].mean);

  const SplatVariable second_values = decoded(alone);
  TimeReferences two;
  two.steps_back = {1, 2};
  two.values = {arraysOf(second_values), arraysOf(first_values)};
  auto third_alone = third;
  const auto third_stream = encodeValuesStream(rows, third_alone);
  const auto third_timed = encodeValuesStream(rows, third, two);
  EXPECT_EQ(stepsBackOf(third_timed), (std::array<uint8_t, 2>{1, 2}));
  EXPECT_LT(third_timed.size(), third_stream.size());
  expectSameVariable(decoded(third_timed, two), decoded(third_stream));
}

/// Codes by the values' own scale, whose units follow from the decoded means.
TEST(TimePrediction, OfScaledValuesDecodesToTheSameNumbers) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  const ValueCoding coding{ValuePrecision::kAuto, {5, 1e-3}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0.01, 1, 1), third = valuesAt(0.02, 1, 1);
  const SplatVariable first_values = decoded(encodeValuesStream(rows, first, {}, coding));
  TimeReferences references;
  references.steps_back = {1, 0};
  references.values[0] = arraysOf(first_values);
  auto second_alone = second;
  const auto alone = encodeValuesStream(rows, second_alone, {}, coding);
  const auto timed = encodeValuesStream(rows, second, references, coding);
  ASSERT_STREQ(featureOf(timed), kScaledValues);
  EXPECT_EQ(stepsBackOf(timed)[0], 1);
  EXPECT_LT(timed.size(), alone.size());
  expectSameVariable(decoded(timed, references), decoded(alone));
  const SplatVariable second_values = decoded(alone);
  references.steps_back = {1, 2};
  references.values = {arraysOf(second_values), arraysOf(first_values)};
  auto third_alone = third;
  const auto third_stream = encodeValuesStream(rows, third_alone, {}, coding);
  expectSameVariable(decoded(encodeValuesStream(rows, third, references, coding), references),
                     decoded(third_stream));
}

TEST(TimePrediction, IsNotUsedWhereItGainsNothing) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0, 2, 1);
  const SplatVariable values = decoded(encodeValuesStream(rows, first));
  TimeReferences references;
  references.steps_back = {1, 0};
  references.values[0] = arraysOf(values);
  auto alone = second;
  const auto without = encodeValuesStream(rows, alone), with = encodeValuesStream(rows, second, references);
  EXPECT_LE(static_cast<double>(with.size()), 1.01 * static_cast<double>(without.size()));
}

TEST(TimePrediction, HostileHeadersAreRefused) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0.1, 1, 1);
  const SplatVariable values = decoded(encodeValuesStream(rows, first));
  TimeReferences references;
  references.steps_back = {1, 0};
  references.values[0] = arraysOf(values);
  std::vector<std::byte> stream = encodeValuesStream(rows, second, references);
  EXPECT_THROW(decoded(stream), Error);  // its reference is missing
  for (const auto& back : {std::array<uint8_t, 2>{0, 3}, {3, 3}, {4, 2}}) {
    stream[38] = std::byte{back[0]};
    stream[39] = std::byte{back[1]};
    EXPECT_THROW(stepsBackOf(stream), Error);
  }
  EXPECT_THROW(stepsBackOf(std::span(stream).first(20)), Error);
  stream[38] = std::byte{1};
  stream[39] = std::byte{0};
  for (size_t byte = 28; byte < 38; ++byte) {
    std::vector<std::byte> damaged = stream;
    damaged[byte] = std::byte{0x15};
    EXPECT_THROW(decoded(damaged, references), Error);
  }
}

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
      EXPECT_NEAR(below / total, part, 0.002) << v;
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
  expectSays(findings()[0], "histogram at offset");
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
  expectSays(findings()[0], "of its histogram has a share");
}

TEST_F(SeriesHistograms, AreMissingInCachesOfEarlierPrograms) {
  const CacheReader kept(fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/series.splats");
  EXPECT_FALSE(stepHistogram(kept, 0));
  EXPECT_FALSE(seriesHistogram(kept, 0));
}

}  // namespace
}  // namespace curvisplat
