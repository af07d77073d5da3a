// Writing a cache and reading it again; what an unfinished, overwritten or damaged one does.
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/partial_folder.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/swapped_names.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

bool says(const std::string& message, const std::string& words) {
  return message.find(words) != std::string::npos;
}

TEST(Cache, GivesBackWhatWasAppended) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache cache;
  cache.write(path);
  const CacheReader reader(path);
  ASSERT_EQ(reader.bricks().size(), 10u);
  EXPECT_EQ(reader.manifest().levels, 2u);
  EXPECT_EQ(reader.manifest().title, "small");
  EXPECT_EQ(reader.manifest().variable("mach"), &reader.manifest().variables[1]);
  EXPECT_EQ(reader.manifest().variable("mac"), nullptr);
  ASSERT_NE(reader.manifest().file("geometry.bin"), nullptr);
  EXPECT_EQ(reader.manifest().file("geometry.bin")->size, fs::file_size(path / "geometry.bin"));
  EXPECT_EQ(reader.variableNamed(""), 0u);
  EXPECT_EQ(reader.variableNamed("mach"), 1u);
  EXPECT_EQ(reader.variableNamed("density [kg/m3]"), 0u);
  for (const char* const wrong : {"nothing", "density [m]", "mach []"})
    EXPECT_THROW(reader.variableNamed(wrong), UsageError) << wrong;

  const Brick& root = reader.bricks()[0];
  EXPECT_EQ(root.first_child, 1u);
  EXPECT_EQ(root.child_count, 9u);
  EXPECT_FLOAT_EQ(root.error, 0.5f);

  uint64_t splats = 0;
  double volume = 0;
  for (uint32_t n = 1; n < 10; ++n) {
    const Brick& brick = reader.bricks()[n];
    const BrickSplats& leaf = cache.leaves[n - 1];
    ASSERT_EQ(brick.cell, leaf.cell);
    ASSERT_EQ(brick.splats, leaf.size());
    EXPECT_EQ(brick.parent, 0u);
    EXPECT_TRUE(brick.isLeaf());
    SplatGeometry geometry;
    std::vector<NodeRun> runs;
    reader.readGeometry(n, geometry, &runs);
    EXPECT_EQ(runs, leaf.runs);
    SplatVariable values;
    reader.readVariable(n, 1, values);
    const glm::dvec3 corner = reader.manifest().root.cellMin(brick.cell);
    for (size_t s = 0; s < leaf.size(); ++s) {
      ASSERT_NEAR(corner.x + geometry.x[s], leaf.splats[s].position.x, 1e-6);
      ASSERT_NEAR(corner.z + geometry.z[s], leaf.splats[s].position.z, 1e-6);
      ASSERT_FLOAT_EQ(geometry.axis1[s], static_cast<float>(leaf.splats[s].axis[1]));
      ASSERT_FLOAT_EQ(geometry.weight[s], static_cast<float>(leaf.splats[s].weight));
      ASSERT_FLOAT_EQ(values.mean[s], static_cast<float>(leaf.variables[1][s].mean));
      ASSERT_LE(reader.brickVariables(1)[n].min, values.mean[s]);
      volume += leaf.splats[s].weight;
    }
    splats += leaf.size();
  }
  EXPECT_EQ(reader.manifest().splats, splats);
  EXPECT_NEAR(reader.manifest().volume, volume, 1e-12 * volume);
}

TEST(Cache, StreamsKeepToTheirPages) {
  const TemporaryFolder folder;
  SmallCache().write(folder.path() / "a.splats");
  const CacheReader reader(folder.path() / "a.splats");
  for (const Brick& brick : reader.bricks()) {
    const Extent& extent = brick.geometry;
    const uint64_t pages =
        (extent.offset + extent.length + kPageBytes - 1) / kPageBytes - extent.offset / kPageBytes;
    EXPECT_EQ(pages, (extent.length + kPageBytes - 1) / kPageBytes);
  }
  EXPECT_EQ(fs::file_size(folder.path() / "a.splats/geometry.bin") % kPageBytes, 0u);
}

