// Every layout is written, detected and read back; what does not fit, or fits twice, is refused.
#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

using namespace test;

struct WrittenLayout {
  Plot3dLayout layout;  // of the grid
  uint64_t subrecord_bytes = 0;
};

std::vector<WrittenLayout> everyBinaryLayout() {
  std::vector<WrittenLayout> all;
  for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig})
    for (const auto& [records, subrecord] : {std::pair{RecordMarkers::kNone, 0u},
                                             {RecordMarkers::kBytes4, 0u},
                                             {RecordMarkers::kBytes8, 0u},
                                             {RecordMarkers::kBytes4, 101u}})
      for (const int precision : {4, 8})
        for (const bool multi : {false, true})
          for (const bool blanking : {false, true})
            all.push_back(
                {{Plot3dKind::kGrid, false, order, records, precision, multi, blanking}, subrecord});
  return all;
}

Plot3dLayout as(Plot3dKind kind, Plot3dLayout layout) {
  layout.kind = kind;
  if (kind != Plot3dKind::kGrid) layout.blanking = false;
  return layout;
}

std::vector<TestBlock> blocksFor(const Plot3dLayout& layout, uint32_t components) {
  std::vector<TestBlock> blocks = {testBlock(7, 5, 6, components)};
  if (!layout.multi_block) return blocks;
  blocks.push_back(testBlock(4, 9, 3, components, 10));
  blocks.push_back(testBlock(6, 2, 5, components, -4));
  return blocks;
}

OpenGridOptions openOptionsFor(const TestFolder& folder, const std::string& grid,
                               const std::vector<std::string>& solutions = {}) {
  OpenGridOptions options;
  options.grid = folder.path() / grid;
  for (const std::string& solution : solutions) options.solutions.push_back(folder.path() / solution);
  options.temporary_folder = folder.path();
  return options;
}

std::string layoutError(const OpenGridOptions& options) {
  return curvisplat::errorOf([&] { openGrid(options); });
}

/// Scalars by their numbers in the source, and what was written.
struct WrittenScalars {
  std::vector<uint32_t> numbers;
  std::vector<const std::vector<double>*> values;
};

/// Reads `box` and compares every node with what was written.
void expectBox(const GridSource& source, uint32_t b, const NodeBox& box, const TestBlock& block,
               bool blanking, const WrittenScalars& written = {}) {
  const auto& [scalars, expected] = written;
  NodeArrays nodes;
  source.read(b, box, scalars, nodes);
  ASSERT_EQ(nodes.scalars.size(), scalars.size());
  size_t n = 0;
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = 0; i < block.ni; ++i, ++n) {
        const size_t from = (k * block.nj + j) * block.ni + i;
        ASSERT_EQ(nodes.x[n], block.coordinates[0][from]);
        ASSERT_EQ(nodes.y[n], block.coordinates[1][from]);
        ASSERT_EQ(nodes.z[n], block.coordinates[2][from]);
        ASSERT_EQ(nodes.blank[n], blanking && block.iblank[from] == 0);
        for (size_t s = 0; s < scalars.size(); ++s) ASSERT_EQ(nodes.scalars[s][n], (*expected[s])[from]);
      }
  ASSERT_EQ(nodes.x.size(), n);
  ASSERT_EQ(nodes.blank.size(), n);
}

/// Grid, Q and function file of one layout through openGrid: the layouts in words, and all values.
void expectRoundTrip(const TestFolder& folder, const Plot3dLayout& layout,
                     const std::vector<TestBlock>& q_blocks, const std::vector<TestBlock>& function_blocks) {
  const auto source = openGrid(openOptionsFor(folder, "a.xyz", {"a.q", "a.fun"}));
  const GridDescription& description = source->description();
  EXPECT_EQ(
      description.format,
      fmt::format("PLOT3D grid a.xyz: {}; Q solution a.q: {}; function file a.fun: {}", describe(layout),
                  describe(as(Plot3dKind::kQ, layout)), describe(as(Plot3dKind::kFunction, layout))));
  EXPECT_TRUE(description.warnings.empty());
  ASSERT_EQ(description.blocks.size(), q_blocks.size());
  ASSERT_EQ(description.scalars.size(), 7u);
  ASSERT_EQ(description.flow.size(), q_blocks.size());
  EXPECT_EQ(description.flow.back().reynolds, 1e5);
  for (uint32_t b = 0; b < q_blocks.size(); ++b) {
    const TestBlock& block = q_blocks[b];
    EXPECT_EQ(description.blocks[b].ni, block.ni);
    const auto& q = block.components;
    const std::vector<const std::vector<double>*> expected = {&function_blocks[b].components[1], &q[4],
                                                              &q[0]};
    for (const NodeBox& box : {NodeBox{0, block.nj, 0, block.nk}, NodeBox{1, block.nj, 1, 3},
                               NodeBox{0, 1, 0, 2}, NodeBox{0, block.nj, 2, 2}})
      ASSERT_NO_FATAL_FAILURE(expectBox(*source, b, box, block, layout.blanking, {{6, 4, 0}, expected}));
  }
}

