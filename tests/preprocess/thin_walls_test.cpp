// Thin walls: a flat plate in a C-grid, whose two sides and whose wake's two sides are one face of the block folded onto
// itself. On the plate the values differ, in the wake they do not.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/geometric.hpp>
#include <map>
#include <random>
#include <span>
#include <vector>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/add_step.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/seams/thin_walls.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/manifest.h"
#include "stream/model/splats.h"
#include "stream/model/thin_walls.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kStreamwise = 49, kWallNormal = 13, kSpanwise = 6;
constexpr uint64_t kNose = 24, kPlate = 12;  // i of the leading edge; nodes from there to the trailing edge

/// Parabolic coordinates, in which the plate from x = 0 to 1 and the wake behind it are both eta = 0.
double xiOf(const GridNode& n) {
  return (static_cast<double>(n.i) - kNose) / kPlate;
}
glm::dvec3 placeAt(const GridNode& n) {
  const double xi = xiOf(n), eta = 0.06 * static_cast<double>(n.j);
  return {xi * xi - eta * eta, 2 * xi * eta, 0.25 * static_cast<double>(n.k)};
}
/// Odd in xi: above the plate another value than below; 0 in the wake.
double pressure(double xi) {
  return xi * std::max(0.0, 1 - xi * xi);
}
double pressureAt(const glm::dvec3& at) {
  return pressure(std::copysign(std::sqrt((at.x + std::hypot(at.x, at.y)) / 2), at.y));
}
double temperature(const glm::dvec3& at) {
  return 2 + 0.1 * at.x + 0.05 * at.z;
}

/// "s0" is the temperature, the same on both sides, "s1" the pressure, "s2" twice that plus the temperature. `strength`: of
/// the pressure.
FunctionGridSource plate(double strength = 1) {
  return FunctionGridSource(
      {gridBlock(kStreamwise, kWallNormal, kSpanwise)}, 3, [strength](const GridNode& n) {
        const glm::dvec3 at = placeAt(n);
        const double p = strength * pressure(xiOf(n)), t = temperature(at);
        return NodeValues{at, {static_cast<float>(t), static_cast<float>(p), static_cast<float>(2 * p + t)}};
      });
}

/// Makes the same plate of two blocks that meet at it and at the wake.
FunctionGridSource plateOfTwoBlocks() {
  return FunctionGridSource(
      std::vector<GridBlock>(2, gridBlock(kNose + 1, kWallNormal, kSpanwise)), 2, [](const GridNode& n) {
        const GridNode of_whole{0, n.i + n.block * kNose, n.j, n.k};
        const glm::dvec3 at = placeAt(of_whole);
        return NodeValues{
            at, {static_cast<float>(temperature(at)), static_cast<float>(pressure(xiOf(of_whole)))}};
      });
}

/// Pairs of nodes on the plate, without its edges, and in the wake with the trailing edge, in each plane k.
constexpr uint64_t kPlatePairs = kPlate - 1, kWakePairs = kNose - kPlate + 1;

struct DrawnSplat {
  glm::dvec3 position{0.0};
  double weight = 0, mean = 0;
};

class ThinWallsTest : public testing::Test {
 protected:
  ConvertOptions options(const char* name, std::vector<uint32_t> scalars) {
    ConvertOptions options;
    options.output = folder_ / name;
    options.scalars = std::move(scalars);
    options.memory_bytes = uint64_t{1} << 30;
    options.title = "plate";
    options.surfaces = false;
    options.precision = ValuePrecision::kFine;
    return options;
  }
  ConvertReport convertTo(const char* name, const DataSource& source, std::vector<uint32_t> scalars) {
    return converted(source, options(name, std::move(scalars)));
  }

  /// The finest splats, by their node.
  std::map<std::array<uint64_t, 4>, DrawnSplat> splatsOf(const char* name, size_t variable = 0) {
    const CacheReader cache(folder_ / name);
    std::map<std::array<uint64_t, 4>, DrawnSplat> splats;
    SplatGeometry geometry;
    SplatVariable values;
    std::vector<NodeRun> runs;
    for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
      if (!cache.bricks()[brick].isLeaf()) continue;
      cache.readGeometry(brick, geometry, &runs);
      cache.readVariable(brick, variable, values);
      size_t at = 0;
      for (const NodeRun& run : runs)
        for (uint64_t n = 0; n < run.count; ++n, ++at)
          splats[{run.block, run.i + n, run.j, run.k}] = {
              cache.manifest().root.cellMin(cache.bricks()[brick].cell) +
                  glm::dvec3(geometry.x[at], geometry.y[at], geometry.z[at]),
              static_cast<double>(geometry.weight[at]), static_cast<double>(values.mean[at])};
    }
    return splats;
  }

  static double volumeOf(const std::map<std::array<uint64_t, 4>, DrawnSplat>& splats, double above) {
    double volume = 0;
    for (const auto& [node, splat] : splats)
      if (splat.mean > above) volume += splat.weight;
    return volume;
  }

  TemporaryFolder folder_;
};

