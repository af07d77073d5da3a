#include "stream/base/nameless_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <span>
#include <vector>

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
