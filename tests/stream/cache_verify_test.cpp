// Findings of verifyCache(), and of probing; and bricks.vdb, read by OpenVDB itself.
#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/base/file.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/probe.h"
#include "stream/vdb/brick_grids.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

bool anySays(const std::vector<std::string>& findings, const std::string& words) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const std::string& finding) { return finding.find(words) != std::string::npos; });
}

class VerifyCache : public testing::Test {
 protected:
  VerifyCache() { SmallCache().write(path); }
  std::vector<std::string> findings() const { return verifyCache(CacheReader(path)).findings; }

  /// Changes the record of brick `n`, and makes every checksum fit again: a writer's bug, not a disk's.
  template <typename Change>
  void changeRecord(size_t n, Change change) {
    std::string bytes = bytesOfFile(path / "bricks.bin");
    BrickRecord record;
    std::memcpy(&record, &bytes[sizeof(BricksHeader) + n * sizeof record], sizeof record);
    change(record);
    std::memcpy(&bytes[sizeof(BricksHeader) + n * sizeof record], &record, sizeof record);
    overwriteFile(path / "bricks.bin", bytes);
    Manifest manifest = Manifest::fromJson(bytesOfFile(path / "manifest.json"), "manifest.json");
    manifest.files[0].checksum = checksumOf(std::as_bytes(std::span(bytes)));
    overwriteFile(path / "manifest.json", manifest.toJson());
  }

  TemporaryFolder folder;
  const fs::path path = folder.path() / "a.splats";
};

TEST_F(VerifyCache, FindsNothingInASoundCache) {
  EXPECT_EQ(findings(), std::vector<std::string>{});
}

TEST_F(VerifyCache, FindsDamagedPayloads) {
  for (const std::string name : {"geometry.bin", "var.1.bin", "bricks.vdb"}) {
    const std::string good = bytesOfFile(path / name);
    std::string bad = good;
    bad[100] ^= 1;
    overwriteFile(path / name, bad);
    const auto found = findings();
    ASSERT_EQ(found.size(), 1u) << name;
    EXPECT_TRUE(anySays(found, name)) << found[0];
    overwriteFile(path / name, good);
  }
}

TEST_F(VerifyCache, FindsThatTheFileForOtherProgramsIsMissingShortOrALink) {
  const std::filesystem::path grids = path / "bricks.vdb", elsewhere = path / "elsewhere";
  const std::string good = bytesOfFile(grids);
  overwriteFile(grids, good.substr(1));
  EXPECT_TRUE(anySays(findings(), "bricks.vdb"));
  std::filesystem::rename(grids, elsewhere);
  EXPECT_TRUE(anySays(findings(), "bricks.vdb"));
  std::filesystem::create_symlink(elsewhere, grids);
  EXPECT_TRUE(anySays(findings(), "is a symbolic link"));
}

TEST_F(VerifyCache, FindsRecordsThatDoNotFitTheirBricks) {
  changeRecord(2, [](BrickRecord& r) { r.upper[1] -= 0.3 * (r.upper[1] - r.lower[1]); });
  changeRecord(3, [](BrickRecord& r) { r.largest_radius *= 0.9f; });
  changeRecord(5, [](BrickRecord& r) {
    std::swap(r.octant_splats[0], r.octant_splats[7]), ++r.octant_splats[1], --r.octant_splats[2];
  });
  const auto found = findings();
  EXPECT_TRUE(anySays(found, "brick 2 "));
  EXPECT_TRUE(anySays(found, "brick 3 "));
  EXPECT_TRUE(anySays(found, "brick 5 "));
  EXPECT_FALSE(anySays(found, "brick 4 "));
}

