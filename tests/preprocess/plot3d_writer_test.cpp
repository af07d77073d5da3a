#include "preprocess/formats/plot3d/plot3d_writer.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>

#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

// The whole file as 32-bit words: that is all there is in it.
std::vector<int32_t> wordsOf(const std::filesystem::path& path) {
  const std::string bytes = readTextFile(path, 64 << 20);
  EXPECT_EQ(bytes.size() % 4, 0u);
  std::vector<int32_t> words(bytes.size() / 4);
  std::memcpy(words.data(), bytes.data(), words.size() * 4);
  return words;
}

float asFloat(int32_t word) {
  return std::bit_cast<float>(word);
}

// Two blocks of unlike sizes with numbers that tell where they belong; every third node is blank.
class NumberedGrid : public GridSource {
 public:
  NumberedGrid() {
    description_.blocks = {{"block 1", 2, 3, 4, false}, {"block 2", 5, 2, 2, true}};
    description_.scalars = {{"p", "", {}}, {"T", "K", {}}};
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const GridBlock& dims = description_.blocks[block];
    out.x.clear(), out.y.clear(), out.z.clear(), out.blank.clear();
    out.scalars.assign(scalars.size(), {});
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < dims.ni; ++i) {
          const auto number = static_cast<double>(100 * block + (k * dims.nj + j) * dims.ni + i);
          out.x.push_back(number);
          out.y.push_back(number + 1000);
          out.z.push_back(number + 2000);
          out.blank.push_back(dims.has_blanking && std::fmod(number, 3) == 0);
          for (size_t s = 0; s < scalars.size(); ++s)
            out.scalars[s].push_back(static_cast<float>(number + 3000 + 1000 * scalars[s]));
        }
  }

 private:
  GridDescription description_;
};

TEST(WritePlot3d, WritesASceneAsASingleBlock) {
  const TemporaryFolder folder;
  const SceneGridSource scene(makeScene("half-annulus"), {5, 4, 3});
  Progress progress;
  const Plot3dOutputs outputs = writePlot3d(scene, folder / "scene", progress);
  EXPECT_EQ(outputs.grid, folder / "scene.xyz");
  EXPECT_EQ(outputs.function, folder / "scene.fun");
  EXPECT_EQ(outputs.names, folder / "scene.nam");

  NodeArrays nodes;
  scene.read(0, {0, 4, 0, 3}, std::vector<uint32_t>{0}, nodes);
  const auto grid = wordsOf(outputs.grid), function = wordsOf(outputs.function);
  ASSERT_EQ(grid.size(), 3u + 3 * 60);
  ASSERT_EQ(function.size(), 4u + 60);
  EXPECT_EQ(std::vector(grid.begin(), grid.begin() + 3), (std::vector{5, 4, 3}));
  EXPECT_EQ(std::vector(function.begin(), function.begin() + 4), (std::vector{5, 4, 3, 1}));
  for (size_t n = 0; n < 60; ++n) {
    EXPECT_EQ(asFloat(grid[3 + n]), static_cast<float>(nodes.x[n]));
    EXPECT_EQ(asFloat(grid[3 + 60 + n]), static_cast<float>(nodes.y[n]));
    EXPECT_EQ(asFloat(grid[3 + 120 + n]), static_cast<float>(nodes.z[n]));
    EXPECT_EQ(asFloat(function[4 + n]), nodes.scalars[0][n]);
  }
  EXPECT_EQ(readTextFile(outputs.names), "f\n");
}

TEST(WritePlot3d, WritesBlocksWithBlanking) {
  const TemporaryFolder folder;
  Progress progress;
  writePlot3d(NumberedGrid(), folder / "blocks", progress);
  const auto grid = wordsOf(folder / "blocks.xyz"), function = wordsOf(folder / "blocks.fun");
  ASSERT_EQ(grid.size(), 7u + 4 * (24 + 20));
  ASSERT_EQ(function.size(), 9u + 2 * (24 + 20));
  EXPECT_EQ(std::vector(grid.begin(), grid.begin() + 7), (std::vector{2, 2, 3, 4, 5, 2, 2}));
  EXPECT_EQ(std::vector(function.begin(), function.begin() + 9), (std::vector{2, 2, 3, 4, 2, 5, 2, 2, 2}));
  size_t grid_at = 7, function_at = 9;
  for (const auto& [first, nodes] : {std::pair{0, 24}, std::pair{100, 20}}) {
    for (int axis = 0; axis < 3; ++axis)
      for (int n = 0; n < nodes; ++n)
        ASSERT_EQ(asFloat(grid[grid_at++]), static_cast<float>(first + n + 1000 * axis));
    for (int n = 0; n < nodes; ++n) ASSERT_EQ(grid[grid_at++], first == 100 && (first + n) % 3 == 0 ? 0 : 1);
    for (int scalar = 0; scalar < 2; ++scalar)
      for (int n = 0; n < nodes; ++n)
        ASSERT_EQ(asFloat(function[function_at++]), static_cast<float>(first + n + 3000 + 1000 * scalar));
  }
  EXPECT_EQ(readTextFile(folder / "blocks.nam"), "p\nT\n");
}

