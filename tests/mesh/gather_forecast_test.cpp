// What conversion of a mesh writes to temporary files is known beforehand.
#include "preprocess/gather/gather_forecast.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "preprocess/convert/convert.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/scenes/scenes.h"
#include "tests/reference/array_mesh.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

struct Disk {
  uint64_t forecast = 0, bound = 0, used = 0;
};

/// Of a conversion with one scalar, whose passes over the mesh have `mesh_bytes` of memory.
Disk diskOf(const MeshSource& mesh, uint32_t scalar, uint64_t mesh_bytes) {
  const TemporaryFolder folder;
  ConvertOptions options;
  options.output = folder / "a.splats";
  options.scalars = {scalar};
  options.mesh_bytes = mesh_bytes;
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

class GatherForecast : public testing::Test {
 protected:
  void expectForecast(const char* what, const ArrayPiece& piece) { expectForecast(what, ArrayMesh({piece})); }
  void expectForecast(const char* what, const ArrayMesh& mesh) {
    for (const uint32_t scalar : {0u, 1u})
      for (const uint64_t memory : {uint64_t{200} << 20, uint64_t{16} << 20, uint64_t{4} << 20}) {
        const Disk disk = diskOf(mesh, scalar, memory);
        const std::string name =
            fmt::format("{}, {}, {} MiB", what, scalar == 0 ? "points" : "cells", memory >> 20);
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
  expectForecast("hexahedra", hexahedraOf(*scene_, 80, 40, 40));
  expectForecast("tetrahedra", tetrahedraOf(*scene_, 40, 20, 20));
}

TEST_F(GatherForecast, IsRightForCellsInARandomOrder) {
  expectForecast("shuffled hexahedra", shuffled(hexahedraOf(*scene_, 60, 30, 30), 3));
  expectForecast("shuffled tetrahedra", shuffled(tetrahedraOf(*scene_, 40, 20, 20), 3));
}

TEST_F(GatherForecast, IsRightForPieces) {
  // Cells of a piece lie beside one another; points that pieces share are kept in memory.
  const ArrayPiece hexahedra = hexahedraOf(*scene_, 80, 40, 40);
  const ArrayMesh pieces(split(hexahedra, 4, [](size_t cell) { return cell / 32'000; }));
  for (const uint32_t scalar : {0u, 1u}) {
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