TEST(Cache, ReadsBackWhileWriting) {
  const TemporaryFolder folder;
  SmallCache cache;
  CacheWriter writer(folder.path() / "a.splats", false, cache.root,
                     {{0, "density", "", 0, 1}, {1, "mach", "", 0, 1}});
  cache.append(writer, 1);
  const BrickSplats back = writer.readBack(2);
  const BrickSplats& leaf = cache.leaves[2];
  EXPECT_EQ(back.positions, leaf.positions);
  EXPECT_EQ(back.runs, leaf.runs);
  for (size_t s = 0; s < leaf.size(); ++s) {
    ASSERT_EQ(back.splats[s].axis, leaf.splats[s].axis);
    ASSERT_EQ(back.splats[s].shear, leaf.splats[s].shear);
    ASSERT_EQ(back.splats[s].weight, leaf.splats[s].weight);
    ASSERT_EQ(back.variables[1][s].mean, leaf.variables[1][s].mean);
    ASSERT_EQ(back.variables[1][s].slope, leaf.variables[1][s].slope);
    ASSERT_EQ(back.variables[1][s].variance, leaf.variables[1][s].variance);
  }
}

TEST(Cache, EqualAppendsGiveEqualBytes) {
  const TemporaryFolder folder;
  SmallCache().write(folder.path() / "a.splats");
  SmallCache().write(folder.path() / "b.splats");
  size_t files = 0;
  for (const auto& entry : fs::directory_iterator(folder.path() / "a.splats")) {
    EXPECT_EQ(bytesOfFile(entry.path()), bytesOfFile(folder.path() / "b.splats" / entry.path().filename()))
        << entry.path();
    ++files;
  }
  EXPECT_EQ(files, 6u);  // manifest, bricks, grids, geometry, two variables: the lock is gone
}

TEST(Cache, SeveralBricksMayShareTheRoot) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache cache;
  {
    CacheWriter writer(path, false, cache.root, {});
    RandomBrick like;
    like.variables = 0;
    for (uint64_t n = 0; n < 3; ++n) {
      BrickSplats brick = randomBrick(like, Cell{}, n);
      writer.append(encodeBrick(cache.root, brick), 0);
    }
    writer.finish(cache.manifest());
  }
  const CacheReader reader(path);
  EXPECT_EQ(reader.bricks().size(), 3u);
  EXPECT_EQ(reader.manifest().splats, 3000u);
  EXPECT_EQ(reader.manifest().levels, 1u);
}

TEST(Cache, UnfinishedDoesNotOpenAndIsRemoved) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  {
    SmallCache cache;
    CacheWriter writer(path, false, cache.root, {{0, "density", "", 0, 1}, {1, "mach", "", 0, 1}});
    cache.append(writer, 1);
    EXPECT_THROW(CacheReader reader(path), Error);
    EXPECT_THROW(CacheReader reader(folder.path() / "a.splats.partial"), Error);
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Cache, TwoConversionsToOneOutputRefuse) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  const CacheWriter first(path, false, RootCube{}, {});
  EXPECT_PRED2(says, errorOf([&] { CacheWriter second(path, true, RootCube{}, {}); }), "running");
  // Named with a slash it is the same output.
  EXPECT_PRED2(says, errorOf([&] { CacheWriter second(path / "", true, RootCube{}, {}); }), "running");
}

TEST(Cache, LeftoversOfAKilledConversionAreCleared) {
  const TemporaryFolder folder;
  fs::create_directories(folder.path() / "a.splats.partial/inner");
  overwriteFile(folder.path() / "a.splats.partial/lock", std::string(kPartialMark));
  overwriteFile(folder.path() / "a.splats.partial/var.7.bin", "rest");
  SmallCache().write(folder.path() / "a.splats");
  EXPECT_FALSE(fs::exists(folder.path() / "a.splats/var.7.bin"));
  CacheReader reader(folder.path() / "a.splats");
}

