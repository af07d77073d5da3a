// Grids whose rows do not fit in a slab: caches have the bytes that slabs of whole rows give.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/add_step.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/grid_origin.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/faces/grid_faces_pass.h"
#include "preprocess/scenes/scenes.h"
#include "preprocess/splats/cell_splats.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/error.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/grid_nodes.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

constexpr float kMissing = 9999;

class CutRows : public testing::Test {
 protected:
  ConvertOptions optionsFor(const std::string& name, const GridSource& source) const {
    ConvertOptions options;
    options.output = folder_ / name;
    options.overwrite = true;
    options.title = "rows";
    options.planes = {{std::nullopt, 0, 2}, {std::nullopt, 2, 1}};
    for (uint32_t n = 0; n < source.description().scalars.size(); ++n) options.scalars.push_back(n);
    return options;
  }

  static uint64_t bytesFor(uint64_t window_nodes, size_t scalars) {
    return window_nodes * slabBytesPerNode(scalars);
  }

  /// The number of parts into which rows are cut, at most.
  static size_t partsOfRows(const GridSource& source, uint64_t window_nodes) {
    const bool cells = source.description().scalars.front().centring == Centring::kCell;
    size_t most = 0, parts = 0;
    for (const Slab& slab :
         cutIntoSlabs(source.description().blocks, window_nodes, cells ? kCellSplatHalo : kNodeSplatHalo)) {
      parts = slab.box.i0 == 0 ? 1 : parts + 1;
      most = std::max(most, parts);
    }
    return most;
  }

  /// `windows`: usually the first alone is tried.
  void expectSameBytes(const GridSource& source, std::initializer_list<uint64_t> windows,
                       std::optional<uint64_t> owner_bytes = {}) const {
    const ConvertOptions options = optionsFor("rows.splats", source);
    std::vector<Variation> cut;
    for (const uint64_t window : windows) {
      ASSERT_GT(partsOfRows(source, window), 2u) << window;
      cut.push_back({.threads = static_cast<unsigned>(1 + window % 2),
                     .slab_bytes = bytesFor(window, options.scalars.size()),
                     .owner_bytes = owner_bytes});
      if (!faults::isWholeSweep()) break;
    }
    expectSameCaches(source, options, cut);
  }

  const TemporaryFolder folder_;
};

/// A thin tube that closes on itself across, of uneven cells along it: `ni` nodes long.
FunctionGridSource tube(uint64_t ni, uint64_t nj, uint64_t nk) {
  return {{gridBlock(ni, nj, nk)}, 2, [=](const GridNode& node) {
            const auto i = static_cast<double>(node.i);
            const double angle =
                2 * std::numbers::pi * static_cast<double>(node.j % (nj - 1)) / static_cast<double>(nj - 1);
            const double radius = 1 + 0.3 * static_cast<double>(node.k) + 0.1 * std::sin(0.05 * i);
            NodeValues values;
            values.position = {0.2 * (i + 0.3 * std::sin(1.7 * i)), radius * std::cos(angle),
                               radius * std::sin(angle)};
            values.scalars = {static_cast<float>(std::sin(0.1 * i) + radius), static_cast<float>(angle)};
            values.blank = node.i % 97 == 50 && node.j < 3;
            return values;
          }};
}

/// Abutting blocks of unlike cells, that end at one another along i and along j, one apart; blanked nodes near the cuts.
FunctionGridSource unlikeBlocks(Centring centring) {
  return FunctionGridSource(
      {gridBlock(90, 12, 11), gridBlock(60, 12, 11), gridBlock(90, 6, 11), gridBlock(9, 8, 7)}, 2,
      [](const GridNode& node) {
        const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j);
        NodeValues values;
        double x = i, y = j;
        if (node.block == 1) x = 89 + 1.4 * i;
        if (node.block == 2) y = 11 + 1.3 * j;
        if (node.block == 3) x = 400 + i;
        const auto z = static_cast<double>(node.k);
        values.position = {x + 0.2 * std::sin(y), y, z + 0.002 * x * y};
        values.scalars = {static_cast<float>(std::sin(0.1 * x) + y), static_cast<float>(x * z)};
        if (node.i % 17 == 3 && node.k > 6) values.scalars[0] = kMissing;
        values.blank = node.block == 1 && node.i % 13 == 5 && node.j > 2 && node.j < 6 && node.k < 9;
        return values;
      },
      centring);
}

