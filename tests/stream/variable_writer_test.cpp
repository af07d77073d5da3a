// Variables that are added to a cache that is whole, and the histograms that files of values hold.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/stream_file.h"
#include "stream/cache/value_histogram.h"
#include "stream/cache/values_writer.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/swapped_names.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

class AddedVariable : public ::testing::Test {
 protected:
  AddedVariable() { SmallCache().write(path); }

  /// Appends a value that is the splat's number in its brick, in the order of conversion or not.
  static void appendAll(const CacheReader& reader, VariableWriter& writer) {
    for (uint32_t brick = 0; brick < reader.bricks().size(); ++brick) {
      SplatGeometry geometry;
      std::vector<NodeRun> runs;
      reader.readGeometry(brick, geometry, &runs);
      std::vector<SplatScalar> values(geometry.size());
      for (size_t n = 0; n < values.size(); ++n) values[n].mean = static_cast<double>(n);
      writer.append(brick, std::vector{encodeValues(runs, {}, values)});
    }
  }

  size_t filesInCache() const {
    return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(path), {}));
  }

  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.splats";
};

TEST_F(AddedVariable, IsReadBesideTheOthers) {
  const std::string geometry = bytesOfFile(path / "geometry.bin"), mach = bytesOfFile(path / "var.1.bin");
  {
    const CacheLock lock(path);
    const CacheReader reader(path);
    VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "Pa", 0, 400}});
    appendAll(reader, writer);
    const std::vector<FileInfo> files = writer.finish({"a.xyz", "p.fun"});
    ASSERT_EQ(files.size(), 1u);
    EXPECT_EQ(files[0].name, "var.2.bin");
  }
  const CacheReader reader(path);
  const Manifest& manifest = reader.manifest();
  ASSERT_EQ(manifest.variables.size(), 3u);
  EXPECT_EQ(manifest.variables[2].number, 2u);
  EXPECT_EQ(manifest.variables[2].unit, "Pa");
  EXPECT_EQ(manifest.steps.front().variables, (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(manifest.sources, (std::vector<std::string>{"a.xyz", "p.fun"}));
  SplatVariable values;
  for (uint32_t brick = 0; brick < reader.bricks().size(); ++brick) {
    reader.readVariable(brick, 2, values);
    for (size_t n = 0; n < values.size(); ++n)
      ASSERT_NEAR(values.mean[n], static_cast<double>(n), 1e-4 * static_cast<double>(values.size()));
  }
  EXPECT_TRUE(bytesOfFile(path / "geometry.bin") == geometry);
  EXPECT_TRUE(bytesOfFile(path / "var.1.bin") == mach);
}

TEST_F(AddedVariable, IsSeenByNobodyBeforeItIsWhole) {
  const std::string manifest = bytesOfFile(path / "manifest.json");
  const size_t files = filesInCache();
  {
    const CacheLock lock(path);
    const CacheReader reader(path);
    VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "", 0, 1}, {0, "energy", "", 0, 1}});
    EXPECT_EQ(filesInCache(), files + 2);
    EXPECT_EQ(CacheReader(path).manifest().variables.size(), 2u);
  }
  EXPECT_EQ(filesInCache(), files);
  EXPECT_EQ(bytesOfFile(path / "manifest.json"), manifest);
}

TEST_F(AddedVariable, IsNotThereIfAnySyncFails) {
  if (!namesCanBeSwapped())
    GTEST_SKIP() << "this build swaps no names: a failure may come too late to be undone";
  const std::string manifest = bytesOfFile(path / "manifest.json");
  const size_t files = filesInCache();
  for (int64_t sync = 0;; ++sync) {
    curvisplat::faults::FaultySystemCalls faulty;
    faulty.fail_sync_at = sync;
    bool failed = false;
    try {
      const CacheLock lock(path);
      const CacheReader reader(path);
      VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "", 0, 400}});
      appendAll(reader, writer);
      const ScopedSystemCalls scope(faulty);
      writer.finish({});
    } catch (const Error&) {
      failed = true;
    }
    EXPECT_EQ(failed, sync < 4);
    if (!failed) break;
    EXPECT_EQ(bytesOfFile(path / "manifest.json"), manifest) << sync;
    EXPECT_EQ(filesInCache(), files) << sync;
  }
  EXPECT_EQ(CacheReader(path).manifest().variables.size(), 3u);
  EXPECT_EQ(filesInCache(), files + 1);
}