TEST_F(ThinWallsTest, BothSidesOfAPlateHaveTheirOwnValues) {
  const ConvertReport report = convertTo("a.splats", plate(), {1});
  EXPECT_EQ(report.merged_nodes, kWakePairs * kSpanwise);
  ASSERT_EQ(report.notes.size(), 1u);
  expectSays(report.notes[0], "66 pairs of nodes on both sides of thin walls stay apart");
  const auto splats = splatsOf("a.splats");
  EXPECT_EQ(splats.size(), (kStreamwise * kWallNormal - kWakePairs) * kSpanwise);
  for (uint64_t k = 0; k < kSpanwise; ++k)
    for (uint64_t s = 1; s <= kNose; ++s) {
      const auto lower = splats.find({0, kNose - s, 0, k}), upper = splats.find({0, kNose + s, 0, k});
      ASSERT_NE(lower, splats.end());
      ASSERT_EQ(upper != splats.end(), s < kPlate) << s;
      EXPECT_NEAR(lower->second.mean, pressureAt(lower->second.position), 0.01) << s;
      if (s >= kPlate) continue;
      EXPECT_NEAR(upper->second.mean, pressureAt(upper->second.position), 0.01) << s;
      // Each has the half cell on its own side.
      EXPECT_LT(lower->second.position.y, -1e-3);
      EXPECT_GT(upper->second.position.y, 1e-3);
      EXPECT_NEAR(lower->second.weight, upper->second.weight, 0.01 * upper->second.weight);
    }
}

/// Prisms between quadrilaterals, by the area of these.
TEST_F(ThinWallsTest, VolumesAreThoseOfTheGridAndItsField) {
  convertTo("a.splats", plate(), {1});
  const auto splats = splatsOf("a.splats");
  constexpr double kThickness = 0.25 * (kSpanwise - 1), kAbove = 0.3;
  constexpr int kParts = 16;
  double volume = 0, above = 0;
  for (uint64_t j = 0; j + 1 < kWallNormal; ++j)
    for (uint64_t i = 0; i + 1 < kStreamwise; ++i) {
      const glm::dvec3 a = placeAt({0, i, j, 0}), b = placeAt({0, i + 1, j, 0}),
                       c = placeAt({0, i + 1, j + 1, 0}), d = placeAt({0, i, j + 1, 0});
      const double area = 0.5 * std::abs(glm::cross(c - a, d - b).z);
      volume += area * kThickness;
      // The pressure depends on i alone, and the cell is about as wide at both ends.
      int parts = 0;
      const double from = pressure(xiOf({0, i, j, 0})), to = pressure(xiOf({0, i + 1, j, 0}));
      for (int part = 0; part < kParts; ++part) parts += from + (to - from) * (part + 0.5) / kParts > kAbove;
      above += area * kThickness * parts / kParts;
    }
  EXPECT_NEAR(volumeOf(splats, -100), volume, 1e-3 * volume);
  EXPECT_NEAR(volumeOf(splats, kAbove), above, 0.06 * above);
}

/// Whichever scalars are converted, the file's decide.
TEST_F(ThinWallsTest, TheGeometryIsThatOfAllScalarsOfTheFile) {
  const FunctionGridSource grid = plate();
  convertTo("p.splats", grid, {1});
  convertTo("t.splats", grid, {0});
  EXPECT_EQ(filesOf(folder_ / "t.splats").at("geometry.bin"),
            filesOf(folder_ / "p.splats").at("geometry.bin"));
}

/// Solvers differ a little on the two sides of a cut.
TEST_F(ThinWallsTest, SmallDifferencesAreThoseOfACut) {
  const FunctionGridSource noisy({gridBlock(kStreamwise, kWallNormal, kSpanwise)}, 1, [](const GridNode& n) {
    const glm::dvec3 at = placeAt(n);
    return NodeValues{at, {static_cast<float>(at.x + 0.005 * pressure(xiOf(n)))}};
  });
  EXPECT_EQ(convertTo("a.splats", noisy, {0}).merged_nodes, kNose * kSpanwise);
}

/// A scalar whose range is that of a few nodes, 10,000 times as wide as its values elsewhere.
TEST_F(ThinWallsTest, LongTailsHideNoWalls) {
  const auto tail = [](double noise) {
    return FunctionGridSource(
        {gridBlock(kStreamwise, kWallNormal, kSpanwise)}, 1, [noise](const GridNode& n) {
          const bool is_nose = n.i == kNose && n.j == 0 && n.k == 0;
          const double wake = n.i > kNose + kPlate ? noise : 0;
          return NodeValues{placeAt(n), {static_cast<float>(is_nose ? 1e3 : pressure(xiOf(n)) + wake)}};
        });
  };
  // The noise of the wake is a hundredth of the values' spread, and less than 1e-4 of their range.
  EXPECT_EQ(convertTo("a.splats", tail(0.01), {0}).merged_nodes, kWakePairs * kSpanwise);
}

