// Conversion of cell-centred scalars, as a whole.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

ConvertOptions cellOptionsFor(const std::filesystem::path& output, std::vector<uint32_t> scalars) {
  ConvertOptions options;
  options.output = output;
  options.memory_bytes = uint64_t{1} << 30;
  options.scalars = std::move(scalars);
  options.title = "cells";
  return options;
}

AddScalarReport addQuietly(const GridSource& source, const std::filesystem::path& cache, uint32_t scalar) {
  AddScalarOptions options;
  options.cache = cache;
  options.scalars = {scalar};
  options.memory_bytes = uint64_t{1} << 30;
  Progress progress;
  return addScalars(source, options, progress);
}

double cellField(const GridCell& cell) {
  return std::sin(3 * cell.centre.x) * cell.centre.y + cell.centre.z;
}

/// Scalars "f" at nodes, and "c0", "c1" in cells.
struct CellScene {
  SceneGridSource nodes{makeScene("half-annulus"), {33, 40, 37}};
  CellGridSource source{nodes, {cellField, [](const GridCell& cell) { return cell.centre.x; }}};
};

TEST(CellConvert, KeepsEveryCellAndTheVolumeOfTheHexahedra) {
  const TemporaryFolder folder;
  const CellScene scene;
  const ConvertReport report = converted(scene.source, cellOptionsFor(folder / "c.splats", {1}));
  EXPECT_EQ(report.centring, Centring::kCell);
  EXPECT_EQ(report.nodes, 32u * 39 * 36);
  EXPECT_EQ(report.splats, report.nodes);
  EXPECT_EQ(report.merged_nodes, 0u);
  EXPECT_EQ(report.blanked.total(), 0u);
  // The mapping's chords cut off (dθ)²/6 of an annulus. The rounding of volumes that are alike in whole
  // layers of cells leaves 1.7e-5, and 3.5e-5 if bricks do not make up for it.
  EXPECT_NEAR(report.volume / makeScene("half-annulus")->volume(), 1 - std::pow(M_PI / 32, 2) / 6, 2e-5);
  const CacheReader cache(folder / "c.splats");
  EXPECT_TRUE(cache.manifest().cells);
  EXPECT_EQ(cache.manifest().blocks[0].ni, 33u);
  EXPECT_TRUE(verifyCache(cache).findings.empty());
}

