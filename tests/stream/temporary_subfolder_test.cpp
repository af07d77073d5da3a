#include "stream/base/temporary_subfolder.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "stream/base/error.h"
#include "stream/base/temporary_names.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEnding = ".unpacked";

size_t entriesOf(const fs::path& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

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
  try {
    const TemporarySubfolder folder("/no/such/place", kEnding);
    FAIL();
  } catch (const Error& error) {
    EXPECT_TRUE(std::string(error.what()).starts_with("/no/such/place/curvisplat.")) << error.what();
  }
}

}  // namespace
}  // namespace curvisplat
