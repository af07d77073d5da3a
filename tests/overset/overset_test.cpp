// Overlapping blocks are counted once: the same bytes however they are converted, and nothing is lost where blocks
// only meet.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <optional>
#include <span>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/add_step.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/overset/block_owners.h"
#include "preprocess/scenes/scenes.h"
#include "preprocess/shape/covered_part.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

class Overset : public testing::Test {
 protected:
  ConvertOptions optionsFor(const std::string& name) const {
    ConvertOptions options;
    options.output = folder_ / name;
    options.overwrite = true;
    options.scalars = {0};
    options.title = "overset";
    options.surfaces = false;
    return options;
  }
  Manifest manifestOf(const std::string& name) const { return CacheReader(folder_ / name).manifest(); }

  const std::shared_ptr<const Scene> scene_ = makeScene("half-annulus");
  const TemporaryFolder folder_;
};

/// Boxes of even nodes from `lower`, with the values of a plane.
struct Box {
  glm::dvec3 lower, size;
  uint64_t nodes;
};
FunctionGridSource boxes(const std::vector<Box>& all, size_t scalars = 1, Centring centring = Centring::kNode,
                         double shift = 0) {
  std::vector<GridBlock> blocks;
  for (const Box& box : all) blocks.push_back(gridBlock(box.nodes, box.nodes, box.nodes));
  return {blocks, scalars,
          [=](const GridNode& node) {
            const Box& box = all[node.block];
            const glm::dvec3 u(node.i, node.j, node.k);
            NodeValues values{box.lower + u / static_cast<double>(box.nodes - 1) * box.size, {}, false};
            for (size_t n = 0; n < scalars; ++n)
              values.scalars.push_back(
                  static_cast<float>(values.position.x + static_cast<double>(n) * values.position.y + shift));
            return values;
          },
          centring};
}

TEST_F(Overset, TheVolumeIsThatOfTheUnion) {
  struct Case {
    const char* name;
    std::vector<Box> all;
    double volume;
  };
  const Case cases[] = {
      {"a box in a box", {{{0, 0, 0}, {4, 4, 4}, 33}, {{1.1, 1.2, 1.3}, {1.5, 1.5, 1.5}, 40}}, 64},
      {"a coarser box in a box", {{{0, 0, 0}, {4, 4, 4}, 33}, {{1.1, 1.2, 1.3}, {1.5, 1.5, 1.5}, 7}}, 64},
      {"side by side, by a half", {{{0, 0, 0}, {2, 2, 2}, 21}, {{1, 0, 0}, {2, 2, 2}, 31}}, 12},
      {"thinner than a cell", {{{0, 0, 0}, {4, 4, 4}, 9}, {{0.5, 1.2, 1.9}, {3, 2, 0.2}, 11}}, 64},
      {"twice the same", {{{0, 0, 0}, {2, 2, 2}, 21}, {{0, 0, 0}, {2, 2, 2}, 21}}, 8},
      {"three on one another",
       {{{0, 0, 0}, {4, 4, 4}, 21}, {{1, 1, 1}, {2, 2, 2}, 21}, {{1.5, 1.5, 1.5}, {1, 1, 1}, 21}},
       64}};
  for (const Centring centring : {Centring::kNode, Centring::kCell})
    for (const auto& [name, all, volume] : cases) {
      const ConvertReport owned = converted(boxes(all, 1, centring), optionsFor("owned.splats"));
      std::printf("%s: %g, of %g\n", name, owned.volume, volume);
      EXPECT_NEAR(owned.volume, volume, 0.01 * volume) << name;
      EXPECT_EQ(manifestOf("owned.splats").overlap, "owner");
      ASSERT_EQ(owned.notes.size(), 1u);
      expectSays(owned.notes[0], "--overlap all");
      EXPECT_TRUE(owned.warnings.empty());
      ConvertOptions options = optionsFor("all.splats");
      options.overlap = Overlap::kAll;
      const ConvertReport every = converted(boxes(all, 1, centring), options);
      EXPECT_GT(every.volume, owned.volume * 1.01) << name;
      EXPECT_EQ(manifestOf("all.splats").overlap, "all");
      EXPECT_EQ(every.warnings.size(), 1u);
    }
}