TEST(Cache, FoldersThatNoConversionMadeAreRefused) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "a.splats", partial = folder.path() / "a.splats.partial";
  const fs::path foreign = folder.path() / "foreign";
  const auto refused = [&] {
    const std::string error = errorOf([&] { SmallCache().write(target, true); });
    EXPECT_PRED2(says, error, "a.splats.partial: exists and was not made by curvisplat");
    EXPECT_FALSE(fs::exists(target));
  };
  fs::create_directory(foreign);
  overwriteFile(foreign / "precious", "mine");
  fs::create_directory_symlink(foreign, partial);
  refused();
  overwriteFile(foreign / "lock", std::string(kPartialMark));  // a link all the same
  refused();
  EXPECT_EQ(bytesOfFile(foreign / "precious"), "mine");
  fs::remove(partial);

  fs::remove(foreign / "lock");
  fs::rename(foreign, partial);
  refused();
  overwriteFile(partial / "lock", "of another program");
  refused();
  overwriteFile(partial / "lock", "");
  refused();
  EXPECT_EQ(bytesOfFile(partial / "precious"), "mine");

  fs::remove_all(partial);
  SmallCache().write(partial);  // a cache that someone calls so
  refused();
  EXPECT_NO_THROW(CacheReader{partial});

  fs::remove_all(partial);
  overwriteFile(partial, "a file");
  refused();
  EXPECT_EQ(bytesOfFile(partial), "a file");
}

// The mark of the finished cache could not be removed.
TEST(Cache, AForeignFolderBesideAMarkedCacheIsRefused) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "a.splats", partial = folder.path() / "a.splats.partial";
  SmallCache().write(target);
  overwriteFile(target / "lock", std::string(kPartialMark));
  CacheReader reader(target);
  fs::create_directory(partial);
  overwriteFile(partial / "precious", "mine");
  EXPECT_PRED2(says, errorOf([&] { SmallCache().write(target, true); }), "was not made by curvisplat");
  EXPECT_EQ(bytesOfFile(partial / "precious"), "mine");
}

/// Removing a file called lock fails.
class KeptLocks : public SystemCalls {
 public:
  int kept = 0;
  int remove(const char* path) override {
    if (fs::path(path).filename() != "lock") return SystemCalls::remove(path);
    ++kept;
    errno = EACCES;
    return -1;
  }
};

TEST(Cache, ALockThatCannotBeRemovedHarmsNothingAndGoesWithTheNext) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  {
    KeptLocks calls;
    const ScopedSystemCalls scope(calls);
    SmallCache().write(path);
    EXPECT_EQ(calls.kept, 1);
  }
  EXPECT_TRUE(fs::exists(path / "lock"));
  EXPECT_FALSE(hasUnfinished(path));
  EXPECT_EQ(CacheReader(path).bricks().size(), 10u);
  EXPECT_TRUE(verifyCache(CacheReader(path)).findings.empty());
  EXPECT_PRED2(says, errorOf([&] { SmallCache().write(path); }), "exists already");
  SmallCache().write(path, true);
  EXPECT_EQ(CacheReader(path).bricks().size(), 10u);
  EXPECT_FALSE(fs::exists(path / "lock"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(Cache, AConversionKilledBeforeItIsMarkedDoesNotBlockTheNext) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "a.splats", partial = folder.path() / "a.splats.partial";
  fs::create_directory(partial);
  SmallCache().write(target);
  fs::create_directory(partial);
  overwriteFile(partial / "lock", "");
  SmallCache().write(target, true);
  fs::create_directory(partial);
  overwriteFile(partial / "lock", std::string(kPartialMark.substr(0, 9)));
  SmallCache().write(target, true);
  // Killed between swapping the caches and moving the mark.
  fs::copy(target, partial, fs::copy_options::recursive);
  overwriteFile(target / "lock", std::string(kPartialMark));
  SmallCache().write(target, true);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(Cache, OverwritingKeepsTheOldCacheUntilFinish) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache().write(path);
  const std::string old = bytesOfFile(path / "geometry.bin");
  EXPECT_PRED2(says, errorOf([&] { SmallCache().write(path); }), "exists already");
  {
    SmallCache cache;
    CacheWriter writer(path, true, cache.root, {{0, "density", "", 0, 1}, {1, "mach", "", 0, 1}});
    cache.append(writer, 2);
    CacheReader reader(path);
    EXPECT_EQ(bytesOfFile(path / "geometry.bin"), old);
  }
  EXPECT_EQ(bytesOfFile(path / "geometry.bin"), old);
  SmallCache().write(path, true, 2);
  EXPECT_NE(bytesOfFile(path / "geometry.bin"), old);
  CacheReader reader(path);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(Cache, OverwritingKeepsWhatIsNotTheCaches) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.splats";
  const auto isKept = [&] {
    return bytesOfFile(path / "notes.txt") == "mine" && bytesOfFile(path / "results/var.0.bin") == "mine" &&
           bytesOfFile(path / "thesis.part") == "mine" && !CacheReader(path / "b.splats").bricks().empty() &&
           fs::read_symlink(path / "link") == "notes.txt";
  };
  SmallCache().write(path);
  EXPECT_TRUE(foreignNames(path).empty());
  for (const char* name : {"results", "var.7.bin"}) fs::create_directory(path / name);
  for (const char* name : {"notes.txt", "results/var.0.bin", "thesis.part", "var.7.bin/x"})
    overwriteFile(path / name, "mine");
  fs::create_symlink("notes.txt", path / "link");
  SmallCache().write(path / "b.splats");
  SmallCache().write(path, true, 2);
  EXPECT_TRUE(isKept());
  EXPECT_EQ(foreignNames(path),
            (std::vector<fs::path>{"b.splats", "link", "notes.txt", "results", "thesis.part", "var.7.bin"}));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);

  // A run that was killed between the exchange of the folders and the removal of the old one.
  const fs::path old = folder / "a.splats.partial";
  fs::rename(path, folder / "old");
  SmallCache().write(path);
  fs::rename(folder / "old", old);
  overwriteFile(old / kPartialLock, std::string(kPartialMark));
  SmallCache().write(path, true);
  EXPECT_TRUE(isKept());

  // A name in both folders: both stay.
  fs::copy(path, old, fs::copy_options::recursive | fs::copy_options::copy_symlinks);
  overwriteFile(old / "notes.txt", "also mine");
  overwriteFile(old / kPartialLock, std::string(kPartialMark));
  SmallCache().write(path, true);
  EXPECT_TRUE(isKept());
  EXPECT_EQ(bytesOfFile(path / "notes.txt.1"), "also mine");
}

