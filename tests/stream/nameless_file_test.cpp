#include "stream/base/nameless_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <span>
#include <vector>

#include "stream/base/new_file.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

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
  try {
    const NamelessFile file(missing);
    FAIL() << "a file in a folder that does not exist";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()).find(missing.string()), 0u) << error.what();
  }
}

}  // namespace
}  // namespace curvisplat
