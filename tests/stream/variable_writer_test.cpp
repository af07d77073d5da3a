// Variables that are added to a cache that is whole.
#include "stream/cache/variable_writer.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/stream/test_bricks.h"
#include "tests/support/faulty_system_calls.h"

namespace curvisplat {
namespace {

class AddedVariable : public ::testing::Test {
 protected:
  AddedVariable() { SmallCache().write(path); }

  /// Appends a value that is the splat's number in its brick, in the order of conversion or not.
  static void appendAll(const CacheReader& reader, VariableWriter& writer) {
    for (uint32_t brick = 0; brick < reader.bricks().size(); ++brick) {
      SplatGeometry geometry;
      std::vector<NodeRun> runs;
      reader.readGeometry(brick, geometry, &runs);
      std::vector<SplatScalar> values(geometry.size());
      for (size_t n = 0; n < values.size(); ++n) values[n].mean = static_cast<double>(n);
      writer.append(brick, std::vector{encodeValues(runs, {}, values)});
    }
  }

  size_t filesInCache() const {
    return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(path), {}));
  }

  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "a.splats";
};

TEST_F(AddedVariable, IsReadBesideTheOthers) {
  const std::string geometry = bytesOfFile(path / "geometry.bin"), mach = bytesOfFile(path / "var.1.bin");
  {
    const CacheLock lock(path);
    const CacheReader reader(path);
    VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "Pa", 0, 400}});
    appendAll(reader, writer);
    const std::vector<FileInfo> files = writer.finish({"a.xyz", "p.fun"});
    ASSERT_EQ(files.size(), 1u);
    EXPECT_EQ(files[0].name, "var.2.bin");
  }
  const CacheReader reader(path);
  const Manifest& manifest = reader.manifest();
  ASSERT_EQ(manifest.variables.size(), 3u);
  EXPECT_EQ(manifest.variables[2].number, 2u);
  EXPECT_EQ(manifest.variables[2].unit, "Pa");
  EXPECT_EQ(manifest.steps.front().variables, (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(manifest.sources, (std::vector<std::string>{"a.xyz", "p.fun"}));
  SplatVariable values;
  for (uint32_t brick = 0; brick < reader.bricks().size(); ++brick) {
    reader.readVariable(brick, 2, values);
    for (size_t n = 0; n < values.size(); ++n)
      ASSERT_NEAR(values.mean[n], static_cast<double>(n), 1e-4 * static_cast<double>(values.size()));
  }
  EXPECT_TRUE(bytesOfFile(path / "geometry.bin") == geometry);
  EXPECT_TRUE(bytesOfFile(path / "var.1.bin") == mach);
}

TEST_F(AddedVariable, IsSeenByNobodyBeforeItIsWhole) {
  const std::string manifest = bytesOfFile(path / "manifest.json");
  const size_t files = filesInCache();
  {
    const CacheLock lock(path);
    const CacheReader reader(path);
    VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "", 0, 1}, {0, "energy", "", 0, 1}});
    EXPECT_EQ(filesInCache(), files + 2);
    EXPECT_EQ(CacheReader(path).manifest().variables.size(), 2u);
  }
  EXPECT_EQ(filesInCache(), files);
  EXPECT_EQ(bytesOfFile(path / "manifest.json"), manifest);
}

TEST_F(AddedVariable, IsNotThereIfAnySyncFails) {
  const std::string manifest = bytesOfFile(path / "manifest.json");
  const size_t files = filesInCache();
  for (int64_t sync = 0;; ++sync) {
    curvisplat::faults::FaultySystemCalls faulty;
    faulty.fail_sync_at = sync;
    bool failed = false;
    try {
      const CacheLock lock(path);
      const CacheReader reader(path);
      VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "", 0, 400}});
      appendAll(reader, writer);
      const ScopedSystemCalls scope(faulty);
      writer.finish({});
    } catch (const Error&) {
      failed = true;
    }
    EXPECT_EQ(failed, sync < 4);
    if (!failed) break;
    EXPECT_EQ(bytesOfFile(path / "manifest.json"), manifest) << sync;
    EXPECT_EQ(filesInCache(), files) << sync;
  }
  EXPECT_EQ(CacheReader(path).manifest().variables.size(), 3u);
  EXPECT_EQ(filesInCache(), files + 1);
}

TEST_F(AddedVariable, LeavesAReplacedCacheAlone) {
  {
    const CacheLock lock(path);
    const CacheReader reader(path);
    VariableWriter writer(lock, reader.manifest(), {{0, "pressure", "", 0, 1}});
    appendAll(reader, writer);
    SmallCache().write(path, true, 7);
    EXPECT_THROW(writer.finish({}), Error);
  }
  const CacheReader reader(path);
  EXPECT_EQ(reader.manifest().variables.size(), 2u);
  EXPECT_EQ(filesInCache(), 6u);
}

TEST_F(AddedVariable, IsLockedAgainstOtherPrograms) {
  const CacheLock lock(path);
  EXPECT_THROW(CacheLock{path}, Error);
  EXPECT_NO_THROW(CacheReader{path});
}

TEST_F(AddedVariable, TheOldManifestThatAKilledProgramLeftIsRemoved) {
  const std::filesystem::path left = path / "manifest.json.part";
  std::filesystem::copy_file(path / "manifest.json", left);
  const int running = ::open(left.c_str(), O_RDONLY);
  ASSERT_EQ(::flock(running, LOCK_EX), 0);
  { const CacheLock lock(path); }
  EXPECT_TRUE(std::filesystem::exists(left));  // which its program may have to put back
  ::close(running);
  { const CacheLock lock(path); }
  EXPECT_FALSE(std::filesystem::exists(left));
}

}  // namespace
}  // namespace curvisplat
