// Conversion of refined grids: what is drawn is what the grid itself has.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/convert.h"
#include "preprocess/grid/refined_source.h"
#include "preprocess/scenes/scenes.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/function_grid.h"
#include "tests/support/folder_files.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMemory = uint64_t{512} << 20;

class RefinedConvert : public testing::Test {
 protected:
  ConvertReport convertTo(const std::string& name, const GridSource& source, ConvertOptions options = {}) {
    options.output = folder_ / name;
    options.memory_bytes = kMemory;
    options.title = "a grid";
    if (options.scalars.empty()) options.scalars = {0};
    Progress progress;
    return convert(source, options, progress);
  }
  Files files(const std::string& name) const { return filesOf(folder_ / name); }

  const TemporaryFolder folder_;
};

std::unique_ptr<GridSource> duct() {
  return std::make_unique<SceneGridSource>(makeScenes("duct"), SceneGridSize{9, 7, 6}, 4);
}

/// Half a pipe of two blocks: the first's last i is the second's first j, and k runs the other way. No scalar has a value in a
/// corner of the first block.
std::unique_ptr<GridSource> pipe(Centring centring = Centring::kNode) {
  return std::make_unique<FunctionGridSource>(
      std::vector{gridBlock(7, 5, 6), gridBlock(5, 8, 6)}, 2,
      [](const GridNode& node) {
        const bool first = node.block == 0;
        const auto turn = static_cast<double>(first ? node.i : 6 + node.j) / 13 * std::numbers::pi;
        const auto radius = 1 + std::pow(static_cast<double>(first ? node.j : node.i), 1.5) / 8;
        const auto z = static_cast<double>(first ? node.k : 5 - node.k) / 5;
        NodeValues values;
        values.position = {radius * std::cos(turn), radius * std::sin(turn), z};
        values.scalars = {static_cast<float>(radius + z), static_cast<float>(std::sin(3 * turn) * z)};
        if (first && node.i < 2 && node.j < 2)
          values.scalars[0] = values.scalars[1] = std::numeric_limits<float>::quiet_NaN();
        return values;
      },
      centring);
}

TEST_F(RefinedConvert, HasTheVolumeOfTheGrid) {
  for (const auto& [name, open] : {std::pair{"duct", std::function([] { return duct(); })},
                                   std::pair{"nodes", std::function([] { return pipe(); })},
                                   std::pair{"cells", std::function([] { return pipe(Centring::kCell); })}}) {
    SCOPED_TRACE(name);
    const ConvertReport whole = convertTo(std::string(name) + "1", *open());
    uint64_t nodes = whole.nodes;
    for (const uint32_t parts : {2u, 3u}) {
      const std::string fine = name + std::to_string(parts);
      const ConvertReport report = convertTo(fine, *refined(open(), parts));
      // Splats of curved cells fall short of their volume by the square of the cells' length.
      EXPECT_NEAR(report.volume / whole.volume, 1, std::string(name) == "duct" ? 1e-3 : 2e-2);
      EXPECT_GT(report.nodes, nodes);
      EXPECT_EQ(report.degenerate, 0u);
      EXPECT_EQ(CacheReader(folder_ / fine).manifest().refined, parts);
      nodes = report.nodes;
    }
  }
}

TEST_F(RefinedConvert, MergesTheNewNodesOfJoints) {
  const uint32_t parts = 4;
  EXPECT_EQ(convertTo("1", *pipe()).merged_nodes, 5u * 6);
  EXPECT_EQ(convertTo("4", *refined(pipe(), parts)).merged_nodes, (4 * parts + 1) * (5 * parts + 1));
}

TEST_F(RefinedConvert, HasTheSameBytesForAnyThreadsAndMemory) {
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    ConvertOptions options;
    options.threads = 1;
    options.overwrite = true;
    convertTo("one", *refined(pipe(centring), 4), options);
    options.threads = 2;
    options.bucket_splats = 500;
    options.slab_bytes = 40'000;
    convertTo("two", *refined(pipe(centring), 4), options);
    EXPECT_TRUE(files("one") == files("two"));
  }
}

TEST_F(RefinedConvert, TakesFurtherScalars) {
  for (const Centring centring : {Centring::kNode, Centring::kCell}) {
    const bool cells = centring == Centring::kCell;
    ConvertOptions both;
    both.scalars = {0, 1};
    both.overwrite = true;
    convertTo("both", *refined(pipe(centring), 3), both);
    ConvertOptions first;
    first.overwrite = true;
    convertTo("added", *refined(pipe(centring), 3), first);
    AddScalarOptions options;
    options.cache = folder_ / "added";
    options.scalars = {1};
    options.memory_bytes = kMemory;
    Progress progress;
    const auto fine = refined(pipe(centring), 3);
    addScalars(*fine, options, progress);
    for (const char* const name : {"geometry.bin", "var.0.bin", "var.1.bin"})
      EXPECT_TRUE(files("added").at(name) == files("both").at(name)) << name << cells;
    EXPECT_EQ(CacheReader(folder_ / "added").manifest().refined, 3u);
  }
}

}  // namespace
}  // namespace curvisplat