TEST(Plot3dLayouts, EveryBinaryLayoutIsDetectedAndReadBack) {
  const TestFolder folder("layouts");
  for (const auto& [layout, subrecord] : everyBinaryLayout()) {
    SCOPED_TRACE(fmt::format("{}, subrecords of {}", describe(layout), subrecord));
    const auto q_blocks = blocksFor(layout, 5), function_blocks = blocksFor(layout, 2);
    folder.write("a.xyz", plot3dBytes(layout, q_blocks, subrecord));
    folder.write("a.q", plot3dBytes(as(Plot3dKind::kQ, layout), q_blocks, subrecord));
    folder.write("a.fun", plot3dBytes(as(Plot3dKind::kFunction, layout), function_blocks, subrecord));
    ASSERT_NO_FATAL_FAILURE(expectRoundTrip(folder, layout, q_blocks, function_blocks));
  }
}

TEST(Plot3dLayouts, EveryTextLayoutIsDetectedAndReadBack) {
  const TestFolder folder("texts");
  for (const bool multi : {false, true})
    for (const bool blanking : {false, true}) {
      const Plot3dLayout layout{Plot3dKind::kGrid, true, ByteOrder::kLittle, RecordMarkers::kNone, 8, multi,
                                blanking};
      SCOPED_TRACE(describe(layout));
      const auto q_blocks = blocksFor(layout, 5), function_blocks = blocksFor(layout, 2);
      folder.write("a.xyz", plot3dText(layout, q_blocks));
      folder.write("a.q", plot3dText(as(Plot3dKind::kQ, layout), q_blocks));
      folder.write("a.fun", plot3dText(as(Plot3dKind::kFunction, layout), function_blocks));
      ASSERT_NO_FATAL_FAILURE(expectRoundTrip(folder, layout, q_blocks, function_blocks));
      // Nothing is left of the spools.
      EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 3);
    }
}

// sin(pi) and products of it, as programs in double precision leave them where a grid touches an axis.
TEST(Plot3dLayouts, RoundingErrorsOfZeroAreNoNoise) {
  const TestFolder folder("rounding");
  for (const auto& [layout, subrecord] : everyBinaryLayout()) {
    if (layout.precision_bytes != 8) continue;
    SCOPED_TRACE(describe(layout));
    auto blocks = blocksFor(layout, 5);
    for (TestBlock& block : blocks)
      for (size_t n = 0; n < block.coordinates[1].size(); ++n)
        if (n % 2 == 0) block.coordinates[1][n] = n % 4 == 0 ? 1e-48 : -3e-65;
    folder.write("a.xyz", plot3dBytes(layout, blocks, subrecord));
    const auto source = openGrid(openOptionsFor(folder, "a.xyz", {}));
    EXPECT_EQ(source->description().format, fmt::format("PLOT3D grid a.xyz: {}", describe(layout)));
  }
}

TEST(Plot3dLayouts, ForcingEverythingReadsTheSame) {
  const TestFolder folder("forced");
  for (const auto& [layout, subrecord] : everyBinaryLayout()) {
    const auto blocks = blocksFor(layout, 5);
    folder.write("a.xyz", plot3dBytes(layout, blocks, subrecord));
    OpenGridOptions options = openOptionsFor(folder, "a.xyz");
    options.force = {
        false,          layout.byte_order, layout.records, layout.precision_bytes, layout.multi_block,
        layout.blanking};
    const auto source = openGrid(options);
    ASSERT_NO_FATAL_FAILURE(expectBox(*source, 0, {0, 5, 0, 6}, blocks[0], layout.blanking));
  }
}