TEST(Cache, OverwritingKeepsFoldersWithNamesOfTheCachesFiles) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.splats";
  SmallCache().write(path);
  const std::vector<fs::path> own{"journal",        "faces.bin", "bricks.log",
                                  "steps.bin.part", "blanks.1",  "blanks.2"};
  for (const fs::path& name : own) {
    fs::create_directory(path / name);
    overwriteFile(path / name / "u", name.string());
  }
  SmallCache().write(path, true);
  std::multiset<std::string> kept;
  for (const auto& entry : fs::recursive_directory_iterator(path))
    if (entry.path().filename().string().starts_with("u")) kept.insert(bytesOfFile(entry.path()));
  EXPECT_EQ(kept, std::multiset<std::string>(own.begin(), own.end()));
}

TEST(Cache, OnlyFilesOfTheCacheGoWithAFolder) {
  const TemporaryFolder folder;
  const fs::path own = folder / "geometry.1";
  EXPECT_FALSE(removeCacheFolder(own));
  SmallCache().write(own);
  fs::create_directory_symlink("geometry.1", folder / "link");
  EXPECT_TRUE(removeCacheFolder(folder / "link"));
  EXPECT_FALSE(CacheReader(own).bricks().empty());
  overwriteFile(own / "notes.txt", "mine");
  fs::create_directory(own / "steps.bin");
  EXPECT_PRED2(says, errorOf([&] { requireCacheFolderRemoved(own); }), "move it elsewhere");
  EXPECT_EQ(foreignNames(own), (std::vector<fs::path>{"notes.txt", "steps.bin"}));
  EXPECT_EQ(std::distance(fs::directory_iterator(own), {}), 2);
}

TEST(Cache, OverwritesNothingButCaches) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "mine";
  fs::create_directory(path);
  overwriteFile(path / "thesis.tex", "years");
  EXPECT_PRED2(says, errorOf([&] { SmallCache().write(path, true); }), "not a complete splat cache");
  EXPECT_TRUE(fs::exists(path / "thesis.tex"));
}

TEST(Cache, AnUnwritableOutputIsAnError) {
  EXPECT_PRED2(says, errorOf([] { SmallCache().write("/proc/a.splats"); }), "/proc/a.splats");
}