TEST_F(CutRows, OfAThinGridGiveTheBytesOfWholeRows) {
  expectSameBytes(tube(1200, 2 + 4, 2), {801, 400, 4000});
}

TEST_F(CutRows, OfAPeriodicGridGiveTheBytesOfWholeRows) {
  expectSameBytes(SceneGridSource(makeScene("wake"), {120, 20, 14}), {2001});
}

TEST_F(CutRows, OfBlocksWithSeamsAndBlanksGiveTheBytesOfWholeRows) {
  expectSameBytes(unlikeBlocks(Centring::kNode), {1200, 2001, 4000});
}

TEST_F(CutRows, OfCellsGiveTheBytesOfWholeRows) {
  expectSameBytes(unlikeBlocks(Centring::kCell), {2001, 1200});
}

TEST_F(CutRows, OfOverlappingBlocksGiveTheBytesOfWholeRows) {
  for (const Centring centring : {Centring::kNode, Centring::kCell})
    if (centring == Centring::kNode || faults::isWholeSweep())
      expectSameBytes(
          oversetGrid(makeScene("half-annulus"), gridBlock(300, 8, 8), boxesInHalfAnnulus(3, 9), centring),
          {3000}, 1);
}

TEST_F(CutRows, AreSharedByRanks) {
  for (const Centring centring : {Centring::kCell, Centring::kNode}) {
    if (centring == Centring::kNode && !faults::isWholeSweep()) break;
    const FunctionGridSource source = unlikeBlocks(centring);
    const uint64_t slab_bytes = bytesFor(1500, 2);
    for (const unsigned ranks : {5u, 2u})
      if (ranks == 5 || faults::isWholeSweep())
        expectSameCaches(source, optionsFor("ranks.splats", source),
                         {{.threads = 1, .slab_bytes = slab_bytes, .ranks = ranks}});
  }
}

TEST_F(CutRows, TakeAFurtherScalarAsWholeOnesDo) {
  for (const Centring centring : {Centring::kNode, Centring::kCell})
    for (const bool blanks : {false, true}) {  // of the older scalar, which the cache alone knows
      if (blanks != (centring == Centring::kNode) && !faults::isWholeSweep()) continue;
      const FunctionGridSource source = unlikeBlocks(centring);
      ConvertOptions options = optionsFor("first.splats", source);
      options.scalars = {0};
      if (blanks) options.blank_value = kMissing;
      converted(source, options);
      AddScalarOptions adding;
      adding.cache = folder_ / "added.splats";
      adding.scalars = {1};
      expectSameAdditions(source, options.output, adding, {{.slab_bytes = bytesFor(1500, 1)}});
      EXPECT_TRUE(std::filesystem::exists(adding.cache / "var.1.bin"));
    }
}

TEST_F(CutRows, OfAStepAreRecognisedAsTheSameGeometry) {
  const FunctionGridSource source = unlikeBlocks(Centring::kNode);
  ConvertOptions options = optionsFor("steps.splats", source);
  options.surfaces = false;
  options.planes = {};
  converted(source, options);
  AddStepOptions adding;
  adding.cache = options.output;
  adding.limits.slab_bytes = bytesFor(1500, 2);
  Progress progress;
  EXPECT_FALSE(addStep(source, adding, progress).new_geometry);
  const FunctionGridSource moved(source.description().blocks, 2, [&](const GridNode& node) {
    const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j);
    return NodeValues{{i + 500.0 * node.block, j + 1e-3 * i, static_cast<double>(node.k)}, {1, 2}, false};
  });
  EXPECT_TRUE(addStep(moved, adding, progress).new_geometry);
}