TEST_F(AddedVariable, LeavesAReplacedCacheAlone) {
  {
    const CacheLock lock(path);
    const CacheReader reader(path);
    VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "", 0, 1}});
    appendAll(reader, writer);
    SmallCache().write(path, true, 7);
    EXPECT_THROW(writer.finish({}), Error);
  }
  const CacheReader reader(path);
  EXPECT_EQ(reader.manifest().variables.size(), 2u);
  EXPECT_EQ(filesInCache(), 6u);
}

TEST_F(AddedVariable, IsLockedAgainstOtherPrograms) {
  const CacheLock lock(path);
  EXPECT_THROW(CacheLock{path}, Error);
  EXPECT_NO_THROW(CacheReader{path});
}

TEST_F(AddedVariable, TheOldManifestThatAKilledProgramLeftIsRemoved) {
  const std::filesystem::path left = path / "manifest.json.part";
  std::filesystem::copy_file(path / "manifest.json", left);
  const int running = ::open(left.c_str(), O_RDONLY);
  ASSERT_EQ(::flock(running, LOCK_EX), 0);
  { const CacheLock lock(path); }
  EXPECT_TRUE(std::filesystem::exists(left));  // which its program may have to put back
  ::close(running);
  { const CacheLock lock(path); }
  EXPECT_FALSE(std::filesystem::exists(left));
}

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

