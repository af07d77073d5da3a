// Conversion as a whole: what must hold of a cache whatever the grid, the threads and the memory.
#include "preprocess/convert/convert.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <set>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

ConvertOptions optionsFor(const GridSource& source, const std::filesystem::path& output) {
  ConvertOptions options;
  options.output = output;
  options.memory_bytes = uint64_t{1} << 30;
  for (uint32_t n = 0; n < source.description().scalars.size(); ++n) options.scalars.push_back(n);
  return options;
}

double weightOf(const SplatGeometry& geometry) {
  double sum = 0;
  for (const float weight : geometry.weight) sum += weight;
  return sum;
}

/// Checks what holds of every cache: its leaves hold `splats` nodes, each once; inner bricks weigh what their
/// children do, and their error is not below theirs.
void checkCache(const std::filesystem::path& path, uint64_t splats) {
  const CacheReader cache(path);
  std::vector<std::pair<std::array<uint64_t, 4>, uint64_t>> runs;
  std::vector<double> weights;
  SplatGeometry geometry;
  SplatVariable values;
  uint64_t in_leaves = 0;
  for (uint32_t n = 0; n < cache.bricks().size(); ++n) {
    const Brick& brick = cache.bricks()[n];
    std::vector<NodeRun> of_brick;
    cache.readGeometry(n, geometry, &of_brick);
    for (size_t v = 0; v < cache.manifest().variables.size(); ++v) cache.readVariable(n, v, values);
    weights.push_back(weightOf(geometry));
    if (brick.isLeaf()) {
      in_leaves += brick.splats;
      EXPECT_EQ(brick.error, 0);
      for (const NodeRun& run : of_brick) runs.push_back({{run.block, run.k, run.j, run.i}, run.count});
    }
  }
  EXPECT_EQ(in_leaves, splats);
  EXPECT_EQ(cache.manifest().splats, splats);
  std::sort(runs.begin(), runs.end());
  for (size_t n = 1; n < runs.size(); ++n) {
    auto end = runs[n - 1].first;
    end[3] += runs[n - 1].second;
    ASSERT_LE(end, runs[n].first) << "a node is in two leaves";
  }
  for (uint32_t n = 0; n < cache.bricks().size(); ++n) {
    const Brick& brick = cache.bricks()[n];
    if (brick.isLeaf()) continue;
    double sum = 0;
    for (uint32_t child = brick.first_child; child < brick.first_child + brick.child_count; ++child) {
      sum += weights[child];
      EXPECT_GE(brick.error, cache.bricks()[child].error);
    }
    EXPECT_NEAR(weights[n], sum, 1e-3 * sum);
  }
}

/// A box of nodes with rounded edges: smooth, and not aligned to anything.
NodeValues roundedBox(const GridNode& node, const GridBlock& block, double stretch = 1) {
  const double u = static_cast<double>(node.i) / static_cast<double>(std::max<uint64_t>(block.ni - 1, 1));
  const double v = static_cast<double>(node.j) / static_cast<double>(std::max<uint64_t>(block.nj - 1, 1));
  const double w = static_cast<double>(node.k) / static_cast<double>(std::max<uint64_t>(block.nk - 1, 1));
  const glm::dvec3 position(u + 0.1 * std::sin(3 * v), v * stretch, w + 0.1 * u * v);
  return {position, {static_cast<float>(u * v), static_cast<float>(w)}, false};
}

FunctionGridSource roundedBoxSource(uint64_t ni, uint64_t nj, uint64_t nk, size_t scalars = 1,
                                    double stretch = 1) {
  const GridBlock block = gridBlock(ni, nj, nk);
  return {{block}, scalars, [=](const GridNode& node) { return roundedBox(node, block, stretch); }};
}

TEST(Convert, KeepsEveryNodeAndItsVolume) {
  const TemporaryFolder folder;
  const SceneGridSource source(makeScene("half-annulus"), {60, 36, 36});
  const ConvertReport report = converted(source, optionsFor(source, folder / "a.splats"));
  EXPECT_EQ(report.nodes, 60u * 36 * 36);
  EXPECT_EQ(report.splats, report.nodes);
  EXPECT_EQ(report.merged_nodes, 0u);
  checkCache(folder / "a.splats", report.nodes);
  const double volume = makeScene("half-annulus")->volume();
  EXPECT_NEAR(report.volume, volume, 0.01 * volume);
  EXPECT_GE(report.levels, 2u);
  // Nothing stays behind but the cache.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(Convert, GivesTheSameBytesForAnyThreadsAndMemory) {
  const TemporaryFolder folder;
  const SceneGridSource source(makeScene("wake"), {60, 40, 32});
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  options.title = "the same";
  options.threads = 2;
  options.memory_bytes = uint64_t{8} << 30;
  const uint64_t least = leastMemory(1);
  std::vector<Variation> variations{{.threads = 1, .memory_bytes = least},
                                    {.memory_bytes = least, .bucket_splats = 200}};
  if (faults::isWholeSweep())
    variations.insert(variations.end(), {{.threads = 1},
                                         {.memory_bytes = least, .bucket_splats = 30000},
                                         {.memory_bytes = least, .bucket_splats = 7000}});
  const ConvertReport report = expectSameCaches(source, options, variations);
  EXPECT_GT(report.merged_nodes, 0u);  // the O-grid closes on itself
  checkCache(options.output, report.nodes - report.merged_nodes);
}