TEST_F(CutRows, HaveTheChecksumOfWholeRows) {
  const FunctionGridSource source = unlikeBlocks(Centring::kNode);
  const NodeReader reader(source, {0}, std::nullopt);
  const auto checksum = [&](uint64_t window, Halo halo) {
    GridChecksum sum;
    SlabStream slabs(reader, bytesFor(window, 1), halo);
    while (const LoadedSlab* loaded = slabs.next())
      sum.add(*loaded, source.description().blocks[loaded->slab.block]);
    return sum.value();
  };
  const uint64_t whole = checksum(1 << 20, kNoHalo);
  for (const uint64_t window : {7u, 89u}) EXPECT_EQ(checksum(window, kNoHalo), whole) << window;
  for (const uint64_t window : {1200u, 6000u}) EXPECT_EQ(checksum(window, kNodeSplatHalo), whole) << window;
  // A share of slabs has whole rows.
  for (const unsigned count : {2u, 7u}) {
    uint64_t sum = 0;
    for (unsigned index = 0; index < count; ++index) {
      GridChecksum of_share;
      SlabStream slabs(reader, bytesFor(40, 1), kNoHalo, {index, count, true});
      while (const LoadedSlab* loaded = slabs.next())
        of_share.add(*loaded, source.description().blocks[loaded->slab.block]);
      sum += of_share.value();
    }
    EXPECT_EQ(sum, whole) << count;
  }
}

TEST_F(CutRows, AreTakenFromWholeOnesByDefault) {
  expectPartsOfRows(unlikeBlocks(Centring::kNode));
  expectPartsOfRows(unlikeBlocks(Centring::kCell));
}

TEST_F(CutRows, OfASourceThatReadsWholeOnesAreRefusedWithASufficientSize) {
  class Parts : public FunctionGridSource {
   public:
    using FunctionGridSource::FunctionGridSource;
    uint64_t rowsInMemory(std::span<const uint32_t>) const override { return 0; }
  };
  const auto none = [](const GridNode&) { return NodeValues{}; };
  const std::vector<GridBlock> blocks{gridBlock(10, 10, 10), gridBlock(3'000'000, 3, 3)};
  constexpr uint64_t kMiB = 1 << 20;
  EXPECT_NO_THROW(GridOrigin::requireMemory(Parts(blocks, 1, none), {0}, MemoryPlan::of(160 * kMiB, 1, 2)));

  const FunctionGridSource rows(blocks, 1, none);
  ConvertOptions options = optionsFor("refused.splats", rows);
  options.memory_bytes = 256 * kMiB;
  const std::string error = errorOf([&] { converted(rows, options); });
  const std::string before =
      "a row of 3000000 nodes along i does not fit, and this format is read by whole rows; give at least ";
  ASSERT_NE(error.find(before), std::string::npos) << error;
  const uint64_t least = std::stoull(error.substr(error.find(before) + before.size()));
  EXPECT_NO_THROW(GridOrigin::requireMemory(rows, {0}, MemoryPlan::of(least * kMiB, 1, 2)));
  EXPECT_THROW(GridOrigin::requireMemory(rows, {0}, MemoryPlan::of((least - 2) * kMiB, 1, 2)), Error);
}

TEST_F(CutRows, TakeFacesThatDoNotFitAndAreRefusedWithASufficientSize) {
  constexpr uint64_t kMiB = 1 << 20;
  GridDescription long_block, large;
  long_block.blocks = {gridBlock(6'000'000, 2, 2)};
  large.blocks = {gridBlock(4000, 4000, 4000)};
  const auto require = [&](uint64_t mebibytes) {
    MemoryPlan::of(mebibytes * kMiB, 1, 2).requireFaces(memoryOfFaces(long_block, {}));
  };
  std::string error;
  try {
    require(160);
  } catch (const Error& thrown) {
    error = thrown.what();
  }
  const std::string before = "give at least ";
  ASSERT_NE(error.find(before), std::string::npos) << error;
  const uint64_t least = std::stoull(error.substr(error.find(before) + before.size()));
  EXPECT_NO_THROW(require(least));
  EXPECT_THROW(require(least - 2), Error);
  EXPECT_LT(memoryOfFaces(large, {}), 16 * kMiB);
}

}  // namespace
}  // namespace curvisplat