/// Values of a Cauchy distribution, whose tails reach to ±60,000 where its middle half lies from -1 to 1.
TEST(ValueHistogram, HasPercentilesOfAnyTail) {
  BrickSplats leaf = leafOf(100'000);
  HistogramBins bins;
  double lower = 0, upper = 0;
  for (size_t n = 0; n < leaf.size(); ++n) {
    const double rank =
        (static_cast<double>(n * 7919 % leaf.size()) + 0.5) / static_cast<double>(leaf.size());
    leaf.variables[0][n].mean = std::tan(std::numbers::pi * (rank - 0.5));
    leaf.splats[n].weight = 1;
    lower = std::min(lower, leaf.variables[0][n].mean);
    upper = std::max(upper, leaf.variables[0][n].mean);
  }
  // By a part of them that is none too even.
  for (size_t n = 0; n < leaf.size(); n += 37)
    bins.edges.push_back(static_cast<float>(leaf.variables[0][n].mean));
  std::sort(bins.edges.begin(), bins.edges.end());
  bins.shares.assign(bins.edges.size() + 1, 1.0 / static_cast<double>(bins.edges.size() + 1));
  bins.coding.precision = ValuePrecision::kFine;
  HistogramSums sums(kRoot, {{0, "f", "", lower, upper}});
  sums.divide(0, bins);
  sums.add(leaf);
  const auto histogram = sums.of(0);
  ASSERT_TRUE(histogram && !histogram->percentiles.empty());
  for (double part = 0.001; part < 1; part += 0.00025) {
    const double value = histogram->percentile(part), rank = std::atan(value) / std::numbers::pi + 0.5;
    EXPECT_NEAR(rank, part, 0.001) << value;
    EXPECT_NEAR(histogram->shareBelow(value), part, 1e-4);
  }
  EXPECT_GT(histogram->binWidth(), 200);
}

/// Half of the volume lies within one step of the codes, as the free stream does beside a long tail.
TEST(ValueHistogram, HasPercentilesBetweenRoundedValues) {
  BrickSplats leaf = leafOf(20'000);
  HistogramBins bins;
  std::vector<double> exact;
  for (size_t n = 0; n < leaf.size(); ++n) {
    const double part = (static_cast<double>(n) + 0.5) / static_cast<double>(leaf.size());
    exact.push_back(part < 0.5 ? 1.3 * std::pow(part, 3) : 1000 * part);
    leaf.splats[n].weight = 1;
    leaf.variables[0][n].mean = std::round(exact.back() * 65535 / 1000) * 1000 / 65535;
    if (n % 10 == 0 && n > 0) bins.edges.push_back(static_cast<float>(exact.back()));
  }
  bins.shares.assign(bins.edges.size() + 1, 1.0 / static_cast<double>(bins.edges.size() + 1));
  HistogramSums sums(kRoot, {{0, "f", "", 0, 1000}});
  sums.divide(0, bins);
  sums.add(leaf);
  const auto histogram = sums.of(0);
  ASSERT_TRUE(histogram);
  for (double part = 0.002; part < 1; part += 0.01) {
    const double value = histogram->percentile(part);
    const auto above = std::upper_bound(exact.begin(), exact.end(), value);
    EXPECT_NEAR(static_cast<double>(above - exact.begin()) / static_cast<double>(exact.size()), part, 0.001)
        << value;
  }
}

TEST(ValueHistogram, DependsOnNoOrder) {
  std::vector<BrickSplats> leaves;
  for (size_t n = 0; n < 50; ++n)
    leaves.push_back(leafOf(100 + 7 * n, std::pow(10.0, 0.3 * static_cast<double>(n) - 9)));
  HistogramSums one(kRoot, {{0, "f", "", -1, 3}}), other(kRoot, {{0, "f", "", -1, 3}}),
      rest(kRoot, {{0, "f", "", -1, 3}});
  for (HistogramSums* sums : {&one, &other, &rest})
    sums->divide(0, {{0.25f, 1, 1.5f, 3.5f}, {0.1, 0.2, 0.1, 0.5, 0.1}, {}});
  for (const BrickSplats& leaf : leaves) one.add(leaf);
  std::mt19937 random(1);
  std::shuffle(leaves.begin(), leaves.end(), random);
  for (size_t n = 0; n < leaves.size(); ++n) (n % 3 == 0 ? other : rest).add(leaves[n]);
  std::vector<uint64_t> words = other.words();
  const std::vector<uint64_t> further = rest.words();
  for (size_t n = 0; n < words.size(); ++n) words[n] += further[n];
  other.setWords(words);
  EXPECT_EQ(one.of(0)->shares, other.of(0)->shares);
  EXPECT_EQ(one.of(0)->percentiles, other.of(0)->percentiles);
  EXPECT_EQ(one.of(0)->volume, other.of(0)->volume);
}

/// Bins of one value have it as their percentiles, not the next float.
TEST(ValueHistogram, HasPercentilesOfOneValueExactly) {
  BrickSplats leaf = leafOf(1000);
  for (size_t n = 0; n < leaf.size(); ++n) leaf.variables[0][n].mean = n % 4 == 0 ? 1 : 0;
  HistogramSums sums(kRoot, {{0, "f", "", 0, 1}});
  sums.divide(0, {{0, std::nextafter(0.0F, 1.0F), 1}, {0, 0.75, 0, 0.25}, {}});
  sums.add(leaf);
  EXPECT_EQ(sums.of(0)->percentile(0.5), 0);
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
  sums.divide(0, {{1, 2, 3}, {0.2, 0.3, 0.3, 0.2}, {}});
  sums.add(leafOf(1000));
  for (const size_t stream : {1u, 1967u, 1968u, 1969u, 4000u, 4064u, 4065u, 10'000u}) {
    SCOPED_TRACE(stream);
    const uint64_t table = write(stream, sums.of(0));
    EXPECT_EQ(table % kPageBytes, 0u);
    EXPECT_LT(table, stream + sizeof(PercentilesRecord) + sizeof(HistogramRecord) + 2 * kPageBytes);
    const auto read = readHistogram(InputFile(path), table);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->shares, sums.of(0)->shares);
    EXPECT_EQ(read->percentiles, sums.of(0)->percentiles);
    EXPECT_EQ(read->lower, 0);
    EXPECT_EQ(read->upper, 4);
    EXPECT_EQ(read->volume, sums.of(0)->volume);
  }
  EXPECT_FALSE(readHistogram(InputFile(path), write(10'000, std::nullopt)));
}

TEST_F(StoredHistogram, IsRefusedIfAnyByteIsDamaged) {
  HistogramSums sums(kRoot, {{0, "f", "", 0, 4}});
  sums.divide(0, {{1, 2, 3}, {0.2, 0.3, 0.3, 0.2}, {}});
  sums.add(leafOf(1000));
  const uint64_t table = write(100, sums.of(0));
  const std::string good = bytesOfFile(path);
  const uint64_t begin = table - sizeof(HistogramRecord);
  for (uint64_t at = begin - sizeof(PercentilesRecord) + 8; at < table; at += 37) {
    if (at < begin + 8 && at + 4 >= begin)
      continue;  // reserved bytes, and what says that there is a histogram
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
