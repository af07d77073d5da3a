// Faces of blocks that abut are found however the blocks are turned. Regions of faces are found as a search
// through all of them finds them, and by row without one.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/faces/face_patches.h"
#include "tests/reference/function_grid.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

FaceRegion region(uint32_t face, std::array<uint64_t, 2> first, std::array<uint64_t, 2> last) {
  return {face, first, last, "", ""};
}

TEST(FaceRegions, AreThoseOfAFaceInTheirOrder) {
  std::mt19937 random(1);
  std::vector<FaceRegion> all;
  for (int n = 0; n < 500; ++n)
    all.push_back({static_cast<uint32_t>(random() % 40), {}, {1, 1}, std::to_string(n), ""});
  const FaceRegions regions(all);
  for (uint32_t face = 0; face < 41; ++face) {
    std::vector<std::string> expected, found;
    for (const FaceRegion& other : all)
      if (other.face == face) expected.push_back(other.name);
    for (const FaceRegion& other : regions.of(face)) found.push_back(other.name);
    EXPECT_EQ(found, expected) << face;
  }
  EXPECT_TRUE(regions.of(UINT32_MAX).empty());
}

TEST(RegionRows, HoldTheQuadsOfAllRegions) {
  std::mt19937 random(2);
  constexpr uint64_t kColumns = 23, kRows = 17;
  for (int round = 0; round < 50; ++round) {
    std::vector<FaceRegion> regions;
    for (int n = 0; n < round % 7; ++n) {
      const uint64_t u = random() % kColumns, v = random() % kRows;
      regions.push_back(
          region(0, {u, v}, {u + 1 + random() % (kColumns - u), v + 1 + random() % (kRows - v)}));
    }
    const uint64_t begin = random() % kColumns, end = begin + 1 + random() % (kColumns - begin);
    RegionRows rows(regions, {begin, end});
    for (uint64_t v = 0; v < kRows; v += 1 + random() % 2) {
      const std::span<const uint8_t> row = rows.row(v);
      ASSERT_EQ(row.size(), end - begin);
      for (uint64_t u = begin; u < end; ++u) {
        const bool expected = std::any_of(regions.begin(), regions.end(), [&](const FaceRegion& r) {
          return u >= r.first[0] && u < r.last[0] && v >= r.first[1] && v < r.last[1];
        });
        ASSERT_EQ(row[u - begin] != 0, expected) << round << ": " << u << ", " << v;
      }
    }
  }
}

// A search of all regions for every quad would take 2 * 10^11 comparisons.
TEST(RegionRows, TakeHundredsOfThousandsOfRegions) {
  constexpr uint64_t kSide = 1000;
  std::vector<FaceRegion> regions;
  for (uint64_t v = 0; v < kSide; ++v)
    for (uint64_t u = v % 2; u < kSide; u += 2) regions.push_back(region(0, {u, v}, {u + 1, v + 1}));
  RegionRows rows(regions, {0, kSide});
  for (uint64_t v = 0; v < kSide; ++v) {
    const std::span<const uint8_t> row = rows.row(v);
    for (uint64_t u = 0; u < kSide; ++u) ASSERT_EQ(row[u] != 0, (u + v) % 2 == 0) << u << ", " << v;
  }
}

/// A block of cells (i, j, k) -> world, with lattice points of real numbers.
struct Cells {
  std::array<uint64_t, 3> count;
  std::function<glm::dvec3(double i, double j, double k)> at;
  std::function<bool(const std::array<uint64_t, 3>&)> is_there = [](const auto&) { return true; };
};

constexpr int kFloat = 4;