/// Each write, sync and rename fails in turn: an Error, the old cache as it was, and nothing left behind.
TEST(Cache, AFullDiskLosesNothing) {
  if (!namesCanBeSwapped())
    GTEST_SKIP() << "this build swaps no names: a failure may come too late to be undone";
  const TemporaryFolder folder;
  const fs::path path = folder / "a.splats";
  SmallCache().write(path);
  const std::string old = bytesOfFile(path / "manifest.json") + bytesOfFile(path / "geometry.bin");
  for (int64_t faults::FaultySystemCalls::*const failing :
       {&faults::FaultySystemCalls::fail_write_at, &faults::FaultySystemCalls::fail_sync_at,
        &faults::FaultySystemCalls::fail_rename_at}) {
    int64_t number = 0;
    for (bool failed = true; failed; ++number) {
      faults::FaultySystemCalls calls;
      calls.*failing = number;
      const ScopedSystemCalls scoped(calls);
      const std::string error = errorOf([&] { SmallCache().write(path, true, 2); });
      failed = !error.empty();
      if (failed) {
        ASSERT_PRED2(says, error, "No space left");
      }
      // The last sync comes after the cache is in its place.
      const std::string now = bytesOfFile(path / "manifest.json") + bytesOfFile(path / "geometry.bin");
      if (failed && calls.renames < 2) {
        ASSERT_EQ(now, old);
      }
      ASSERT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
    }
    EXPECT_GT(number, 2);
    SmallCache().write(path, true);
  }
}

class NoExchange : public SystemCalls {
  int exchange(const char*, const char*) override {
    errno = EINVAL;
    return -1;
  }
};

TEST(Cache, OverwritesWhereNamesCannotBeSwapped) {
  const TemporaryFolder folder;
  const fs::path path = folder / "a.splats";
  SmallCache().write(path);
  const std::string old = bytesOfFile(path / "geometry.bin");
  NoExchange calls;
  const ScopedSystemCalls scoped(calls);
  SmallCache().write(path, true, 2);
  EXPECT_NE(bytesOfFile(path / "geometry.bin"), old);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(Cache, ADamagedPayloadNamesItsBrick) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache().write(path);
  const Extent extent = CacheReader(path).bricks()[4].geometry;
  std::string bytes = bytesOfFile(path / "geometry.bin");
  bytes[extent.offset + extent.length / 2] ^= 4;
  overwriteFile(path / "geometry.bin", bytes);
  const CacheReader reader(path);  // payloads are not read
  SplatGeometry geometry;
  reader.readGeometry(3, geometry);
  const std::string error = errorOf([&] { reader.readGeometry(4, geometry); });
  EXPECT_PRED2(says, error, "brick 4");
  EXPECT_PRED2(says, error, "geometry.bin");
}

/// Each table's every bit: flipped, the cache must not open. (The manifest's texts and numbers are not all
/// covered by a checksum: its own test is in manifest_test.)
TEST(Cache, DamagedTablesAreRefused) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache().write(path);
  const uint64_t table = fs::file_size(path / "var.0.bin") - 10 * sizeof(VariableRecord);
  for (const auto& [name, from] : {std::pair<std::string, uint64_t>{"bricks.bin", 0}, {"var.0.bin", table}}) {
    const std::string good = bytesOfFile(path / name);
    for (uint64_t byte = from; byte < good.size(); byte += 3) {
      std::string bad = good;
      bad[byte] ^= static_cast<char>(1 << byte % 8);
      overwriteFile(path / name, bad);
      ASSERT_THROW(CacheReader reader(path), Error) << name << " byte " << byte;
    }
    overwriteFile(path / name, good);
  }
  CacheReader reader(path);
}

TEST(Cache, TruncatedFilesAreRefused) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache().write(path);
  for (const std::string name : {"bricks.bin", "geometry.bin", "var.0.bin", "var.1.bin"}) {
    const std::string good = bytesOfFile(path / name);
    overwriteFile(path / name, good.substr(0, good.size() - 1));
    EXPECT_PRED2(says, errorOf([&] { CacheReader reader(path); }), name);
    fs::remove(path / name);
    EXPECT_PRED2(says, errorOf([&] { CacheReader reader(path); }), name);
    overwriteFile(path / name, good);
  }
}

TEST(Cache, OpensWithoutTheFileForOtherPrograms) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
  SmallCache().write(path);
  fs::remove(path / "bricks.vdb");
  EXPECT_NO_THROW(CacheReader{path});
}

}  // namespace
}  // namespace curvisplat
