// Cells get the positions of their corners, a bounded number of corners at a time. What conversion of a mesh
// writes to temporary files is known beforehand.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/face_matcher.h"
#include "preprocess/gather/gather_forecast.h"
#include "preprocess/scenes/scenes.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/fault_sweep.h"
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
  // Each prism has 40 points of 8 bytes and 22 faces, the number of whose corners and 120 places take 4 bytes
  // each.
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

/// A prism over a regular polygon of very many corners; its faces look inward, and have the area of theirs.
TEST(FaceList, MeasuresTheFacesOfACellOfManyCorners) {
  constexpr uint32_t kSides = 500;
  GatheredCells cells;
  cells.shapes = {CellKind::kPolyhedron};
  for (const double z : {0.0, 1.0})
    for (uint32_t n = 0; n < kSides; ++n) {
      const double angle = 2 * std::numbers::pi * n / kSides;
      cells.at.emplace_back(7 + std::cos(angle), 5 + std::sin(angle), z);
      cells.corners.push_back(cells.corners.size());
    }
  for (const uint32_t end : {0u, kSides}) {
    cells.faces.push_back(kSides);
    for (uint32_t n = 0; n < kSides; ++n) cells.faces.push_back(end + n);
  }
  for (uint32_t n = 0; n < kSides; ++n) {
    const uint32_t next = (n + 1) % kSides;
    cells.faces.insert(cells.faces.end(), {4, n, next, next + kSides, n + kSides});
  }
  cells.corner_begin.push_back(cells.corners.size());
  cells.face_begin.push_back(cells.faces.size());
  FaceList list;
  list.assign(cells);
  ASSERT_EQ(list.places.size(), kSides + 2);
  const double side = 2 * std::sin(std::numbers::pi / kSides);
  const double end_area = kSides * 0.5 * std::sin(2 * std::numbers::pi / kSides);
  for (size_t n = 0; n < list.places.size(); ++n) {
    const HalfFace face = list.face(cells, n);
    EXPECT_NEAR(glm::length(face.inward), n < 2 ? end_area : side, 1e-12);
    EXPECT_GT(glm::dot(face.inward, glm::dvec3(7, 5, 0.5) - face.centre), 0);
  }
}

/// Far more faces than were expected, each twice.
TEST(FaceMatcher, FindsThePairsAmongMoreFacesThanExpected) {
  constexpr uint64_t kFaces = 20'000;
  std::vector<FaceCorners> faces;
  for (uint64_t n = 0; n < kFaces; ++n) faces.push_back({n, n + 1, n + 2});
  const TemporaryFolder folder;
  FaceMatcher matcher(sizeof(uint64_t), 1, 1 << 20, ScratchFiles(folder.path()));
  const auto put = [](size_t n, std::span<std::byte> to) { std::memcpy(to.data(), &n, sizeof n); };
  matcher.add(faces, {put});
  std::vector<int> paired(kFaces);
  matcher.add(faces, {put, {}, [&](std::span<const std::byte> first, size_t second) {
                        uint64_t number = 0;
                        std::memcpy(&number, first.data(), sizeof number);
                        EXPECT_EQ(number, second);
                        ++paired[second];
                      }});
  EXPECT_EQ(paired, std::vector<int>(kFaces, 1));
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

struct Disk {
  uint64_t forecast = 0, bound = 0, used = 0;
};

/// The disk that a conversion with one scalar takes, whose passes over the mesh have `mesh_bytes` of memory.
Disk diskOf(const MeshSource& mesh, uint32_t scalar, uint64_t mesh_bytes) {
  const TemporaryFolder folder;
  ConvertOptions options;
  options.output = folder / "a.splats";
  options.scalars = {scalar};
  options.limits.mesh_bytes = mesh_bytes;
  options.memory_bytes = 512 << 20;
  Progress progress;
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, 1, 2);
  plan.mesh_bytes = mesh_bytes;
  const MeshOrigin origin(mesh, options.scalars, std::nullopt, plan, folder.path());
  const DiskNeeds splats = diskNeeds(origin.blocks().front().ni, 1);
  Disk disk;
  disk.forecast = with(origin.temporaryNeeds(progress), splats).mostTemporary();
  disk.bound = with(origin.mostTemporaryNeeds(), splats).mostTemporary();
  disk.used = convert(mesh, options, progress).temporary_bytes;
  return disk;
}

/// A scalar, of points (0) or of cells (1), and the memory of the passes over the mesh.
struct Passes {
  uint32_t scalar = 0;
  uint64_t mebibytes = 0;

  bool operator==(const Passes&) const = default;
};
constexpr Passes kPointsInMemory{0, 200}, kPointsOnDisk{0, 4}, kCells{1, 16};

