// Histograms that files of values hold.
#include "stream/cache/value_histogram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/stream_file.h"
#include "tests/stream/test_bricks.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

const RootCube kRoot{{0, 0, 0}, 10};

/// A leaf whose splats have means from 0 to 4 and weights that grow with them.
BrickSplats leafOf(size_t splats, double scale = 1) {
  BrickSplats leaf;
  leaf.variables.resize(1);
  for (size_t n = 0; n < splats; ++n) {
    const double mean = 4.0 * static_cast<double>(n) / static_cast<double>(splats);
    Splat splat;
    splat.weight = scale * (1 + mean);
    leaf.splats.push_back(splat);
    leaf.variables[0].push_back({mean, {}, 0});
  }
  return leaf;
}

TEST(ValueHistogram, HasTheSharesOfTheVolume) {
  HistogramSums sums(kRoot, {{0, "f", "", 0, 4}});
  EXPECT_FALSE(sums.of(0));
  sums.add(leafOf(10'000));
  const auto histogram = sums.of(0);
  ASSERT_TRUE(histogram);
  // The density of the volume at f is (1 + f) / 12.
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    const double middle = (static_cast<double>(bin) + 0.5) * 4 / kHistogramBins;
    EXPECT_NEAR(histogram->shares[bin], (1 + middle) / 12 * 4 / kHistogramBins, 2e-4) << bin;
  }
  EXPECT_NEAR(histogram->volume, 30'000, 3);
  // The share below f is (f + f²/2) / 12.
  EXPECT_NEAR(histogram->percentile(0.5), std::sqrt(13.0) - 1, 0.01);
  EXPECT_NEAR(histogram->percentile(0), 0, 0.01);
  EXPECT_NEAR(histogram->percentile(1), 4, 0.01);
}

TEST(ValueHistogram, DependsOnNoOrder) {
  std::vector<BrickSplats> leaves;
  for (size_t n = 0; n < 50; ++n)
    leaves.push_back(leafOf(100 + 7 * n, std::pow(10.0, 0.3 * static_cast<double>(n) - 9)));
  HistogramSums one(kRoot, {{0, "f", "", -1, 3}}), other(kRoot, {{0, "f", "", -1, 3}}),
      rest(kRoot, {{0, "f", "", -1, 3}});
  for (const BrickSplats& leaf : leaves) one.add(leaf);
  std::mt19937 random(1);
  std::shuffle(leaves.begin(), leaves.end(), random);
  for (size_t n = 0; n < leaves.size(); ++n) (n % 3 == 0 ? other : rest).add(leaves[n]);
  std::vector<uint64_t> words = other.words();
  const std::vector<uint64_t> further = rest.words();
  for (size_t n = 0; n < words.size(); ++n) words[n] += further[n];
  other.setWords(words);
  EXPECT_EQ(one.of(0)->shares, other.of(0)->shares);
  EXPECT_EQ(one.of(0)->volume, other.of(0)->volume);
}

TEST(ValueHistogram, TakesThinDataAndOneValueAndRefusesAbsurdWeights) {
  HistogramSums thin(kRoot, {{0, "f", "", 0, 4}});
  thin.add(leafOf(10'000, 1e-15));
  EXPECT_NEAR(thin.of(0)->percentile(0.5), std::sqrt(13.0) - 1, 0.01);
  HistogramSums constant(kRoot, {{0, "f", "", 2, 2}});
  constant.add(leafOf(100));
  EXPECT_EQ(constant.of(0)->shares[0], 1);
  EXPECT_EQ(constant.of(0)->percentile(0.5), 2);
  HistogramSums absurd(kRoot, {{0, "f", "", 0, 4}});
  absurd.add(leafOf(100, 1e30));
  EXPECT_FALSE(absurd.of(0));
}

class StoredHistogram : public ::testing::Test {
 protected:
  /// A file of values whose stream has `stream` bytes.
  uint64_t write(size_t stream, const std::optional<ValueHistogram>& histogram) const {
    OutputFile file(path);
    beginVariableFile(file);
    const std::vector<std::byte> bytes(stream, std::byte{7});
    appendStream(file, bytes);
    const std::vector<BrickVariable> table(3);
    return finishVariableFile(file, "var.0.bin", table, histogram).size - 3 * sizeof(VariableRecord);
  }

  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "var.0.bin";
};

TEST_F(StoredHistogram, EndsAtTheTableWhateverTheStreams) {
  HistogramSums sums(kRoot, {{0, "f", "", 0, 4}});
  sums.add(leafOf(1000));
  for (const size_t stream : {1u, 1967u, 1968u, 1969u, 4000u, 4064u, 4065u, 10'000u}) {
    SCOPED_TRACE(stream);
    const uint64_t table = write(stream, sums.of(0));
    EXPECT_EQ(table % kPageBytes, 0u);
    EXPECT_LT(table, stream + sizeof(HistogramRecord) + 2 * kPageBytes);
    const auto read = readHistogram(InputFile(path), table);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->shares, sums.of(0)->shares);
    EXPECT_EQ(read->lower, 0);
    EXPECT_EQ(read->upper, 4);
    EXPECT_EQ(read->volume, sums.of(0)->volume);
  }
  EXPECT_FALSE(readHistogram(InputFile(path), write(10'000, std::nullopt)));
}

TEST_F(StoredHistogram, IsRefusedIfAnyByteIsDamaged) {
  HistogramSums sums(kRoot, {{0, "f", "", 0, 4}});
  sums.add(leafOf(1000));
  const uint64_t table = write(100, sums.of(0));
  const std::string good = bytesOfFile(path);
  for (uint64_t at = table - sizeof(HistogramRecord) + 8; at < table; at += 37) {
    std::string bad = good;
    bad[at] ^= 1;
    overwriteFile(path, bad);
    EXPECT_THROW(readHistogram(InputFile(path), table), Error) << at;
  }
  overwriteFile(path, good);
  EXPECT_TRUE(readHistogram(InputFile(path), table));
  EXPECT_FALSE(readHistogram(InputFile(path), table - 1));
  EXPECT_FALSE(readHistogram(InputFile(path), 100));
}

}  // namespace
}  // namespace curvisplat