/// The faces at blocks' ends that abut, as "block i j k axis+-".
std::vector<std::string> abuttingOf(const std::vector<Cells>& blocks, uint64_t memory_bytes = 1 << 20) {
  std::vector<GridBlock> grid;
  for (const Cells& block : blocks)
    grid.push_back(gridBlock(block.count[0] + 1, block.count[1] + 1, block.count[2] + 1));
  const TemporaryFolder folder;
  AbuttingFaces faces(grid, kFloat, memory_bytes, folder.path());
  const auto for_each = [&](const auto& visit) {
    for (size_t block = 0; block < blocks.size(); ++block)
      for (uint64_t k = 0; k < blocks[block].count[2]; ++k)
        for (uint64_t j = 0; j < blocks[block].count[1]; ++j)
          for (uint64_t i = 0; i < blocks[block].count[0]; ++i)
            for (int axis = 0; axis < 3; ++axis)
              for (const bool upper : {false, true})
                if (const CellFace face{block, {i, j, k}, axis, upper}; faces.isAtEnd(face)) visit(face);
  };
  for_each([&](const CellFace& face) {
    const Cells& block = blocks[face.block];
    if (!block.is_there(face.cell)) return;
    std::array<glm::dvec3, 8> corners;
    for (size_t n = 0; n < 8; ++n)
      corners[n] = block.at(static_cast<double>(face.cell[0] + (n & 1)),
                            static_cast<double>(face.cell[1] + (n >> 1 & 1)),
                            static_cast<double>(face.cell[2] + (n >> 2)));
    const AbuttingFaces::Centre centre = faces.centreOf(face, corners);
    faces.add({&centre, 1});
  });
  faces.match(Progress());
  std::vector<std::string> abutting;
  for_each([&](const CellFace& face) {
    if (faces.abuts(face))
      abutting.push_back(fmt::format("{} {} {} {} {}{}", face.block, face.cell[0], face.cell[1], face.cell[2],
                                     "ijk"[face.axis], face.upper ? '+' : '-'));
  });
  return abutting;
}

glm::dvec3 box(double i, double j, double k) {
  return {i, 0.1 * j, 3 * k};
}

TEST(AbuttingFaces, OfOneBlockAreNone) {
  EXPECT_EQ(abuttingOf({{{3, 4, 2}, box}}), std::vector<std::string>{});
  EXPECT_EQ(abuttingOf({{{1, 1, 1}, box}}), std::vector<std::string>{});
  // A cell a million times thinner than wide is no other cell's neighbour through itself.
  EXPECT_EQ(
      abuttingOf({{{3, 1, 2}, [](double i, double j, double k) { return glm::dvec3(i, 1e-6 * j, k); }}}),
      std::vector<std::string>{});
}

TEST(AbuttingFaces, AreFoundHoweverTheBlocksAreTurned) {
  // The second block's j goes down the first one's k, its k along the first one's j, at the first one's i
  // = 2.
  const Cells first{{2, 3, 2}, box};
  const Cells second{{4, 2, 3}, [](double i, double j, double k) { return box(2 + 0.3 * i, k, 2 - j); }};
  EXPECT_EQ(abuttingOf({first, second}),
            (std::vector<std::string>{"0 1 0 0 i+", "0 1 1 0 i+", "0 1 2 0 i+", "0 1 0 1 i+", "0 1 1 1 i+",
                                      "0 1 2 1 i+", "1 0 0 0 i-", "1 0 1 0 i-", "1 0 0 1 i-", "1 0 1 1 i-",
                                      "1 0 0 2 i-", "1 0 1 2 i-"}));
}

TEST(AbuttingFaces, AreFoundInLittleMemory) {
  const Cells first{{20, 30, 10}, box};
  const Cells second{{5, 30, 10}, [](double i, double j, double k) { return box(20 + i, j, k); }};
  const std::vector<std::string> found = abuttingOf({first, second});
  EXPECT_EQ(found.size(), 2u * 30 * 10);
  EXPECT_EQ(abuttingOf({first, second}, 1000), found);  // seven faces at a time
}

TEST(AbuttingFaces, TakeABitAndADiskRecordEach) {
  const std::vector<GridBlock> blocks{gridBlock(21, 31, 11), gridBlock(6, 31, 11), gridBlock(5, 1, 9)};
  const uint64_t faces = 2 * (20 * 30 + 20 * 10 + 30 * 10) + 2 * (5 * 30 + 5 * 10 + 30 * 10) + 2 * (4 * 8);
  EXPECT_EQ(AbuttingFaces::needsOf(blocks).memory_bytes, faces / 8);
  EXPECT_EQ(AbuttingFaces::needsOf(blocks).disk_bytes, faces * 56);
}