class GatherForecast : public testing::Test {
 protected:
  /// Tries the passes that are `usual`, which differ from mesh to mesh; with tools/test.sh --whole all of them.
  void expectForecast(const char* what, const ArrayPiece& piece, const Passes& usual) {
    const ArrayMesh mesh({piece});
    for (const Passes& passes :
         {kPointsInMemory, kPointsOnDisk, kCells, Passes{0, 16}, Passes{1, 200}, Passes{1, 4}}) {
      if (passes != usual && !faults::isWholeSweep()) continue;
      const Disk disk = diskOf(mesh, passes.scalar, passes.mebibytes << 20);
      const std::string name =
          fmt::format("{}, {}, {} MiB", what, passes.scalar == 0 ? "points" : "cells", passes.mebibytes);
      fmt::print("{}: {} used, {:.2f} forecast, {:.2f} bound\n", name, disk.used,
                 static_cast<double>(disk.forecast) / static_cast<double>(disk.used),
                 static_cast<double>(disk.bound) / static_cast<double>(disk.used));
      EXPECT_GE(static_cast<double>(disk.forecast), 0.97 * static_cast<double>(disk.used)) << name;
      EXPECT_LE(static_cast<double>(disk.forecast), 1.4 * static_cast<double>(disk.used)) << name;
      EXPECT_GE(disk.bound, disk.used) << name;
    }
  }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
};

TEST_F(GatherForecast, IsRightForCellsInOrder) {
  expectForecast("hexahedra", hexahedraOf(*scene_, 80, 40, 40), kCells);
  expectForecast("tetrahedra", tetrahedraOf(*scene_, 40, 20, 20), kPointsOnDisk);
}

TEST_F(GatherForecast, IsRightForCellsInARandomOrder) {
  expectForecast("shuffled hexahedra", shuffled(hexahedraOf(*scene_, 60, 30, 30), 3), kPointsOnDisk);
  expectForecast("shuffled tetrahedra", shuffled(tetrahedraOf(*scene_, 40, 20, 20), 3), kCells);
}

TEST_F(GatherForecast, IsRightForCellsOfTwoSizes) {
  expectForecast("parted cube", partedCube(20), kCells);
  expectForecast("shuffled parted cube", shuffled(partedCube(20), 3), kPointsInMemory);
}

TEST_F(GatherForecast, IsRightForALayer) {
  expectForecast("layer", hexahedraOf(*scene_, 300, 300, 1), kPointsOnDisk);
}

TEST_F(GatherForecast, IsRightForPieces) {
  // Cells of a piece lie beside one another; points that pieces share are kept in memory.
  const ArrayPiece hexahedra = hexahedraOf(*scene_, 80, 40, 40);
  const ArrayMesh pieces(split(hexahedra, 4, [](size_t cell) { return cell / 32'000; }));
  for (const uint32_t scalar : {0u, 1u}) {
    if (scalar == 1 && !faults::isWholeSweep()) continue;
    const Disk disk = diskOf(pieces, scalar, 16 << 20);
    EXPECT_GE(static_cast<double>(disk.forecast), 0.97 * static_cast<double>(disk.used));
    EXPECT_LE(static_cast<double>(disk.forecast), 1.5 * static_cast<double>(disk.used));
  }
}

TEST_F(GatherForecast, CountsAShareOfTheFacesOfALargeMesh) {
  // As if the mesh were 16 times as large: one point of 16 is followed.
  const ArrayPiece hexahedra = hexahedraOf(*scene_, 80, 40, 40);
  const ArrayMesh mesh({hexahedra});
  const MeshReader reader(mesh, {}, std::nullopt);
  WaitingFaces all(6 * reader.cells(), 1000), share(96 * reader.cells(), 1000);
  reader.forEachCells([&](const LoadedCells& loaded) {
    for (WaitingFaces* const faces : {&all, &share}) {
      GatheredCells cells;
      for (size_t n = 0; n < loaded.cells.size(); ++n) {
        const auto corners = loaded.cells.cornersOfCell(n);
        if (std::none_of(corners.begin(), corners.end(),
                         [&](uint64_t corner) { return faces->follows(corner); }))
          continue;
        cells.numbers.push_back(loaded.range.number + n);
        cells.shapes.push_back(loaded.cells.shapes[n]);
        cells.corners.insert(cells.corners.end(), corners.begin(), corners.end());
        cells.corner_begin.push_back(cells.corners.size());
        cells.face_begin.push_back(0);
      }
      faces->add(cells);
    }
  });
  const WaitingFaces::Counts exact = all.counts(), about = share.counts();
  EXPECT_EQ(exact.outer, 2u * (80 * 40 + 80 * 40 + 40 * 40));
  EXPECT_EQ(exact.corners_of_outer, 8 * exact.outer);
  EXPECT_EQ(exact.found.in_range + exact.found.across, 3u * 80 * 40 * 40 - exact.outer / 2);
  EXPECT_EQ(exact.spilled, exact.outer) << "at the end";
  const auto expectAbout = [](uint64_t value, uint64_t truth) {
    EXPECT_NEAR(static_cast<double>(value), static_cast<double>(truth), 0.15 * static_cast<double>(truth));
  };
  expectAbout(about.outer, exact.outer);
  expectAbout(about.found.in_range, exact.found.in_range);
  expectAbout(about.found.across, exact.found.across);
}

}  // namespace
}  // namespace curvisplat
