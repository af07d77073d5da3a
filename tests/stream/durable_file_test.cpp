// Files that appear complete or not at all: on a failing disk, and after a run that was killed; and the
// error of a full disk, under the name that the user gave.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <set>
#include <string>

#include "stream/base/disk_space.h"
#include "stream/base/durable_file.h"
#include "stream/base/file.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/swapped_names.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::FaultySystemCalls;

/// System calls of file systems that cannot swap two names.
class WithoutExchange : public FaultySystemCalls {
 public:
  int exchange(const char*, const char*) override {
    errno = EINVAL;
    return -1;
  }
};

class DurableFile : public ::testing::Test {
 protected:
  size_t files() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder.path()), {}));
  }

  /// The message of the Error that writing `path` throws.
  std::string failure(SystemCalls& calls) const {
    const ScopedSystemCalls scope(calls);
    return curvisplat::errorOf([&] { writeFileDurably(path, "new"); });
  }

  const TemporaryFolder folder;
  const fs::path path = folder / "file";
};

TEST_F(DurableFile, ReplacesWhatIsThereAndFollowsLinks) {
  writeFileDurably(path, "first");
  fs::create_symlink("file", folder / "link");
  writeFileDurably(folder / "link", "second");
  EXPECT_EQ(readTextFile(path), "second");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(files(), 2u);
  fs::create_directory(folder / "folder");
  EXPECT_THROW(writeFileDurably(folder / "folder", "text"), Error);
  WithoutExchange calls;
  EXPECT_EQ(failure(calls), "");
  EXPECT_EQ(readTextFile(path), "new");
}

TEST_F(DurableFile, AFailedReplacementKeepsTheOldFile) {
  if (!namesCanBeSwapped())
    GTEST_SKIP() << "this build swaps no names: a failure may come too late to be undone";
  constexpr int64_t FaultySystemCalls::*kFaults[] = {&FaultySystemCalls::fail_write_at,
                                                     &FaultySystemCalls::fail_sync_at,
                                                     &FaultySystemCalls::fail_rename_at};
  for (const bool exists : {false, true}) {
    for (const auto fault : kFaults) {
      for (int64_t at = 0;; ++at) {
        if (exists) writeFileDurably(path, "old");
        FaultySystemCalls calls;
        calls.*fault = at;
        const std::string error = failure(calls);
        if (error.empty()) break;
        // The message names the user's file.
        EXPECT_TRUE(error.starts_with(path.string() + ": ") ||
                    error.starts_with(folder.path().string() + ": "))
            << error;
        EXPECT_EQ(error.find(".curvisplat"), std::string::npos) << error;
        EXPECT_EQ(files(), exists ? 1u : 0u) << error;
        EXPECT_TRUE(!exists || readTextFile(path) == "old") << error;
        ASSERT_LT(at, 5);
      }
      EXPECT_EQ(readTextFile(path), "new");
      fs::remove(path);
    }
  }
}

TEST_F(DurableFile, AReplacementThatCannotBeUndoneIsReportedAsWritten) {
  writeFileDurably(path, "old");
  WithoutExchange calls;
  calls.fail_sync_at = 1;  // of the folder
  expectSays(failure(calls), "was written, but a power loss may undo that");
  EXPECT_EQ(readTextFile(path), "new");
  EXPECT_EQ(files(), 1u);
}

TEST_F(DurableFile, TemporaryFilesHaveNamesOfTheirOwn) {
  std::set<fs::path> names;
  for (int n = 0; n < 1000; ++n) {
    const TemporaryFile file(folder / std::string(255, 'x'));
    names.insert(file.path());
    ASSERT_EQ(file.path().parent_path(), folder.path());
    ASSERT_LT(file.path().filename().string().size(), 64u);
  }
  EXPECT_GT(names.size(), 990u);  // files that are gone may share one
  EXPECT_EQ(files(), 0u);
  EXPECT_THROW(TemporaryFile(folder / "none" / "file"), Error);
}