TEST(AbuttingFaces, AreThoseOfCellsThatAreThere) {
  const Cells first{{2, 1, 2}, box};
  const Cells second{{1, 1, 2},
                     [](double i, double j, double k) { return box(2 + i, j, k); },
                     [](const std::array<uint64_t, 3>& cell) { return cell[2] == 1; }};
  EXPECT_EQ(abuttingOf({first, second}), (std::vector<std::string>{"0 1 0 1 i+", "1 0 0 1 i-"}));
}

TEST(AbuttingFaces, CoincideAsSeamsDo) {
  const Cells first{{1, 1, 1}, box};
  for (const double gap : {0.0, 1e-7, 1e-2}) {  // the least width is 0.1
    const Cells second{{1, 1, 1}, [=](double i, double j, double k) { return box(1 + gap + i, j, k); }};
    EXPECT_EQ(abuttingOf({first, second}).size(), gap < 1e-3 ? 2u : 0u) << gap;
  }
  // Another block's cells are half as large.
  const Cells finer{{1, 2, 1}, [](double i, double j, double k) { return box(1 + i, 0.5 * j, k); }};
  EXPECT_EQ(abuttingOf({first, finer}), std::vector<std::string>{});
}

TEST(AbuttingFaces, OfARingAreItsOwn) {
  const auto around = [](double i, double j, double k) {
    const double angle = 2 * std::numbers::pi * i / 8;
    return glm::dvec3(j * std::cos(angle), j * std::sin(angle), k);
  };
  // From the axis: the cells' inner faces are edges there.
  EXPECT_EQ(abuttingOf({{{8, 1, 1}, around}}),
            (std::vector<std::string>{"0 0 0 0 i-", "0 0 0 0 j-", "0 1 0 0 j-", "0 2 0 0 j-", "0 3 0 0 j-",
                                      "0 4 0 0 j-", "0 5 0 0 j-", "0 6 0 0 j-", "0 7 0 0 i+", "0 7 0 0 j-"}));
  // One wedge alone, as of an axisymmetric grid: an edge is no border, though nothing else is there.
  EXPECT_EQ(abuttingOf({{{1, 2, 1}, around}}), (std::vector<std::string>{"0 0 0 0 j-"}));
  const auto wide = [&](double i, double j, double k) { return around(i, 1 + j, k); };
  EXPECT_EQ(abuttingOf({{{8, 2, 1}, wide}}),
            (std::vector<std::string>{"0 0 0 0 i-", "0 7 0 0 i+", "0 0 1 0 i-", "0 7 1 0 i+"}));
}

// A set may name one file thousands of times: each face with each would take an hour.
TEST(AbuttingFaces, OfOneBlockManyTimesFoldIfTheBlockDoes) {
  constexpr size_t kBlocks = 50'000;
  // Around a body without thickness, or beside it.
  for (const bool around : {true, false}) {
    const std::vector<GridBlock> blocks(kBlocks, gridBlock(3, 2, 2));
    const TemporaryFolder folder;
    AbuttingFaces faces(blocks, kFloat, 16 << 20, folder.path());
    faces.keepFolds();
    const auto each_face = [&](const auto& visit) {
      for (size_t block = 0; block < kBlocks; ++block)
        for (const uint64_t i : {0u, 1u}) visit(CellFace{block, {i, 0, 0}, 1, false});  // of the side j-
    };
    each_face([&](const CellFace& face) {
      std::array<glm::dvec3, 8> corners;
      for (size_t n = 0; n < 8; ++n) {
        const double x = static_cast<double>(face.cell[0] + (n & 1)) - (around ? 1 : 0);
        const double y = static_cast<double>(n >> 1 & 1);
        corners[n] = {std::abs(x), x < 0 ? -y : y, static_cast<double>(n >> 2)};
      }
      const AbuttingFaces::Centre centre = faces.centreOf(face, corners);
      faces.add({&centre, 1});
    });
    faces.match(Progress());
    size_t abutting = 0, folded = 0;
    each_face([&](const CellFace& face) {
      abutting += faces.abuts(face);
      folded += faces.folds(face);
    });
    EXPECT_EQ(abutting, 2 * kBlocks);
    EXPECT_EQ(folded, around ? 2 * kBlocks : 0);
  }
}

}  // namespace
}  // namespace curvisplat
