// bricks.vdb, read by OpenVDB itself.
#include "stream/cache/brick_grids.h"

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <optional>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/random_cache.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

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
  EXPECT_NE(compared.not_compared.find("MiB of memory"), std::string::npos);
}

}  // namespace
}  // namespace curvisplat
