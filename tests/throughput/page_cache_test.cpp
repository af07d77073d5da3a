// Cold is cold: what mincore says before and after.
#include "tools/throughput/page_cache.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <random>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/temporary_folder.h"

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

}  // namespace
}  // namespace curvisplat
