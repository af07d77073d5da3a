// Rates of the disk, cold and warm. Cold is cold: what mincore says before and after.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <random>
#include <set>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
#include "tools/throughput/disk_throughput.h"
#include "tools/throughput/machine.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPages = 300;

/// A file of kPages pages, its last one not full.
std::filesystem::path writeFile(const std::filesystem::path& path) {
  const auto page = static_cast<size_t>(::sysconf(_SC_PAGESIZE));
  std::vector<char> bytes(kPages * page - 100);
  std::mt19937 random(1);
  for (char& byte : bytes) byte = static_cast<char>(random());
  OutputFile file(path);
  file.append(std::span<const char>(bytes));
  file.close();
  return path;
}

void readAll(const std::filesystem::path& path) {
  const InputFile file(path);
  std::vector<std::byte> bytes(file.size());
  file.readAt(0, std::span(bytes));
}

class PageCache : public testing::Test {
 protected:
  void SetUp() override {
    if (isInMemory(fileSystemOf(folder_.path()))) GTEST_SKIP() << folder_.path() << " is in memory";
  }
  const TemporaryFolder folder_;
};

TEST_F(PageCache, WhatWasReadIsInMemoryAndWhatWasDroppedIsNot) {
  const std::array files{writeFile(folder_ / "a"), writeFile(folder_ / "b")};
  for (const auto& file : files) {
    readAll(file);
    EXPECT_EQ(residenceOf(file), (PageResidence{kPages, kPages}));
  }
  EXPECT_EQ(dropPages(files), std::nullopt);
  for (const auto& file : files) EXPECT_EQ(residenceOf(file), (PageResidence{kPages, 0}));
  readAll(files[0]);
  EXPECT_EQ(residenceOf(files[0]), (PageResidence{kPages, kPages}));
  EXPECT_EQ(residenceOf(files[1]), (PageResidence{kPages, 0}));
}

TEST_F(PageCache, CountsPagesOfAPartOfAFile) {
  const auto path = writeFile(folder_ / "a");
  const auto page = static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
  readAll(path);
  EXPECT_EQ(residenceOf(path, 10 * page, 20 * page + 1), (PageResidence{21, 21}));
  EXPECT_EQ(residenceOf(path, 0, 0), PageResidence{});
}

// Pages that are not on the disk yet cannot be dropped: they are written first.
TEST_F(PageCache, DropsWhatWasJustWritten) {
  const std::array files{folder_ / "a"};
  OutputFile file(files[0]);
  const std::vector<std::byte> bytes(1 << 20, std::byte{1});
  file.append(bytes);
  EXPECT_EQ(dropPages(files), std::nullopt);
  EXPECT_EQ(residenceOf(files[0]).resident, 0u);
}

// Pages that another mapping uses stay, and that is said.
TEST_F(PageCache, ReportsPagesThatStay) {
  const std::array files{writeFile(folder_ / "a")};
  const InputFile opened(files[0]);
  const int fd = SystemCalls::current().open(files[0].c_str(), 0, 0);
  ASSERT_GE(fd, 0);
  void* const mapped = ::mmap(nullptr, opened.size(), PROT_READ, MAP_SHARED | MAP_POPULATE, fd, 0);
  ASSERT_NE(mapped, MAP_FAILED);
  const auto reason = dropPages(files);
  ::munmap(mapped, opened.size());
  SystemCalls::current().close(fd);
  ASSERT_TRUE(reason);
  EXPECT_NE(reason->find("stay in memory"), std::string::npos) << *reason;
  EXPECT_EQ(dropPages(files), std::nullopt);
}

TEST(PageCacheInMemory, OfAFileSystemInMemoryStaysAndIsNamed) {
  if (!std::filesystem::is_directory("/dev/shm") || fileSystemOf("/dev/shm") != "tmpfs")
    GTEST_SKIP() << "/dev/shm is no tmpfs";
  const auto path = std::filesystem::path("/dev/shm") / fmt::format("curvisplat-test-{}", ::getpid());
  const std::array files{writeFile(path)};
  const auto reason = dropPages(files);
  std::filesystem::remove(path);
  ASSERT_TRUE(reason);
  EXPECT_NE(reason->find("tmpfs"), std::string::npos) << *reason;
}

TEST(PageCacheErrors, NameTheFile) {
  const std::array files{std::filesystem::path("/nowhere/at-all")};
  EXPECT_THROW(dropPages(files), Error);
  EXPECT_THROW(fileSystemOf("/nowhere/at-all"), Error);
}

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