TEST_F(VerifyCache, FindsInnerBricksThatLoseWeight) {
  // A root over other children: its weights are no longer theirs.
  const fs::path other = folder.path() / "b.splats";
  SmallCache cache;
  {
    CacheWriter writer(other, false, cache.root, {});
    RandomBrick like;
    like.variables = 0;
    BrickSplats leaf = randomBrick(like, Cell{}.child(0), 1);
    writer.append(encodeBrick(cache.root, leaf), 0);
    like.leaf = false;
    like.splats = 1;
    BrickSplats inner = randomBrick(like, Cell{}, 2);
    double weight = 0;
    for (const Splat& splat : leaf.splats) weight += splat.weight;
    inner.splats[0].weight = 1.003 * weight;
    writer.append(encodeBrick(cache.root, inner), 1);
    writer.finish(cache.manifest());
  }
  const auto found = verifyCache(CacheReader(other)).findings;
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(anySays(found, "its children's")) << found[0];
}

TEST(Probe, FindsTheNodeAndItsValue) {
  // A row of four cubes of side 1, with a scalar that is x.
  const TemporaryFolder folder;
  const RootCube root{{0, 0, 0}, 8};
  BrickSplats brick;
  for (int n = 0; n < 4; ++n) {
    Splat splat;
    splat.weight = 1;
    brick.splats.push_back(splat);
    brick.positions.push_back(root.fromWorld({n + 1.5, 2.5, 2.5}));
  }
  brick.runs = {{0, 5, 1, 2, 2}, {1, 9, 0, 0, 2}};
  brick.variables = {{}};
  for (int n = 0; n < 4; ++n) brick.variables[0].push_back({n + 1.5, {1, 0, 0}, 0});
  {
    CacheWriter writer(folder / "a.splats", false, root, {{0, "x", "m", 1, 5}});
    writer.append(encodeBrick(root, brick), 0);
    Manifest manifest;
    manifest.nodes = 4;
    manifest.blocks = {{"one", 10, 2, 3}, {"two", 11, 1, 1}};
    writer.finish(manifest);
  }
  const CacheReader reader(folder / "a.splats");
  EXPECT_EQ(verifyCache(reader).findings, std::vector<std::string>{});
  const size_t variable = 0;
  const auto second = probe(reader, std::span(&variable, 1), {2.7, 2.4, 2.5});
  ASSERT_TRUE(second);
  EXPECT_EQ(second->block, 0u);
  EXPECT_EQ(second->i, 6u);
  EXPECT_EQ(second->j, 1u);
  EXPECT_EQ(second->k, 2u);
  EXPECT_NEAR(second->variables[0].value, 2.7, 0.05);
  EXPECT_NEAR(second->variables[0].mean, 2.5, 1e-4);
  EXPECT_NEAR(second->distance, std::hypot(0.2, 0.1), 0.05);
  const auto last = probe(reader, {}, {4.9, 2.5, 2.5});
  ASSERT_TRUE(last);
  EXPECT_EQ(last->block, 1u);
  EXPECT_EQ(last->i, 10u);
  EXPECT_FALSE(probe(reader, {}, {4.5, 6, 2.5}));
}

class BrickGrids : public testing::Test {
 protected:
  BrickGrids() { writeRandomCache(folder_ / "a.splats"); }

  std::vector<std::byte> bytes() const {
    const InputFile file(folder_ / "a.splats/bricks.vdb");
    std::vector<std::byte> bytes(file.size());
    file.readAt(0, std::span(bytes));
    return bytes;
  }
  std::string difference(std::span<const std::byte> of) const { return comparison(of).difference; }
  BrickGridsComparison comparison(std::span<const std::byte> of,
                                  uint64_t most_memory = kMaxComparisonMemory) const {
    return compareBrickGrids(of, cache().manifest().root, cache().bricks(), most_memory);
  }
  const CacheReader& cache() const {
    if (!cache_) cache_.emplace(folder_ / "a.splats");
    return *cache_;
  }

  const TemporaryFolder folder_;
  mutable std::optional<CacheReader> cache_;
};

