// WatchedFile: readers are told when others write a file at the same time.
#include "stream/base/watched_file.h"

#include <gtest/gtest.h>

#include <chrono>
#include <fstream>

#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class WatchedFileTest : public testing::Test {
 protected:
  WatchedFileTest() { write(path_, "12345678"); }

  static void write(const fs::path& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
  }
  /// Writes a file as if an hour later: clocks of file systems are coarse.
  static void writeLater(const fs::path& path, const std::string& text) {
    const auto before = fs::last_write_time(path);
    write(path, text);
    fs::last_write_time(path, before + std::chrono::hours(1));
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_ / "run.nc";
};

TEST_F(WatchedFileTest, MayGrow) {
  const WatchedFile file(path_);
  EXPECT_TRUE(file.isWhole());
  EXPECT_TRUE(file.isSame());
  writeLater(path_, "123456789");
  EXPECT_TRUE(file.isWhole());
  EXPECT_FALSE(file.isSame());
  EXPECT_NO_THROW(file.requireWhole());
}

TEST_F(WatchedFileTest, IsNotWholeOnceItIsShorterOrWrittenAgain) {
  for (const std::string text : {"1234567", "", "87654321"}) {
    write(path_, "12345678");
    const WatchedFile file(path_);
    writeLater(path_, text);
    EXPECT_FALSE(file.isWhole()) << text;
    // Beyond the end, zeros would be read.
    const std::string changed = ": was changed while it was read; start again when it is complete";
    EXPECT_EQ(errorOf([&] { file.requireWhole(); }), text.size() < 8 ? path_.string() + changed : "");
  }
}

TEST_F(WatchedFileTest, IsNotWholeWhenItsNameIsGivenToAnotherButWhenItGoes) {
  const WatchedFile file(path_);
  write(folder_ / "new", "1");
  fs::rename(folder_ / "new", path_);
  EXPECT_FALSE(file.isWhole());
  EXPECT_FALSE(file.isSame());
  EXPECT_NO_THROW(file.requireWhole());  // the open one is read as it was
  fs::remove(path_);
  EXPECT_TRUE(file.isWhole());
}

TEST_F(WatchedFileTest, FilesThatOthersLeadToAreWatchedToo) {
  const fs::path linked = folder_ / "linked.nc", behind = folder_ / "behind.nc";
  for (const fs::path& path : {linked, behind}) write(path, "1234");
  noteLinks(path_, {linked});
  noteLinks(linked, {behind, path_});  // a cycle
  const WatchedFiles files({path_.string()});
  EXPECT_NO_THROW(files.requireWhole());
  writeLater(behind, "4321");
  EXPECT_NO_THROW(files.requireWhole());
  EXPECT_EQ(errorOf([&] { files.requireSame(); }).find(behind.string() + ": was changed"), 0u);
  std::vector<std::string> warnings;
  files.warn(warnings);
  EXPECT_EQ(warnings.size(), 1u);
  writeLater(linked, "123");
  EXPECT_EQ(errorOf([&] { files.requireWhole(); }).find(linked.string() + ": was changed"), 0u);
  // "./NAME" is another name of the same file.
  const WatchedFiles again({(folder_ / "." / path_.filename()).string()});
  writeLater(linked, "12");
  EXPECT_NE(errorOf([&] { again.requireWhole(); }), "");
}

TEST_F(WatchedFileTest, FilesOfAGridThatWereChangedAreNamed) {
  const fs::path other = folder_ / "other.nc", store = folder_ / "store.zarr";
  write(other, "1");
  fs::create_directory(store);
  const WatchedFiles files({path_.string(), other.string(), store.string(), (folder_ / "none").string()});
  std::vector<std::string> warnings{"of before"};
  files.warn(warnings);
  EXPECT_EQ(warnings.size(), 1u);
  writeLater(path_, "8765");
  write(store / "0.0", "1");
  files.warn(warnings);
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(warnings[1].find(path_.string() + ": was changed while it was converted"), 0u) << warnings[1];
}

}  // namespace
}  // namespace curvisplat