TEST_F(Overset, BlocksThatAbutLoseNothing) {
  const FunctionGridSource source =
      boxes({{{0, 0, 0}, {1, 1, 1}, 9}, {{1, 0, 0}, {1, 1, 1}, 14}, {{0, 1, 0}, {2, 1, 1}, 6}});
  const ConvertReport owned = converted(source, optionsFor("owner.splats"));
  EXPECT_TRUE(owned.notes.empty());
  EXPECT_EQ(manifestOf("owner.splats").overlap, "none");
  ConvertOptions options = optionsFor("all.splats");
  options.overlap = Overlap::kAll;
  converted(source, options);
  Files of_owner = filesOf(folder_ / "owner.splats"), of_all = filesOf(folder_ / "all.splats");
  for (const auto& [name, bytes] : of_all)
    if (name != "manifest.json") {
      EXPECT_TRUE(of_owner.at(name) == bytes) << name;
    }
  converted(boxes({{{0, 0, 0}, {1, 1, 1}, 9}}), optionsFor("one.splats"));
  EXPECT_EQ(manifestOf("one.splats").overlap, "");
}

/// Counts the windows that are read.
class CountedReads : public FunctionGridSource {
 public:
  using FunctionGridSource::FunctionGridSource;
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    ++reads_;
    FunctionGridSource::read(block, box, scalars, out);
  }
  uint64_t reads() const { return reads_; }

 private:
  mutable std::atomic<uint64_t> reads_{0};
};

// A set of blocks may name one file thousands of times. A block is compared with the first, which owns all of it.
TEST_F(Overset, ABlockManyTimesIsComparedOnce) {
  constexpr uint32_t kBlocks = 400, kPartners = 16;  // as many as findOverlaps() finds
  const GridBlock block = gridBlock(5, 5, 5);
  const CountedReads source(std::vector<GridBlock>(kBlocks, block), 1, [](const GridNode& node) {
    return NodeValues{glm::dvec3(node.i, node.j, node.k), {1.0f}, false};
  });
  std::vector<BlockOverlap> overlaps;
  for (uint32_t first = 0; first < kPartners; ++first)
    for (uint32_t second = first + 1; second < kBlocks; ++second) overlaps.push_back({first, second, 64, 1});
  const NodeReader reader(source, {0}, std::nullopt);
  BlockOwners owners(reader, overlaps, 40 << 10);  // some trees at a time
  SlabStream slabs(reader, 1 << 20, {1, 1});
  std::vector<uint64_t> covered;
  while (const LoadedSlab* loaded = slabs.next()) {
    owners.cover(*loaded, covered);
    const uint64_t expected = loaded->slab.block == 0 ? 0 : kAllCovered;
    for (const uint64_t of_sample : covered) ASSERT_EQ(of_sample, expected) << loaded->slab.block;
  }
  EXPECT_LE(source.reads(), 4 * kBlocks);
}

// Every splat's plane is the field's.
TEST_F(Overset, PartsOfCellsKeepALinearField) {
  const FunctionGridSource source =
      boxes({{{0, 0, 0}, {4, 4, 4}, 17}, {{1.1, 1.2, 1.3}, {1.5, 1.5, 1.5}, 31}});
  converted(source, optionsFor("linear.splats"));
  const CacheReader cache(folder_ / "linear.splats");
  size_t parts = 0;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
    if (!cache.bricks()[brick].isLeaf()) continue;
    SplatGeometry geometry;
    SplatVariable variable;
    cache.readGeometry(brick, geometry, nullptr);
    cache.readVariable(brick, 0, variable);
    const glm::dvec3 origin = cache.manifest().root.cellMin(cache.bricks()[brick].cell);
    for (size_t n = 0; n < geometry.size(); ++n) {
      const double full = double{geometry.axis0[n]} * geometry.axis1[n] * geometry.axis2[n];
      parts += std::abs(geometry.weight[n] / full - 1) > 0.1;
      EXPECT_NEAR(variable.mean[n], origin.x + geometry.x[n], 2e-3);
    }
  }
  EXPECT_GT(parts, 20u);
}

TEST_F(Overset, BytesDependNeitherOnThreadsNorMemoryNorRanks) {
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    const FunctionGridSource grid =
        oversetGrid(scene_, gridBlock(40, 24, 24), boxesInHalfAnnulus(3, 20), centring);
    // A byte for owners: a few rows at a time.
    expectSameCaches(grid, optionsFor("one.splats"),
                     {{.threads = 1}, {.memory_bytes = uint64_t{200} << 20, .owner_bytes = 1}, {.ranks = 3}});
  }
}

TEST_F(Overset, AScalarIsAddedAsIfItHadBeenConverted) {
  const std::vector<Box> all{{{0, 0, 0}, {4, 4, 4}, 17}, {{1.1, 1.2, 1.3}, {1.5, 1.5, 1.5}, 31}};
  const FunctionGridSource source = boxes(all, 2);
  ConvertOptions options = optionsFor("both.splats");
  options.scalars = {0, 1};
  converted(source, options);
  converted(source, optionsFor("added.splats"));
  AddScalarOptions adding;
  adding.cache = folder_ / "added.splats";
  adding.scalars = {1};
  Progress progress;
  addScalars(source, adding, progress);
  const Files expected = filesOf(folder_ / "both.splats"), found = filesOf(folder_ / "added.splats");
  for (const char* name : {"geometry.bin", "var.0.bin", "var.1.bin"})
    EXPECT_TRUE(found.at(name) == expected.at(name)) << name;
}