TEST_F(ThinWallsTest, BlocksThatMeetAtAPlateStayApartThere) {
  const ConvertReport one = convertTo("a.splats", plate(), {1}),
                      two = convertTo("b.splats", plateOfTwoBlocks(), {1});
  // The blocks also share the nodes before the leading edge.
  EXPECT_EQ(two.merged_nodes, one.merged_nodes + kWallNormal * kSpanwise);
  EXPECT_NEAR(volumeOf(splatsOf("b.splats"), 0.3), volumeOf(splatsOf("a.splats"), 0.3), 1e-3);
}

/// Numbers of blocks or processes differ at every joint, and tell nothing of walls.
TEST_F(ThinWallsTest, NumbersOfBlocksAreNoWalls) {
  const FunctionGridSource numbered(
      std::vector<GridBlock>(2, gridBlock(kNose + 1, kWallNormal, kSpanwise)), 2, [](const GridNode& n) {
        const glm::dvec3 at = placeAt({0, n.i + n.block * kNose, n.j, n.k});
        return NodeValues{at, {static_cast<float>(temperature(at)), static_cast<float>(7 + n.block)}};
      });
  EXPECT_TRUE(convertTo("a.splats", numbered, {0}).notes.empty());
}

/// The value of --blank is none of a wall, and hides none.
TEST_F(ThinWallsTest, BlankValuesHideNoWalls) {
  const FunctionGridSource blanked(
      {gridBlock(kStreamwise, kWallNormal, kSpanwise)}, 1, [](const GridNode& n) {
        const bool is_blank = n.j == kWallNormal - 1;
        return NodeValues{placeAt(n), {is_blank ? -1e30F : static_cast<float>(pressure(xiOf(n)))}};
      });
  ConvertOptions of_blank = options("a.splats", {0});
  of_blank.blank_value = -1e30;
  EXPECT_EQ(converted(blanked, of_blank).merged_nodes, kWakePairs * kSpanwise);
}

TEST_F(ThinWallsTest, BytesDependOnTheGridAlone) {
  const FunctionGridSource grid = plate();
  const ConvertReport report = expectSameCaches(
      grid, options("a.splats", {1}),
      {{.threads = 1}, {.memory_bytes = leastMemory(1)}, {.slab_bytes = 20000}, {.ranks = 3}});
  EXPECT_EQ(report.merged_nodes, kWakePairs * kSpanwise);
}

TEST_F(ThinWallsTest, AddedScalarsAreThoseOfAConversionOfAll) {
  const FunctionGridSource grid = plate();
  convertTo("all.splats", grid, {1, 2});
  convertTo("first.splats", grid, {1});
  AddScalarOptions adding;
  adding.cache = folder_ / "first.splats";
  adding.scalars = {2};
  adding.memory_bytes = uint64_t{1} << 30;
  added(grid, adding);
  const Files all = allFilesOf(folder_ / "all.splats"), both = allFilesOf(folder_ / "first.splats");
  for (const auto& [name, bytes] : all) {
    if (name == "manifest.json") continue;
    EXPECT_TRUE(both.contains(name) && both.at(name) == bytes) << name;
  }
}

TEST_F(ThinWallsTest, ADamagedListIsNamed) {
  const FunctionGridSource grid = plate();
  convertTo("a.splats", grid, {1});
  AddScalarOptions adding;
  adding.cache = folder_ / "a.splats";
  adding.scalars = {2};
  adding.memory_bytes = uint64_t{1} << 30;
  const std::filesystem::path path = folder_ / "a.splats/walls.bin";
  const std::string whole = bytesOfFile(path);
  for (std::string bytes : {whole.substr(1), whole + whole, std::string(whole.size(), '\xff')}) {
    overwriteFile(path, bytes);
    expectSays(errorOf([&] { added(grid, adding); }), "a.splats");
    if (bytes.size() != whole.size()) continue;  // opening it fails
    const CacheVerification verified = verifyCache(CacheReader(folder_ / "a.splats"));
    ASSERT_EQ(verified.findings.size(), 1u);
    expectSays(verified.findings[0], "walls.bin: has a wrong checksum");
  }
  overwriteFile(path, whole);
  EXPECT_TRUE(verifyCache(CacheReader(folder_ / "a.splats")).findings.empty());
  // A malicious one has its checksum, and the whole block again and again, each row of which takes memory.
  const std::vector<WallSide> boxes(
      20, WallSide{0, 1, {0, 0, 0}, {kStreamwise - 1, kWallNormal - 1, kSpanwise - 1}});
  const auto listed = std::as_bytes(std::span(boxes));
  const Manifest manifest = CacheReader(folder_ / "a.splats").manifest();
  Manifest malicious = manifest;
  const auto info = std::ranges::find(malicious.files, kThinWallsFileName, &FileInfo::name);
  *info = {kThinWallsFileName, listed.size(), checksumOf(listed)};
  overwriteFile(path, {reinterpret_cast<const char*>(listed.data()), listed.size()});
  replaceManifest(folder_ / "a.splats", malicious);
  expectSays(errorOf([&] { added(grid, adding); }),
             "walls.bin: is damaged (has boxes that are not of the grid)");
  overwriteFile(path, whole);
  replaceManifest(folder_ / "a.splats", manifest);
  added(grid, adding);
}

