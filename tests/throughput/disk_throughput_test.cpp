#include "tools/throughput/disk_throughput.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <set>

#include "stream/cache/cache_reader.h"
#include "tests/support/random_cache.h"
#include "tests/support/temporary_folder.h"
#include "tools/throughput/page_cache.h"

namespace curvisplat {
namespace {

constexpr DiskEffort kLittle{.sample_s = 0.001, .samples = 2, .max_bytes = 64 << 20};

Measurements measured(const std::filesystem::path& path) {
  writeRandomCache(path);
  const CacheReader cache(path);
  Measurements measurements;
  Progress progress;
  measureDisk(cache, 0, kLittle, measurements, progress);
  return measurements;
}

std::set<std::string> namesIn(const Measurements& measurements) {
  std::set<std::string> names;
  for (const Measurement& one : measurements.all()) names.insert(one.name);
  for (const auto& one : measurements.leftOut()) names.insert(one.name);
  return names;
}

TEST(DiskThroughput, NamesStayTheSame) {
  const std::vector<DiskRun> runs = diskRuns();
  std::set<std::string> names;
  for (const DiskRun& run : runs) names.insert(run.name());
  EXPECT_EQ(names.size(), runs.size());
  EXPECT_EQ(runs.size(), 4u * (4 + 5));
  for (const char* name : {"disk/direct/4KiB/depth:8", "disk/direct/1MiB/depth:8",
                           "disk/direct/256KiB/depth:32", "disk/buffered-cold/256KiB/depth:1",
                           "disk/buffered-warm/64KiB/depth:8", "disk/direct-pread/256KiB/depth:8"})
    EXPECT_EQ(names.count(name), 1u) << name;
}

TEST(DiskThroughput, EveryRunIsMeasuredOrLeftOutWithAReason) {
  const TemporaryFolder folder;
  const Measurements measurements = measured(folder / "a.splats");
  const std::set<std::string> names = namesIn(measurements);
  for (const DiskRun& run : diskRuns()) EXPECT_EQ(names.count(run.name()), 1u) << run.name();
  EXPECT_EQ(names.size(), diskRuns().size());
  for (const Measurement& one : measurements.all()) {
    EXPECT_EQ(one.unit, "B/s");
    EXPECT_EQ(one.samples.size(), kLittle.samples);
    for (const double sample : one.samples) EXPECT_GT(sample, 0) << one.name;
  }
  for (const auto& one : measurements.leftOut()) EXPECT_FALSE(one.reason.empty()) << one.name;
  EXPECT_TRUE(measurements.median("disk/buffered-warm/256KiB/depth:8"));
}

// A file system without a disk has nothing that could be cold, whatever it says of O_DIRECT.
TEST(DiskThroughput, OfMemoryOnlyTheWarmRowsAreLeft) {
  if (!std::filesystem::is_directory("/dev/shm") || fileSystemOf("/dev/shm") != "tmpfs")
    GTEST_SKIP() << "/dev/shm is no tmpfs";
  const auto path = std::filesystem::path("/dev/shm") / fmt::format("curvisplat-test-{}.splats", ::getpid());
  const Measurements measurements = measured(path);
  std::filesystem::remove_all(path);
  EXPECT_FALSE(measurements.all().empty());
  for (const Measurement& one : measurements.all())
    EXPECT_TRUE(one.name.starts_with("disk/buffered-warm/")) << one.name;
  for (const auto& one : measurements.leftOut())
    EXPECT_NE(one.reason.find("tmpfs"), std::string::npos) << one.name << ": " << one.reason;
}

TEST(DiskThroughput, Stops) {
  const TemporaryFolder folder;
  writeRandomCache(folder / "a.splats");
  const CacheReader cache(folder / "a.splats");
  Measurements measurements;
  Progress progress;
  progress.stop(2);
  EXPECT_THROW(measureDisk(cache, 0, kLittle, measurements, progress), Interrupted);
}

}  // namespace
}  // namespace curvisplat
