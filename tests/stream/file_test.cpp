#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/plugin.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

TEST(Paths, LinksLeadToWhatIsThereOrToBe) {
  const TemporaryFolder folder;
  EXPECT_EQ(linkTarget(folder / "none"), folder / "none");
  fs::create_symlink("none", folder / "link");
  fs::create_symlink(folder / "link", folder / "further");
  EXPECT_EQ(linkTarget(folder / "further"), folder / "none");
  EXPECT_EQ(writableTarget(folder / "further"), folder / "none");
  EXPECT_FALSE(isRegularFile(folder / "further"));
  writeFileAtomically(folder / "none", std::string("some"));
  EXPECT_TRUE(isRegularFile(folder / "further"));
  EXPECT_FALSE(isRegularFile(folder.path() / std::string(5000, 'x')));

  fs::create_symlink("round", folder / "about");
  fs::create_symlink("about", folder / "round");
  EXPECT_THROW(linkTarget(folder / "round"), Error);
  fs::create_directory(folder / "folder");
  EXPECT_THROW(writableTarget(folder / "folder"), Error);
}

TEST(Paths, ExtensionsAreInSmallLetters) {
  EXPECT_EQ(extensionOf("a/b.PnG"), ".png");
  EXPECT_EQ(extensionOf("a.tar.GZ"), ".gz");
  EXPECT_EQ(extensionOf("a.b/name"), "");
}

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

TEST_F(FileTest, ReadsOfOneThreadEndOnceAJobIsStopped) {
  std::ofstream(folder / "file") << "abc";
  const InputFile in(folder / "file");
  std::array<std::byte, 3> bytes{};
  Progress job, other;
  {
    const StoppableReads outer(other);
    {
      const StoppableReads reading(job);
      in.readAt(0, std::span(bytes));
      job.stop(SIGINT);
      EXPECT_THROW(in.readAt(0, std::span(bytes)), Interrupted);
      std::thread([&] { in.readAt(0, std::span(bytes)); }).join();
    }
    in.readAt(0, std::span(bytes));
    other.stop(SIGINT);
    EXPECT_THROW(in.readAt(0, std::span(bytes)), Interrupted);
  }
  in.readAt(0, std::span(bytes));
}

TEST_F(FileTest, ANameIsMissingOrThereOrCannotBeLookedAt) {
  std::ofstream(folder / "file") << "abc";
  fs::create_symlink("file", folder / "link");
  fs::create_symlink("none", folder / "dangling");
  fs::create_symlink("loop", folder / "loop");
  for (const char* const name : {"file", "link"}) EXPECT_TRUE(isFileThere(folder / name));
  for (const char* const name : {"none", "file/below"}) EXPECT_FALSE(isFileThere(folder / name));
  EXPECT_TRUE(isThere(folder));
  const auto reason = [&](const fs::path& path) { return errorOf([&] { isFileThere(path); }); };
  EXPECT_PRED2(says, reason(folder), "is not a regular file");
  EXPECT_PRED2(says, reason(folder / "dangling"), "is a link to none, which does not exist");
  EXPECT_PRED2(says, reason(folder / "loop"), "cannot be looked at");
  EXPECT_PRED2(says, reason(folder / std::string(5000, 'a')), "cannot be looked at");
}

TEST_F(FileTest, FailuresNameThePathThePlaceAndTheReason) {
  const std::vector<std::byte> bytes = someBytes(100);
  FaultySystemCalls faulty;
  faulty.largest_transfer = 40;
  faulty.fail_write_at = 2;
  const ScopedSystemCalls scope(faulty);
  OutputFile out(folder / "full");
  const std::string full = errorOf([&] { out.append(std::span(bytes)); });
  expectSays(full, (folder / "full").string());
  expectSays(full, "no room for 20 more bytes");
  expectSays(full, "No space left");

  faulty.fail_sync_at = 0;
  faulty.error = EIO;
  const std::string broken = errorOf([&] { out.append(std::span(bytes)); });
  expectSays(broken, "offset 0: Input/output error");
  expectSays(errorOf([&] { out.close(); }), "Input/output error");
}

TEST_F(FileTest, ReadingPastTheEndSaysWhereTheFileEnds) {
  OutputFile out(folder / "short");
  out.append(std::span<const std::byte>(someBytes(10)));
  out.close();
  const InputFile in(folder / "short");
  std::vector<std::byte> to(20);
  const std::string message = errorOf([&] { in.readAt(4, std::span(to)); });
  expectSays(message, "ends at byte 10");
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

TEST(NamelessFile, IsReadWhileItsFolderStaysEmpty) {
  const TemporaryFolder folder;
  NamelessFile first(folder.path()), second(folder.path());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));

  const std::vector<double> numbers{1, 2, 3};
  first.out().append(std::span<const double>(numbers));
  second.out().append(std::span<const double>(numbers).first(1));
  std::vector<double> read(3);
  first.in().readAt(0, std::span(read));
  EXPECT_EQ(read, numbers);
  EXPECT_EQ(second.out().size(), sizeof(double)) << "the two share their bytes";
}

