#include "stream/base/file.h"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "tests/support/faulty_system_calls.h"

namespace curvisplat {
namespace {

using faults::FaultySystemCalls;

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder =
        std::filesystem::path(::testing::TempDir()) /
        (std::string("curvisplat_file_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(folder);
    std::filesystem::create_directory(folder);
  }
  void TearDown() override { std::filesystem::remove_all(folder); }

  std::vector<std::byte> someBytes(size_t count) {
    std::vector<std::byte> bytes(count);
    for (size_t n = 0; n < count; ++n) bytes[n] = static_cast<std::byte>(n * 7 + n / 256);
    return bytes;
  }
  static std::string messageOf(const std::function<void()>& work) {
    try {
      work();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder;
};

TEST_F(FileTest, ShortAndInterruptedTransfersAreCompleted) {
  FaultySystemCalls faulty;
  faulty.largest_transfer = 7;
  faulty.interrupt_every = 3;
  const ScopedSystemCalls scope(faulty);
  const std::vector<std::byte> bytes = someBytes(1000);
  OutputFile out(folder / "file");
  out.append(std::span(bytes).first(400));
  out.append(std::span(bytes).subspan(400));
  EXPECT_EQ(out.size(), 1000u);
  out.close();

  const InputFile in(folder / "file");
  std::vector<std::byte> back(990);
  in.readAt(10, std::span(back));
  EXPECT_TRUE(std::equal(back.begin(), back.end(), bytes.begin() + 10));
  EXPECT_GT(faulty.reads, 100);
}

TEST_F(FileTest, DirectTransfersThatAreCutShortGoOnThroughThePageCache) {
  constexpr size_t kPages = 5;
  struct alignas(kDirectAlignment) Page {
    std::array<std::byte, kDirectAlignment> bytes;
  };
  std::vector<Page> pages(kPages), back(kPages);
  for (size_t n = 0; n < kPages; ++n) pages[n].bytes.fill(static_cast<std::byte>(n + 1));
  for (const size_t largest_transfer : {SIZE_MAX, size_t{1000}}) {
    FaultySystemCalls faulty;
    faulty.largest_transfer = largest_transfer;
    const ScopedSystemCalls scope(faulty);
    OutputFile out(folder / "file", Caching::kDirect);
    out.append(std::as_bytes(std::span(pages)));
    out.close();
    const InputFile in(folder / "file", Caching::kDirect);
    in.readAt(0, std::as_writable_bytes(std::span(back)));
    for (size_t n = 0; n < kPages; ++n) EXPECT_EQ(back[n].bytes, pages[n].bytes) << n;
  }
}

TEST_F(FileTest, FailuresNameThePathThePlaceAndTheReason) {
  const std::vector<std::byte> bytes = someBytes(100);
  FaultySystemCalls faulty;
  faulty.largest_transfer = 40;
  faulty.fail_write_at = 2;
  const ScopedSystemCalls scope(faulty);
  OutputFile out(folder / "full");
  const std::string full = messageOf([&] { out.append(std::span(bytes)); });
  EXPECT_NE(full.find((folder / "full").string()), std::string::npos) << full;
  EXPECT_NE(full.find("no room for 20 more bytes"), std::string::npos) << full;
  EXPECT_NE(full.find("No space left"), std::string::npos) << full;

  faulty.fail_sync_at = 0;
  faulty.error = EIO;
  const std::string broken = messageOf([&] { out.append(std::span(bytes)); });
  EXPECT_NE(broken.find("offset 0: Input/output error"), std::string::npos) << broken;
  EXPECT_NE(messageOf([&] { out.close(); }).find("Input/output error"), std::string::npos);
}

TEST_F(FileTest, ReadingPastTheEndSaysWhereTheFileEnds) {
  OutputFile out(folder / "short");
  out.append(std::span<const std::byte>(someBytes(10)));
  out.close();
  const InputFile in(folder / "short");
  std::vector<std::byte> to(20);
  const std::string message = messageOf([&] { in.readAt(4, std::span(to)); });
  EXPECT_NE(message.find("ends at byte 10"), std::string::npos) << message;
}

TEST_F(FileTest, MissingFilesAndFoldersAreRefused) {
  EXPECT_THROW(InputFile(folder / "none"), Error);
  EXPECT_THROW(InputFile{folder}, Error);
  EXPECT_THROW(OutputFile(folder / "none" / "file"), Error);
}

TEST_F(FileTest, GoesOnWithAFileThatIsThere) {
  writeFileAtomically(folder / "file", std::string("0123456789"));
  OutputFile out(folder / "file", Caching::kPages, OutputFile::Existing::kKeep);
  EXPECT_EQ(out.size(), 10u);
  out.truncate(4);
  EXPECT_EQ(out.size(), 4u);
  out.append(std::as_bytes(std::span("ab", 2)));
  out.close();
  EXPECT_EQ(readTextFile(folder / "file"), "0123ab");
  OutputFile emptied(folder / "file");
  EXPECT_EQ(emptied.size(), 0u);
}

TEST_F(FileTest, AnAtomicWriteFollowsNoLink) {
  writeFileAtomically(folder / "other", std::string("mine"));
  std::filesystem::create_symlink(folder / "other", folder / "file.part");
  writeFileAtomically(folder / "file", std::string("new"));
  EXPECT_EQ(readTextFile(folder / "other"), "mine");
  EXPECT_EQ(readTextFile(folder / "file"), "new");
}

TEST_F(FileTest, AnAtomicWriteThatFailsLeavesTheOldFile) {
  writeFileAtomically(folder / "file", std::string("old"));
  for (const char* stage : {"write", "sync", "rename"}) {
    FaultySystemCalls faulty;
    (stage[0] == 'w'   ? faulty.fail_write_at
     : stage[0] == 's' ? faulty.fail_sync_at
                       : faulty.fail_rename_at) = 0;
    {
      const ScopedSystemCalls scope(faulty);
      EXPECT_THROW(writeFileAtomically(folder / "file", std::string("new")), Error) << stage;
    }
    EXPECT_EQ(readTextFile(folder / "file"), "old") << stage;
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1) << stage;
  }
  writeFileAtomically(folder / "file", std::string("new"));
  EXPECT_EQ(readTextFile(folder / "file"), "new");
}

TEST_F(FileTest, ATextFileIsBounded) {
  writeFileAtomically(folder / "file", std::string(100, 'x'));
  EXPECT_THROW(readTextFile(folder / "file", 99), Error);
  // Transfer functions, camera paths and view states are.
  std::filesystem::resize_file(folder / "file", 16 << 20);
  EXPECT_EQ(readTextFile(folder / "file").size(), 16u << 20);
  std::filesystem::resize_file(folder / "file", (16 << 20) + 1);
  EXPECT_THROW(readTextFile(folder / "file"), Error);
}

}  // namespace
}  // namespace curvisplat
