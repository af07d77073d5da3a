// Files that appear complete or not at all: on a failing disk, and after a run that was killed.
#include "stream/base/durable_file.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <set>

#include "stream/base/file.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::FaultySystemCalls;

/// As on file systems that cannot swap two names.
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
    try {
      writeFileDurably(path, "new");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
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
        // Of the file that the user has named.
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
  EXPECT_NE(failure(calls).find("was written, but a power loss may undo that"), std::string::npos);
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
  // Of another machine, where it may be alive; a link; a folder.
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

}  // namespace
}  // namespace curvisplat