TEST(CellConvert, HasTheSameBytesForAnyThreadsAndMemory) {
  const TemporaryFolder folder;
  const SceneGridSource nodes(makeScene("half-annulus"), {60, 50, 40});
  Rearrangement blocks;
  blocks.cuts = {2, 1, 3};
  const RearrangedGridSource cut(nodes, blocks);
  const CellGridSource source(cut, {[](const GridCell& cell) {
                                return cell.i + cell.j + 5 * cell.k == 50
                                           ? std::numeric_limits<double>::quiet_NaN()
                                           : cellField(cell);
                              }});
  ConvertOptions options = cellOptionsFor(folder / "c.splats", {1});
  options.threads = 2;
  expectSameCaches(source, options,
                   {{.threads = 1, .memory_bytes = leastMemory(1), .bucket_splats = 30'000}});
}

TEST(CellConvert, NamesTheMemoryThatManySmallBlocksTake) {
  // Nothing of it is read: a thousand layers of a million cells.
  const FunctionGridSource nodes(std::vector(1'000, gridBlock(3000, 300, 2)), 0,
                                 [](const GridNode&) { return NodeValues{}; });
  const CellGridSource source(nodes, {cellField});
  const TemporaryFolder folder;
  ConvertOptions options = cellOptionsFor(folder / "c.splats", {0});
  const std::string error = errorOf([&] { converted(source, options); });
  expectSays(error, "matching the faces of this grid's blocks takes 215 MiB; give at least ");
  // Matching has a sixteenth of what the allocator's sixteenth and the program itself (some 82 MiB) leave.
  const size_t number = error.find("at least ") + std::string("at least ").size();
  EXPECT_NEAR(std::stod(error.substr(number)), (215 * 16 + 82) * 16 / 15., 20) << error;
  EXPECT_FALSE(std::filesystem::exists(options.output));
}

TEST(CellConvert, LeavesOutCellsWithoutACornerOrAValue) {
  const TemporaryFolder folder;
  const FunctionGridSource nodes({gridBlock(9, 9, 9), gridBlock(3, 3, 3)}, 0, [](const GridNode& node) {
    const bool blank = node.block == 0 && node.i == 4 && node.j == 4 && node.k == 4;
    return NodeValues{glm::dvec3(node.i + 20.0 * node.block, node.j, node.k), {}, blank};
  });
  const CellGridSource source(nodes, {[](const GridCell& cell) {
                                const double x = cell.centre.x;
                                if (cell.j > 0 || cell.k > 0) return x;
                                if (cell.i == 0) return std::numeric_limits<double>::quiet_NaN();
                                if (cell.i == 1) return std::numeric_limits<double>::infinity();
                                return cell.i == 2 ? -99.0 : x;
                              }});
  ConvertOptions options = cellOptionsFor(folder / "c.splats", {0});
  options.blank_value = -99;
  const ConvertReport report = converted(source, options);
  EXPECT_EQ(report.nodes, 512u + 8);
  EXPECT_EQ(report.blanked.by_grid, 8u + 2);
  EXPECT_EQ(report.blanked.by_value, 1u);
  EXPECT_EQ(report.blanked.not_finite, 2u);
  EXPECT_EQ(report.splats, 520u - 13);
  EXPECT_NEAR(report.volume, 520 - 13, 0.1);
  const Manifest manifest = CacheReader(folder / "c.splats").manifest();
  EXPECT_EQ(manifest.lower, glm::dvec3(0));
  EXPECT_EQ(manifest.upper, glm::dvec3(22, 8, 8));
  EXPECT_EQ(manifest.blanked_nodes, 13u);
}

TEST(CellConvert, RefusesNodesAndCellsInOneCache) {
  const TemporaryFolder folder;
  const CellScene scene;
  const std::string error = errorOf([&] {
    converted(scene.source, cellOptionsFor(folder / "c.splats", {0, 1}));
  });
  expectSays(error, "f is node-centred, but c0 is cell-centred");
  EXPECT_FALSE(std::filesystem::exists(folder / "c.splats"));
}

TEST(CellConvert, AddsAScalarAsIfItHadBeenThereFromTheStart) {
  const TemporaryFolder folder;
  const CellScene scene;
  converted(scene.source, cellOptionsFor(folder / "both.splats", {1, 2}));
  converted(scene.source, cellOptionsFor(folder / "one.splats", {1}));
  const AddScalarReport report = addQuietly(scene.source, folder / "one.splats", 2);
  EXPECT_EQ(report.splats, 32u * 39 * 36);
  Files both = allFilesOf(folder / "both.splats"), one = allFilesOf(folder / "one.splats");
  for (Files* files : {&both, &one}) {
    files->erase("manifest.json");
    // faces.bin has the scalars of the conversion, faces.var1.bin that of the addition.
    std::erase_if(*files, [](const auto& file) { return file.first.starts_with("faces."); });
  }
  EXPECT_TRUE(both == one);

  const std::string error = errorOf([&] { addQuietly(scene.source, folder / "one.splats", 0); });
  expectSays(error, "are cell-centred, but f is node-centred");
}

TEST(CellConvert, AddsToTheCellsThatOlderScalarsLeft) {
  const TemporaryFolder folder;
  const SceneGridSource nodes(makeScene("half-annulus"), {33, 40, 37});
  const auto holes = [](const GridCell& cell) {
    return (cell.i + cell.j + cell.k) % 17 == 0 ? std::numeric_limits<double>::quiet_NaN() : cellField(cell);
  };
  const CellGridSource source(nodes, {holes, cellField});
  converted(source, cellOptionsFor(folder / "both.splats", {1, 2}));
  converted(source, cellOptionsFor(folder / "one.splats", {1}));
  addQuietly(source, folder / "one.splats", 2);
  Files both = allFilesOf(folder / "both.splats"), one = allFilesOf(folder / "one.splats");
  EXPECT_TRUE(both["var.1.bin"] == one["var.1.bin"]);
  EXPECT_TRUE(both["geometry.bin"] == one["geometry.bin"]);

  // The other way round a value is missing.
  converted(source, cellOptionsFor(folder / "whole.splats", {2}));
  expectSays(errorOf([&] { addQuietly(source, folder / "whole.splats", 1); }), "convert again");
}

}  // namespace
}  // namespace curvisplat