TEST(Plot3dLayouts, ForcingAnythingElseIsRefusedAndTheLayoutNamed) {
  const TestFolder folder("forced-wrongly");
  const Plot3dLayout layout{Plot3dKind::kGrid, false, ByteOrder::kBig, RecordMarkers::kBytes4, 4, true, true};
  folder.write("a.xyz", plot3dBytes(layout, blocksFor(layout, 0)));
  Plot3dForce wrong[6];
  wrong[0].ascii = true;
  wrong[1].byte_order = ByteOrder::kLittle;
  wrong[2].records = RecordMarkers::kBytes8;
  wrong[3].precision_bytes = 8;
  wrong[4].multi_block = false;
  wrong[5].blanking = false;
  for (const Plot3dForce& force : wrong) {
    OpenGridOptions options = openOptionsFor(folder, "a.xyz");
    options.force = force;
    const std::string error = layoutError(options);
    EXPECT_NE(error, "");
    if (force.ascii) continue;
    expectSays(error, describe(layout));
  }
}

TEST(Plot3dLayouts, ThreadsReadAtOnce) {
  const TestFolder folder("threads");
  const Plot3dLayout layout{Plot3dKind::kGrid, false, ByteOrder::kBig, RecordMarkers::kBytes4, 4, true, true};
  const auto blocks = blocksFor(layout, 5);
  folder.write("a.xyz", plot3dBytes(layout, blocks, 101));
  const auto source = openGrid(openOptionsFor(folder, "a.xyz"));
  std::vector<std::thread> threads;
  for (uint32_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (uint32_t n = 0; n < 50; ++n) {
        const uint32_t b = (n + t) % 3;
        expectBox(*source, b, {0, blocks[b].nj, n % blocks[b].nk, blocks[b].nk}, blocks[b], true);
      }
    });
  for (std::thread& thread : threads) thread.join();
}

/// Small sizes make coincidences between layouts likely.
TEST(Plot3dLayouts, AreNeverMistakenForOneAnother) {
  const TestFolder folder("small");
  std::mt19937_64 random(7);
  const auto layouts = everyBinaryLayout();
  int detected = 0, ambiguous = 0;
  for (int n = 0; n < 600; ++n) {
    const auto& [layout, subrecord] = layouts[random() % layouts.size()];
    std::vector<TestBlock> blocks;
    for (uint64_t b = 0; b < (layout.multi_block ? 1 + random() % 4 : 1); ++b)
      blocks.push_back(testBlock(1 + random() % 4, 1 + random() % 4, 1 + random() % 4, 5));
    folder.write("a.xyz", plot3dBytes(layout, blocks, subrecord));
    try {
      const auto source = openGrid(openOptionsFor(folder, "a.xyz"));
      ++detected;
      EXPECT_EQ(source->description().format, "PLOT3D grid a.xyz: " + describe(layout));
    } catch (const Error& error) {
      ++ambiguous;
      expectSays(error.what(), "equally well");
    }
  }
  EXPECT_GT(detected, 590) << ambiguous;
}

// One block of 1x1x2 nodes in single precision, and a single-block 1x1x1 node in double precision with
// iblank, are both 40 bytes.
TEST(Plot3dLayouts, TwoThatFitEquallyWellAreNamedWithTheOptionsThatDecide) {
  const TestFolder folder("ambiguous");
  Bytes file;
  for (const int32_t n : {1, 1, 1, 2}) appendNumber(file, n, ByteOrder::kLittle);
  for (const float value : {1.f, 1.f, 1.f, 1.f, 1.f, 0.f}) appendNumber(file, value, ByteOrder::kLittle);
  folder.write("a.xyz", file);
  OpenGridOptions options = openOptionsFor(folder, "a.xyz");
  const std::string error = layoutError(options);
  for (const char* part : {"a.xyz: fits 2 layouts equally well", "1 block of 1x1x1", "1 block of 1x1x2",
                           "--precision, --blocks, --iblank"})
    expectSays(error, part);
  options.force.multi_block = true;
  EXPECT_EQ(openGrid(options)->description().blocks[0].nk, 2u);
  options.force = {};
  options.force.precision_bytes = 8;
  EXPECT_EQ(openGrid(options)->description().blocks[0].nk, 1u);
}

}  // namespace
}  // namespace curvisplat