/// A step with the same values on both sides has the splats of the cache's geometry. The other way round a warning says so.
TEST_F(ThinWallsTest, LaterStepsHaveTheWallsOfTheGeometry) {
  for (const double first : {1.0, 0.0}) {
    convertTo("a.splats", plate(first), {1});
    AddStepOptions adding;
    adding.cache = folder_ / "a.splats";
    adding.memory_bytes = uint64_t{1} << 30;
    Progress progress;
    const AddStepReport report = addStep(plate(1 - first), adding, progress);
    EXPECT_FALSE(report.new_geometry);
    EXPECT_EQ(CacheReader(folder_ / "a.splats").series().steps.size(), 2u);
    ASSERT_EQ(report.warnings.size(), first == 0 ? 1u : 0u);
    if (first == 0) expectSays(report.warnings[0], "at 66 pairs of nodes on both sides of thin walls");
    std::filesystem::remove_all(folder_ / "a.splats");
  }
}

TEST_F(ThinWallsTest, TheListHasBoxesOfTheUpperSide) {
  convertTo("a.splats", plate(), {1});
  const Manifest manifest = CacheReader(folder_ / "a.splats").manifest();
  EXPECT_TRUE(manifest.hasFeature(kThinWalls));
  const WallSide upper{0, 1, {kNose + 1, 0, 0}, {kNose + kPlatePairs, 0, kSpanwise - 1}};
  const std::string bytes = bytesOfFile(folder_ / "a.splats/walls.bin");
  ASSERT_EQ(bytes.size(), sizeof(WallSide));
  EXPECT_EQ(std::memcmp(bytes.data(), &upper, sizeof upper), 0);
  // Grids without such walls have none of it.
  convertTo("b.splats", plate(0), {1});
  EXPECT_FALSE(CacheReader(folder_ / "b.splats").manifest().hasFeature(kThinWalls));
  EXPECT_FALSE(filesOf(folder_ / "b.splats").contains("walls.bin"));
}

TEST(WallSides, BoxesHoldTheNodesAndNoOthers) {
  const std::vector<GridBlock> blocks{gridBlock(4, 3, 5), gridBlock(6, 7, 2)};
  std::vector<WallNode> nodes;
  for (uint64_t node = 0; node < 60 + 84; ++node)
    if (node % 12 < 4 || (node >= 60 && node % 7 == 0)) nodes.push_back({node, node % 5 == 0 ? 2u : 1u});
  const std::vector<WallSide> boxes = wallSidesOf(nodes, blocks);
  const ThinWalls walls(boxes, blocks);
  for (uint64_t node = 0, next = 0; node < 60 + 84; ++node) {
    const bool listed = next < nodes.size() && nodes[next].node == node;
    EXPECT_EQ(walls.sideOf(node), listed ? nodes[next].side : 0) << node;
    next += listed;
  }
  // Few enough, they hold all nodes still.
  nodes.clear();
  for (uint64_t node = 0; node < 60 + 84; node += 2) nodes.push_back({node, 1});
  const std::vector<WallSide> few = wallSidesOf(nodes, blocks, 1);
  EXPECT_LE(few.size(), 4u);
  const ThinWalls coarse(few, blocks);
  for (const WallNode& node : nodes) EXPECT_EQ(coarse.sideOf(node.node), 1u) << node.node;
  // Boxes that overlap.
  const std::vector<GridBlock> face{gridBlock(60, 60, 1)};
  std::mt19937 random(5);
  nodes.clear();
  for (uint64_t node = 0; node < 3600; ++node)
    if (random() % 2 == 0) nodes.push_back({node, 1});
  const std::vector<WallSide> overlapping = wallSidesOf(nodes, face, 400);
  EXPECT_GT(overlapping.size(), 100u);
  const ThinWalls of_face(overlapping, face);
  for (const WallNode& node : nodes) EXPECT_EQ(of_face.sideOf(node.node), 1u) << node.node;
}

}  // namespace
}  // namespace curvisplat