TEST_F(BrickGrids, HaveTheCellsOfTheOctreeAndTheirFirstBricks) {
  openvdb::initialize();
  openvdb::io::File file((folder_ / "a.splats/bricks.vdb").string());
  file.open(false);
  const std::span<const Brick> bricks = cache().bricks();
  std::vector<uint64_t> cells(bricks.back().cell.level + 1);
  for (size_t n = 0; n < bricks.size(); ++n) {
    const Cell& cell = bricks[n].cell;
    if (n > 0 && bricks[n - 1].cell == cell) continue;
    ++cells[cell.level];
    const auto grid =
        openvdb::gridPtrCast<openvdb::Int32Grid>(file.readGrid("level " + std::to_string(cell.level)));
    const openvdb::Coord at(static_cast<int>(cell.at[0]), static_cast<int>(cell.at[1]),
                            static_cast<int>(cell.at[2]));
    EXPECT_EQ(grid->tree().getValue(at), static_cast<int>(n));
    // The voxel's middle is the cell's.
    const double unit = grid->metaValue<double>("world_units");
    const openvdb::Vec3d middle = grid->transform().indexToWorld(at) * unit;
    const RootCube& root = cache().manifest().root;
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(middle[axis], root.cellMin(cell)[axis] + root.cellSize(cell.level) / 2, 1e-9 * root.size);
  }
  EXPECT_EQ(file.readAllGridMetadata()->size(), cells.size());
  for (size_t level = 0; level < cells.size(); ++level)
    EXPECT_EQ(file.readGrid("level " + std::to_string(level))->activeVoxelCount(), cells[level]);
}

TEST_F(BrickGrids, AreComparedWithoutBeingParsed) {
  const std::vector<std::byte> good = bytes();
  EXPECT_EQ(difference(good), "");
  // Any byte, but for those of the library's version.
  for (size_t at = 21; at < good.size(); at += 97) {
    std::vector<std::byte> bad = good;
    bad[at] ^= std::byte{0xff};
    EXPECT_NE(difference(bad), "") << at;
  }
  EXPECT_NE(difference(std::span(good).first(good.size() - 1)), "");
  EXPECT_NE(difference(std::span(good).first(10)), "");
  std::vector<std::byte> other = good;
  other[0] ^= std::byte{1};
  EXPECT_NE(difference(other), "");
}

TEST_F(BrickGrids, OfAnotherVersionOfOpenVdbAreNotCompared) {
  std::vector<std::byte> other = bytes();
  other[12] ^= std::byte{1};  // the library's major version
  other.resize(other.size() + 1);
  const BrickGridsComparison compared = comparison(other);
  EXPECT_EQ(compared.difference, "");
  EXPECT_EQ(compared.not_compared, "another version of OpenVDB wrote it");
}

TEST_F(BrickGrids, ThatTakeMuchMemoryAreNotCompared) {
  // Two bricks in opposite corners of 2^12 cells: a tree each, but for its root.
  std::vector<Brick> bricks(3);
  bricks[1].cell = {12, {0, 0, 0}};
  bricks[2].cell = {12, {4095, 4095, 4095}};
  const uint64_t one = brickGridsMemory(std::span(bricks).first(1));
  EXPECT_GE(one, 32768 * 8 + 4096 * 8 + 512 * 4);  // the tables of the three kinds of nodes
  EXPECT_GT(brickGridsMemory(bricks), 2 * one);
  EXPECT_LT(brickGridsMemory(bricks), 3 * one);  // they share the widest
  bricks[2].cell = {12, {1, 1, 1}};
  EXPECT_EQ(brickGridsMemory(bricks), 2 * one);
  bricks[2].cell = {13, {4095, 4096, 4095}};
  bricks[1].cell = {13, {4095, 4095, 4095}};
  EXPECT_EQ(brickGridsMemory(bricks), 3 * one);

  const uint64_t memory = brickGridsMemory(cache().bricks());
  std::vector<std::byte> bad = bytes();
  bad.back() ^= std::byte{1};
  EXPECT_NE(comparison(bad, memory).difference, "");
  const BrickGridsComparison compared = comparison(bad, memory - 1);
  EXPECT_EQ(compared.difference, "");
  expectSays(compared.not_compared, "MiB of memory");
}

}  // namespace
}  // namespace curvisplat