TEST(Convert, DividesBucketsThatThePlanLeftTooLarge) {
  // A cluster finer than the counting grid can see, in the midst of an even grid.
  const TemporaryFolder folder;
  const GridBlock block = gridBlock(44, 44, 44);
  const FunctionGridSource source({block}, 1, [&](const GridNode& node) {
    NodeValues values = roundedBox(node, block);
    if (node.k > 15) values.position = glm::dvec3(0.3) + 1e-6 * values.position;
    return values;
  });
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  const ConvertReport report = expectSameCaches(source, options, {{.bucket_splats = 1200}});
  checkCache(options.output, report.splats);
}

TEST(Convert, TakesNodesThatAllCoincide) {
  const TemporaryFolder folder;
  const FunctionGridSource source({gridBlock(43, 43, 43)}, 1, [](const GridNode& node) {
    return NodeValues{glm::dvec3(1, 2, 3), {static_cast<float>(node.i)}, false};
  });
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  const ConvertReport report = expectSameCaches(source, options, {{.bucket_splats = 5000}});
  checkCache(options.output, report.splats);
  EXPECT_GT(report.splats, 65536u);
  EXPECT_EQ(report.levels, 1u);
  EXPECT_EQ(report.bricks, (report.splats + 65535) / 65536);
}

TEST(Convert, TakesAClusterOfCoincidentNodesInAGrid) {
  const TemporaryFolder folder;
  const GridBlock block = gridBlock(50, 44, 44);
  const FunctionGridSource source({block}, 1, [&](const GridNode& node) {
    NodeValues values = roundedBox(node, block);
    if (node.k >= 5 && node.k < 40) values.position = glm::dvec3(0.5);
    return values;
  });
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  const ConvertReport report = expectSameCaches(source, options, {{.threads = 1, .bucket_splats = 2000}});
  checkCache(options.output, report.splats);
}

TEST(Convert, TakesBlocksOneNodeThick) {
  const TemporaryFolder folder;
  int number = 0;
  for (const auto& [ni, nj, nk] :
       {std::array{300, 1, 1}, {1, 300, 1}, {1, 1, 300}, {40, 40, 1}, {1, 40, 40}, {40, 1, 40}, {1, 1, 1}}) {
    const FunctionGridSource source = roundedBoxSource(ni, nj, nk);
    const auto output = folder / fmt::format("{}.splats", number++);
    const ConvertReport report = converted(source, optionsFor(source, output));
    EXPECT_EQ(report.nodes, static_cast<uint64_t>(ni * nj * nk));
    checkCache(output, report.nodes - report.merged_nodes);
  }
}

TEST(Convert, TakesManySmallBlocks) {
  // 6 x 5 x 9 blocks of 4³ nodes that share their faces.
  const TemporaryFolder folder;
  const std::vector<GridBlock> blocks(270, gridBlock(4, 4, 4));
  const FunctionGridSource source(blocks, 1, [](const GridNode& node) {
    const glm::dvec3 at(3 * (node.block % 6) + node.i, 3 * (node.block / 6 % 5) + node.j,
                        3 * (node.block / 30) + node.k);
    return NodeValues{at, {static_cast<float>(at.x)}, false};
  });
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  const ConvertReport report = expectSameCaches(source, options, {{.bucket_splats = 5000}});
  EXPECT_EQ(report.splats, 19u * 16 * 28);
  EXPECT_EQ(report.merged_nodes, 270u * 64 - report.splats);
  EXPECT_NEAR(report.volume, 18 * 15 * 27, 18 * 15 * 27e-3);
  checkCache(options.output, report.splats);
}

TEST(Convert, TakesExtremeAspectRatios) {
  const TemporaryFolder folder;
  const FunctionGridSource source = roundedBoxSource(42, 42, 42, 1, 1e-5);
  const ConvertReport report = converted(source, optionsFor(source, folder / "a.splats"));
  checkCache(folder / "a.splats", 42 * 42 * 42);
  EXPECT_EQ(report.degenerate, 0u);
  EXPECT_NEAR(report.volume, 1e-5, 1e-7);
}

