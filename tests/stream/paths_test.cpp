#include "stream/base/paths.h"

#include <gtest/gtest.h>

#include <string>

#include "stream/base/error.h"
#include "stream/base/file.h"
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

}  // namespace
}  // namespace curvisplat
