// The error of a full disk, under the name that the user gave.
#include "stream/base/disk_full.h"

#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <string>

#include "stream/base/file.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

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
  // Of a folder that the user did not give, the error says what it can.
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