// More than two batches, rows that do not divide them, and tasks that cross planes.
TEST(WritePlot3d, JoinsBatchesSeamlessly) {
  const TemporaryFolder folder;
  const SceneGridSource scene(makeScene("half-annulus-constant"), {1031, 83, 53});
  Progress progress;
  writePlot3d(scene, folder / "scene", progress);
  const auto grid = wordsOf(folder / "scene.xyz");
  const size_t nodes = size_t{1031} * 83 * 53;
  ASSERT_EQ(grid.size(), 3 + 3 * nodes);
  NodeArrays plane;
  for (uint64_t k = 0; k < 53; ++k) {
    scene.read(0, {0, 83, k, k + 1}, {}, plane);
    for (size_t n = 0; n < plane.x.size(); ++n) {
      const size_t at = 3 + k * plane.x.size() + n;
      ASSERT_EQ(asFloat(grid[at]), static_cast<float>(plane.x[n])) << at;
      ASSERT_EQ(asFloat(grid[at + nodes]), static_cast<float>(plane.y[n]));
      ASSERT_EQ(asFloat(grid[at + 2 * nodes]), static_cast<float>(plane.z[n]));
    }
  }
  EXPECT_EQ(progress.phases().back().steps, nodes);
}

// A disk that is full after `room` bytes.
class DiskWithRoom : public SystemCalls {
 public:
  explicit DiskWithRoom(size_t room) : room_(room) {}
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override {
    if (count > room_) {
      errno = ENOSPC;
      return -1;
    }
    room_ -= count;
    return SystemCalls::pwrite(fd, from, count, offset);
  }

 private:
  size_t room_;
};

TEST(WritePlot3d, LeavesWhatWasThereWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  std::ofstream(folder / "scene.xyz") << "old";
  Progress progress;
  DiskWithRoom disk(300);
  const ScopedSystemCalls scope(disk);
  expectError(
      [&] {
        writePlot3d(SceneGridSource(makeScene("wake"), {5, 4, 3}), folder / "scene", progress);
      },
      {"scene.xyz", "No space left"});
  EXPECT_EQ(readTextFile(folder / "scene.xyz"), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WritePlot3d, LeavesOthersFilesAndFollowsLinks) {
  namespace fs = std::filesystem;
  const TemporaryFolder folder;
  std::ofstream(folder / "precious") << "mine";
  fs::create_symlink("precious",
                     folder / "scene.xyz.part");  // as files were called before they were complete
  std::ofstream(folder / "scene.fun.part") << "mine";
  fs::create_directory(folder / "disk");
  fs::create_symlink("disk/names", folder / "scene.nam");
  Progress progress;
  const Plot3dOutputs outputs =
      writePlot3d(SceneGridSource(makeScene("wake"), {5, 4, 3}), folder / "scene", progress);
  EXPECT_EQ(readTextFile(folder / "precious"), "mine");
  EXPECT_EQ(readTextFile(folder / "scene.fun.part"), "mine");
  EXPECT_TRUE(fs::is_symlink(outputs.names));
  EXPECT_EQ(readTextFile(folder / "disk/names"), "f\n");
  EXPECT_FALSE(fs::is_symlink(outputs.grid));
}

/// Steps of a grid that does not move.
TEST(WritePlot3d, LeavesOutCoordinates) {
  const TemporaryFolder folder;
  std::ofstream(folder / "a.xyz") << "old";
  Progress progress;
  Plot3dOutputs outputs = plot3dOutputs(folder / "a");
  outputs.grid.clear();
  const SceneGridSource source(makeScene("wake"), {5, 4, 3});
  writePlot3d(source, outputs, progress);
  const Plot3dOutputs all = writePlot3d(source, folder / "b", progress);
  EXPECT_EQ(readTextFile(folder / "a.xyz"), "old");
  EXPECT_EQ(wordsOf(outputs.function), wordsOf(all.function));
}

TEST(WritePlot3d, NamesAFolderThatIsMissing) {
  const TemporaryFolder folder;
  Progress progress;
  EXPECT_THROW(writePlot3d(NumberedGrid(), folder / "missing/blocks", progress), Error);
}

}  // namespace
}  // namespace curvisplat