TEST_F(DurableFile, LeftoversOfAKilledRunAreRemoved) {
  fs::path left;
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const TemporaryFile file(path);
    ::kill(::getpid(), SIGKILL);
  }
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  ASSERT_EQ(files(), 1u);
  left = fs::directory_iterator(folder.path())->path();

  const TemporaryFile alive(path);
  // Not removed are a file of another machine, where the process may be alive, a link, and a folder.
  std::string name = left.filename().string();
  name.replace(12, 8, "00000000");
  writeFileAtomically(folder / name, std::string("of another machine"));
  writeFileAtomically(folder / "precious", std::string("mine"));
  fs::create_symlink("precious", folder / (left.filename().string().substr(0, 20) + "0badcafe.part"));
  fs::create_directory(folder / (left.filename().string().substr(0, 20) + "1badcafe.part"));
  removeAbandonedFiles(folder.path());
  EXPECT_FALSE(fs::exists(left));
  EXPECT_EQ(files(), 5u);
  EXPECT_TRUE(fs::exists(alive.path()));
  EXPECT_EQ(readTextFile(folder / "precious"), "mine");
  removeAbandonedFiles(folder / "none");
}

std::string messageOf(const RoomNeeded& room, const fs::path& file, int error = ENOSPC) {
  try {
    room.during([&] { throw DiskFull(file, file, "a byte", error); });
  } catch (const DiskFull&) {
    return "not translated";
  } catch (const OutputError& translated) {
    return translated.what();
  }
  return "";
}

TEST(RoomNeeded, NamesTheLongestGivenFolderThatHoldsTheFile) {
  const RoomNeeded room{{"/d", "/d/tmp/", "/d/a"}, "the cache", "buy a disk"};
  const std::string rest = ": no room for the cache: No space left on device; buy a disk";
  EXPECT_EQ(messageOf(room, "/d/tmp/a.tmp.1.0/splats.bin"), "/d/tmp" + rest);
  EXPECT_EQ(messageOf(room, "/d/a.partial/geometry.bin"), "/d" + rest);
  EXPECT_EQ(messageOf(room, "/d/./tmp/../a/var.1.bin.part"), "/d/a" + rest);
  EXPECT_EQ(messageOf({{"."}, "the cache", "buy a disk"}, "a.partial/geometry.bin"),
            fs::current_path().string() + rest);
  // If the user did not give a folder, the error says what it can.
  EXPECT_EQ(messageOf(room, "/e/file"),
            "/e/file: no room for a byte: No space left on device; make room there");
}

TEST(RoomNeeded, KnowsLimitsFromFullDisks) {
  const RoomNeeded room{{"/d"}, "the cache", "buy a disk"};
  EXPECT_EQ(messageOf(room, "/d/a", EFBIG),
            "/d: no room for the cache: File too large; raise the limit of file sizes (ulimit -f)");
  EXPECT_EQ(messageOf(room, "/d/a", EDQUOT), "/d: no room for the cache: Disk quota exceeded; buy a disk");
}

TEST(RoomNeeded, ReturnsWhatTheWorkReturns) {
  EXPECT_EQ((RoomNeeded{}.during([] { return 7; })), 7);
  EXPECT_THROW(RoomNeeded{}.during([] { throw Error("other"); }), Error);
}

TEST(OutputFile, ShowsTheNameThatIsKnown) {
  const TemporaryFolder folder;
  faults::FaultySystemCalls full;
  full.fail_write_at = 0;
  OutputFile file(folder / "a.part", Caching::kPages, OutputFile::Existing::kEmpty, folder / "a");
  const ScopedSystemCalls scope(full);
  try {
    const std::array<int, 2> numbers{1, 2};
    file.append(std::span<const int>(numbers));
    ADD_FAILURE() << "it had room";
  } catch (const DiskFull& error) {
    EXPECT_EQ(error.what(), (folder / "a").string() +
                                ": no room for 8 more bytes: No space left on device; make room there");
    EXPECT_EQ(error.file(), folder / "a.part");
  }
}

}  // namespace
}  // namespace curvisplat
