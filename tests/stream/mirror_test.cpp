#include "stream/base/mirror.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <string>
#include <thread>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kSize = 1'000'000;

std::byte byteAt(uint64_t offset) {
  return static_cast<std::byte>(offset * 2654435761u >> 13);
}

/// A source that has one file, "data.bin".
class Source {
 public:
  Fetched operator()(const std::string& name, uint64_t offset, uint64_t count) {
    ++requests;
    Fetched sent;
    sent.error = name == "data.bin" ? error.load() : ENOENT;
    sent.file_bytes = size;
    const uint64_t end = std::min<uint64_t>(offset + count, kSize);
    for (uint64_t at = offset; sent.error == 0 && at < end; ++at) sent.bytes.push_back(byteAt(at));
    bytes += sent.bytes.size();
    return sent;
  }

  std::atomic<int> error = 0;
  std::atomic<uint64_t> size = kSize, requests = 0, bytes = 0;
};

class MirrorTest : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  Source source_;
  Mirror mirror_{folder_.path(), [this](const std::string& name, uint64_t offset, uint64_t count) {
                   return source_(name, offset, count);
                 }};

  static void expectBytes(const InputFile& file, uint64_t offset, uint64_t count) {
    std::vector<std::byte> found(count);
    file.readAt(offset, std::span(found));
    for (uint64_t n = 0; n < count; ++n) ASSERT_EQ(found[n], byteAt(offset + n)) << offset + n;
  }
};

TEST_F(MirrorTest, FetchesWhatIsReadOnce) {
  const InputFile file(folder_.path() / "data.bin");
  EXPECT_EQ(file.size(), kSize);
  EXPECT_EQ(source_.requests, 1u);
  expectBytes(file, 500'000, 10);
  EXPECT_EQ(source_.requests, 2u);
  const uint64_t fetched = source_.bytes;
  EXPECT_LT(fetched, kSize / 5);
  expectBytes(file, 500'001, 5);
  EXPECT_EQ(source_.bytes, fetched);
  expectBytes(file, 0, kSize);
  EXPECT_EQ(source_.bytes, kSize);
  EXPECT_EQ(mirror_.fetchedBytes(), kSize);
}

TEST_F(MirrorTest, ThreadsShareWhatIsUnderWay) {
  const InputFile file(folder_.path() / "data.bin");
  std::vector<std::thread> threads;
  for (uint64_t n = 0; n < 8; ++n)
    threads.emplace_back([&, n] { expectBytes(file, n * 20'000, kSize - n * 20'000); });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(source_.bytes, kSize);
}

TEST_F(MirrorTest, FailuresAreErrorsAndPass) {
  EXPECT_THROW(InputFile(folder_.path() / "none.bin"), Error);
  const InputFile file(folder_.path() / "data.bin");
  source_.error = EIO;
  EXPECT_THROW(expectBytes(file, 500'000, 10), Error);
  source_.error = 0;
  source_.size = kSize + 1;  // it is another file
  EXPECT_THROW(expectBytes(file, 500'000, 10), Error);
  source_.size = kSize;
  expectBytes(file, 500'000, 10);
}

TEST_F(MirrorTest, KnowsItsOwnPaths) {
  EXPECT_TRUE(isMirrored(folder_.path() / "data.bin"));
  EXPECT_TRUE(isMirrored(folder_.path() / "inner/data.bin"));
  EXPECT_FALSE(isMirrored(folder_.path()));
  EXPECT_FALSE(isMirrored(folder_.path() / "../data.bin"));
  EXPECT_FALSE(isMirrored(folder_.path().string() + "2/data.bin"));
  EXPECT_FALSE(isMirrored("data.bin"));
}

TEST_F(MirrorTest, SizeThatNoDiskHas) {
  source_.size = uint64_t{1} << 62;
  EXPECT_THROW(InputFile(folder_.path() / "data.bin"), Error);
}

}  // namespace
}  // namespace curvisplat
