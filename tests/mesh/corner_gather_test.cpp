// Cells get the positions of their corners, a bounded number of corners at a time.
#include "preprocess/gather/corner_gather.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/reference/array_mesh.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

/// Prisms over polygons: each has the points from a number of its own on.
ArrayPiece prisms(size_t cells, uint64_t corners) {
  ArrayPiece piece;
  for (uint64_t n = 0; n < cells + corners; ++n) piece.points.emplace_back(n, 2 * n, 3 * n);
  std::vector<uint64_t> points(corners);
  for (size_t n = 0; n < cells; ++n) {
    std::iota(points.begin(), points.end(), n);
    piece.cells.append(CellKind::kTetrahedron, std::span(points).first(4));
    piece.cells.appendPrism(points);
  }
  setValues(piece, [](const glm::dvec3& x) { return x.x; });
  return piece;
}

TEST(CornerGather, GivesFewPolyhedraAtATime) {
  constexpr size_t kPrisms = 8000, kCorners = 40, kCells = 2 * kPrisms;  // less than a chunk that is read
  const ArrayMesh mesh({prisms(kPrisms, kCorners)});
  const MeshReader reader(mesh, {0}, std::nullopt);
  const TemporaryFolder folder;
  Progress progress;
  for (const uint64_t memory_bytes : {uint64_t{1} << 30, uint64_t{1} << 16}) {
    const PointNumbers numbers(reader, memory_bytes, folder.path(), progress);
    CornerGather gather(reader, numbers, memory_bytes, folder.path(), progress);
    size_t next = 0, calls = 0;
    gather.forEach([&](const GatheredCells& cells) {
      ++calls;
      EXPECT_LE(cells.corners.size(), GatheredCells::kMaxCorners);
      EXPECT_LE(cells.faces.size(), GatheredCells::kMaxCorners);
      for (size_t n = 0; n < cells.size(); ++n, ++next) {
        ASSERT_EQ(cells.numbers[n], next);
        ASSERT_EQ(cells.cornersOfCell(n).size(), next % 2 == 0 ? 4u : kCorners);
        for (size_t at = cells.corner_begin[n]; at < cells.corner_begin[n + 1]; ++at)
          ASSERT_EQ(cells.at[at].x, static_cast<double>(next / 2 + at - cells.corner_begin[n]));
      }
    });
    EXPECT_EQ(next, kCells);
    EXPECT_GE(calls, kPrisms * kCorners / GatheredCells::kMaxCorners);
  }
}

TEST(CornerGather, LeavesRoomForChunksOfPolyhedra) {
  const ArrayMesh mesh({prisms(8000, 40)});
  const MeshReader reader(mesh, {0}, std::nullopt);
  // Of each prism: 40 points of 8 bytes; 22 faces, the number of whose corners and 120 places take 4 bytes each.
  const uint64_t prism = 40 * 8 + (22 + 120) * 4, tetrahedron = 4 * 8, cell = 1 + 2 * 8;
  const uint64_t chunk = reader.largestChunk();
  EXPECT_NEAR(static_cast<double>(chunk), 8000 * (prism + tetrahedron + 2 * cell),
              0.01 * static_cast<double>(chunk));
  EXPECT_EQ(halfBesideChunks(10 * chunk, chunk), 4 * chunk);
  EXPECT_EQ(halfBesideChunks(2 * chunk, chunk), chunk / 2) << "a half at the least, however large chunks are";
}

TEST(CornerGather, GivesACellOfManyCornersAlone) {
  constexpr uint64_t kCorners = GatheredCells::kMaxCorners + 2;
  const ArrayMesh mesh({prisms(2, kCorners)});
  const MeshReader reader(mesh, {0}, std::nullopt);
  const TemporaryFolder folder;
  Progress progress;
  const PointNumbers numbers(reader, 1 << 20, folder.path(), progress);
  std::vector<size_t> sizes;
  CornerGather(reader, numbers, uint64_t{1} << 30, folder.path(), progress)
      .forEach([&](const GatheredCells& cells) { sizes.push_back(cells.size()); });
  EXPECT_EQ(sizes, (std::vector<size_t>{1, 1, 1, 1}));
}

TEST(CornerGather, GivesAllCellsWherePagesAreLeftForStreams) {
  // Up to a prism in the middle of a chunk, cells have points near those of the cell before.
  constexpr size_t kPrisms = 20000, kNear = 7000, kCorners = 40;
  ArrayPiece piece;
  for (uint64_t n = 0; n < 4 * kPrisms; ++n) piece.points.emplace_back(n, 2 * n, 3 * n);
  std::mt19937 random(1);
  std::vector<uint64_t> points(kCorners);
  std::vector<uint64_t> first_points;
  for (size_t n = 0; n < kPrisms; ++n) {
    first_points.push_back(n < kNear ? 3 * n : random() % (4 * kPrisms - kCorners));
    std::iota(points.begin(), points.end(), first_points.back());
    piece.cells.appendPrism(points);
  }
  setValues(piece, [](const glm::dvec3& x) { return x.x; });
  const ArrayMesh mesh({piece});
  const MeshReader reader(mesh, {0}, std::nullopt);
  const TemporaryFolder folder;
  Progress progress;
  constexpr uint64_t kMemory = 1'000'000;  // two pages
  const PointNumbers numbers(reader, kMemory, folder.path(), progress);
  size_t next = 0;
  CornerGather(reader, numbers, kMemory, folder.path(), progress).forEach([&](const GatheredCells& cells) {
    for (size_t n = 0; n < cells.size(); ++n, ++next) {
      ASSERT_EQ(cells.numbers[n], next);
      ASSERT_EQ(cells.cornersOfCell(n).size(), kCorners);
      for (size_t at = cells.corner_begin[n]; at < cells.corner_begin[n + 1]; ++at) {
        const auto number = static_cast<double>(first_points[next] + at - cells.corner_begin[n]);
        ASSERT_EQ(cells.at[at], glm::dvec3(number, 2 * number, 3 * number));
        ASSERT_EQ(cells.corner_values[at], static_cast<float>(number));
      }
    }
  });
  EXPECT_EQ(next, kPrisms);
}

}  // namespace
}  // namespace curvisplat