TEST(NamelessFile, OpensNothingThatWasThere) {
  const TemporaryFolder folder;
  const std::filesystem::path victim = folder.path() / "victim", link = folder.path() / "link",
                              other = folder.path() / "other";
  OutputFile(victim).append(std::span<const char>("kept", 4));
  std::filesystem::create_symlink(victim, link);
  std::filesystem::create_symlink(folder.path() / "nothing", other);
  const std::filesystem::path names[] = {victim, link, other, folder.path() / "free"};
  size_t asked = 0;
  const NewFile file = createNewFile([&](uint32_t) { return names[asked++]; }, 0600);
  EXPECT_GE(file.fd, 0);
  SystemCalls::current().close(file.fd);
  EXPECT_EQ(file.path, names[3]);
  EXPECT_EQ(asked, 4u);
  EXPECT_EQ(readTextFile(victim), "kept");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "nothing"));
  EXPECT_EQ(std::filesystem::status(names[3]).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

TEST(NamelessFile, NamesTheFolderInWhichNoneCanBeMade) {
  const TemporaryFolder folder;
  const std::filesystem::path missing = folder.path() / "missing";
  const std::string error = errorOf([&] { const NamelessFile file(missing); });
  EXPECT_TRUE(error.starts_with(missing.string())) << error;
}

constexpr const char* kEnding = ".unpacked";

TEST(TemporarySubfolder, IsRemovedWithWhatIsInIt) {
  const TemporaryFolder dir;
  {
    TemporarySubfolder folder(dir.path(), kEnding);
    std::ofstream(folder.path() / "file") << "text";
    EXPECT_EQ(fs::status(folder.path()).permissions(), fs::perms::owner_all);
    EXPECT_TRUE(folder.path().filename().string().ends_with(kEnding));
  }
  EXPECT_EQ(entriesOf(dir.path()), 0u);
  TemporarySubfolder folder(dir.path(), kEnding);
  folder.remove();
  folder.remove();  // is none any more
  EXPECT_EQ(entriesOf(dir.path()), 0u);
}

TEST(TemporarySubfolder, RemovesWhatAKilledProcessHasLeft) {
  const TemporaryFolder dir;
  const pid_t child = ::fork();
  if (child == 0) {
    TemporarySubfolder folder(dir.path(), kEnding);
    std::ofstream(folder.path() / "file") << "text";
    ::_exit(0);  // no destructor is called
  }
  int status = 1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  ASSERT_EQ(entriesOf(dir.path()), 1u);
  { const TemporarySubfolder other_kind(dir.path(), ".other"); }
  EXPECT_EQ(entriesOf(dir.path()), 1u);
  const TemporarySubfolder folder(dir.path(), kEnding);
  EXPECT_EQ(entriesOf(dir.path()), 1u);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(TemporarySubfolder, LeavesOthersAlone) {
  const TemporaryFolder dir;
  const TemporaryNames names{"curvisplat.", kEnding};
  const TemporarySubfolder in_use(dir.path(), kEnding);
  fs::create_directory(dir.path() / "curvisplat.0000000000000000.unpacked");  // of another machine
  fs::create_directory(dir.path() / "mine");
  std::ofstream(dir.path() / "mine" / "precious") << "text";
  fs::create_directory_symlink("mine", dir.path() / names.of(1));
  std::ofstream(dir.path() / names.of(2)) << "a file";
  { const TemporarySubfolder next(dir.path(), kEnding); }
  EXPECT_TRUE(fs::exists(in_use.path()));
  EXPECT_TRUE(fs::exists(dir.path() / "mine" / "precious"));
  EXPECT_EQ(entriesOf(dir.path()), 5u);
}

TEST(TemporarySubfolder, ErrorsNameTheFolder) {
  const std::string error = errorOf([] { const TemporarySubfolder folder("/no/such/place", kEnding); });
  EXPECT_TRUE(error.starts_with("/no/such/place/curvisplat.")) << error;
}

TEST(PluginAdvice, TellsLackOfMemoryFromAMissingFile) {
  EXPECT_STREQ(pluginAdvice("libopenvdb.so.10.0: failed to map segment from shared object"),
               "raise the limit of memory (ulimit -v)");
  for (const char* why_not : {"a.so: cannot open shared object file: No such file or directory",
                              "a.so: cannot allocate memory in static TLS block",
                              "a.so: failed to map segment from shared object: Operation not permitted"})
    EXPECT_STREQ(pluginAdvice(why_not), "install curvisplat again");
}

}  // namespace
}  // namespace curvisplat