TEST(Convert, LeavesBlankedNodesOutAndCountsThem) {
  const TemporaryFolder folder;
  const GridBlock block = gridBlock(30, 20, 10);
  const FunctionGridSource source({block}, 1, [&](const GridNode& node) {
    NodeValues values = roundedBox(node, block);
    values.blank = node.i < 3;
    if (node.i == 5) values.scalars[0] = 9999;
    if (node.i == 7) values.position.x = std::numeric_limits<double>::quiet_NaN();
    if (node.i == 9) values.scalars[0] = std::numeric_limits<float>::infinity();
    return values;
  });
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  options.blank_value = 9999;
  const ConvertReport report = converted(source, options);
  EXPECT_EQ(report.blanked.by_grid, 600u);
  EXPECT_EQ(report.blanked.by_value, 200u);
  EXPECT_EQ(report.blanked.not_finite, 400u);
  EXPECT_EQ(report.splats, 4800u);
  checkCache(options.output, 4800);
  const CacheReader cache(options.output);
  EXPECT_EQ(cache.manifest().blanked_nodes, 1200u);
  EXPECT_LE(cache.manifest().variables[0].max, 1.0);
  std::set<uint64_t> is;
  for (uint32_t n = 0; n < cache.bricks().size(); ++n) {
    SplatGeometry geometry;
    std::vector<NodeRun> runs;
    cache.readGeometry(n, geometry, &runs);
    for (const NodeRun& run : runs)
      for (uint64_t i = run.i; i < run.i + run.count; ++i) is.insert(i);
  }
  for (const uint64_t i : {0, 1, 2, 5, 7, 9}) EXPECT_FALSE(is.contains(i));
  EXPECT_EQ(is.size(), 24u);
}

TEST(Convert, RefusesAGridWithNothingToDraw) {
  const TemporaryFolder folder;
  const FunctionGridSource source({gridBlock(4, 4, 4)}, 1, [](const GridNode&) {
    return NodeValues{{}, {0}, true};
  });
  EXPECT_THROW(converted(source, optionsFor(source, folder / "a.splats")), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Convert, KeepsSeveralScalarsApart) {
  const TemporaryFolder folder;
  const FunctionGridSource source = roundedBoxSource(44, 40, 40, 2);
  ConvertOptions options = optionsFor(source, folder / "both.splats");
  converted(source, options);
  checkCache(options.output, 44 * 40 * 40);
  options.output = folder / "second.splats";
  options.scalars = {1};
  converted(source, options);
  const auto both = allFilesOf(folder / "both.splats"), second = allFilesOf(folder / "second.splats");
  EXPECT_TRUE(both.at("geometry.bin") == second.at("geometry.bin"));
  EXPECT_TRUE(both.at("var.1.bin") == second.at("var.0.bin"));
}

TEST(Convert, RefusesAnOutputThatExists) {
  const TemporaryFolder folder;
  const FunctionGridSource source = roundedBoxSource(10, 10, 10);
  const ConvertOptions options = optionsFor(source, folder / "a.splats");
  converted(source, options);
  const auto before = allFilesOf(options.output);
  EXPECT_THROW(converted(source, options), Error);
  EXPECT_TRUE(allFilesOf(options.output) == before);
}

TEST(Convert, RefusesFoldersThatItCannotUse) {
  const TemporaryFolder folder;
  const FunctionGridSource source = roundedBoxSource(10, 10, 10);
  EXPECT_THROW(converted(source, optionsFor(source, folder / "none/a.splats")), Error);
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  options.temporary_folder = folder / "none";
  EXPECT_THROW(converted(source, options), Error);
  EXPECT_THROW(converted(source, optionsFor(source, "/proc/a.splats")), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Convert, LosesNothingWhenTheDiskIsFull) {
  const TemporaryFolder folder;
  const FunctionGridSource before_source = roundedBoxSource(10, 10, 10);
  converted(before_source, optionsFor(before_source, folder / "a.splats"));
  const auto before = allFilesOf(folder / "a.splats");

  const FunctionGridSource source = roundedBoxSource(24, 24, 24);
  ConvertOptions options = optionsFor(source, folder / "a.splats");
  options.overwrite = true;
  options.limits.bucket_splats = 3000;
  faults::FaultySystemCalls disk;
  {
    const ScopedSystemCalls scope(disk);
    options.output = folder / "b.splats";
    converted(source, options);
    std::filesystem::remove_all(options.output);
    options.output = folder / "a.splats";
  }
  const int64_t writes = disk.writes;
  ASSERT_GT(writes, 20);
  for (int64_t at = 0; at < writes; at += std::max<int64_t>(1, writes / (faults::isWholeSweep() ? 12 : 5))) {
    faults::FaultySystemCalls full;
    full.fail_write_at = at;
    const ScopedSystemCalls scope(full);
    EXPECT_THROW(converted(source, options), Error) << "write " << at << " of " << writes;
    EXPECT_TRUE(allFilesOf(options.output) == before);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1) << "at write " << at;
  }
  for (auto call : {&faults::FaultySystemCalls::fail_sync_at, &faults::FaultySystemCalls::fail_read_at}) {
    faults::FaultySystemCalls failing;
    failing.*call = 2;
    failing.error = EIO;
    const ScopedSystemCalls scope(failing);
    EXPECT_THROW(converted(source, options), Error);
    EXPECT_TRUE(allFilesOf(options.output) == before);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
  }
}

}  // namespace
}  // namespace curvisplat