TEST_F(Overset, AStepSharesTheGeometry) {
  const std::vector<Box> all{{{0, 0, 0}, {4, 4, 4}, 17}, {{1.1, 1.2, 1.3}, {1.5, 1.5, 1.5}, 31}};
  converted(boxes(all), optionsFor("steps.splats"));
  AddStepOptions adding;
  adding.cache = folder_ / "steps.splats";
  Progress progress;
  EXPECT_FALSE(addStep(boxes(all, 1, Centring::kNode, 3), adding, progress).new_geometry);
  std::vector<Box> moved = all;
  moved[1].lower.x += 0.3;
  EXPECT_TRUE(addStep(boxes(moved), adding, progress).new_geometry);
  const CacheReader cache(folder_ / "steps.splats");
  EXPECT_NEAR(cache.atStep(2).manifest().volume, 64, 0.64);
}

/// Two boxes, of which the finer one's outer nodes say that they were interpolated.
class FringedBoxes : public FunctionGridSource {
 public:
  FringedBoxes() : FunctionGridSource(boxes({{{0, 0, 0}, {4, 4, 4}, 17}, {{1, 1, 1}, {2, 2, 2}, 21}})) {}
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    const GridBlock& of = description().blocks[block];
    out.assign(of.ni * (box.j1 - box.j0) * (box.k1 - box.k0), 0);
    const auto is_outer = [&](uint64_t n) { return n < 4 || n + 4 >= of.ni; };
    size_t at = 0;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < of.ni; ++i, ++at)
          out[at] = block == 1 && (is_outer(i) || is_outer(j) || is_outer(k));
    return true;
  }
};

TEST_F(Overset, AFringeIsDrawnByTheBlockThatItWasInterpolatedFrom) {
  const ConvertReport fringed = converted(FringedBoxes(), optionsFor("fringed.splats"));
  EXPECT_NEAR(fringed.volume, 64, 0.64);
  const CacheReader cache(folder_ / "fringed.splats");
  uint64_t of_fine = 0;
  std::vector<NodeRun> runs;
  SplatGeometry geometry;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
    if (!cache.bricks()[brick].isLeaf()) continue;
    cache.readGeometry(brick, geometry, &runs);
    for (const NodeRun& run : runs) {
      if (run.block != 1) continue;
      of_fine += run.count;
      EXPECT_TRUE(run.i >= 4 && run.i + run.count <= 17);
    }
  }
  EXPECT_EQ(of_fine, 13u * 13 * 13);
}

/// A grid without scalars, with its nodes' x as one.
class WithX : public GridSource {
 public:
  explicit WithX(const std::filesystem::path& path) {
    OpenGridOptions options;
    options.grid = path;
    source_ = openGrid(options);
    description_ = source_->description();
    description_.scalars = {{"x", "", {}}};
  }
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    source_->read(block, box, {}, out);
    out.scalars.assign(scalars.size(), std::vector<float>(out.x.begin(), out.x.end()));
  }

 private:
  std::unique_ptr<GridSource> source_;
  GridDescription description_;
};

// The same cylinder with blocks that abut, and with blocks that overlap.
TEST_F(Overset, ARealGridHasTheVolumeOfItsDomain) {
  const std::filesystem::path folder = std::filesystem::path(CURVISPLAT_SHARED_DATA) / "overset";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "needs " << folder;
  const WithX abutting(folder / "cylinder_chimera_abutting.x");
  const WithX overlapping(folder / "cylinder_chimera_overlapping_singledonor.x");
  const ConvertReport expected = converted(abutting, optionsFor("abutting.splats"));
  EXPECT_TRUE(expected.notes.empty());
  const ConvertReport owned = converted(overlapping, optionsFor("owned.splats"));
  ConvertOptions options = optionsFor("all.splats");
  options.overlap = Overlap::kAll;
  const ConvertReport all = converted(overlapping, options);
  std::printf("abutting %g, owners %g, all %g; %s\n", expected.volume, owned.volume, all.volume,
              owned.notes.at(0).c_str());
  EXPECT_NEAR(owned.volume, expected.volume, 1e-3 * expected.volume);
  EXPECT_GT(all.volume, 1.003 * expected.volume);
}

}  // namespace
}  // namespace curvisplat
