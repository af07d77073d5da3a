// Adding scalars to a cache: it must come out as if it had been made with all of them at once.
#include "preprocess/addition/add_scalar.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/cache_verify.h"
#include "stream/cache/manifest.h"
#include "stream/cache/partial_folder.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/same_caches.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();
constexpr float kBlank = 9999;

void convertTo(const fs::path& output, const GridSource& source, std::vector<uint32_t> scalars) {
  ConvertOptions options;
  options.output = output;
  options.surfaces = false;  // their scalars are those of the conversion
  options.scalars = std::move(scalars);
  options.memory_bytes = uint64_t{1} << 30;
  options.blank_value = kBlank;
  options.title = "a title";
  Progress progress;
  convert(source, options, progress);
}

AddScalarOptions adding(const fs::path& cache, std::vector<uint32_t> scalars) {
  AddScalarOptions options;
  options.cache = cache;
  options.scalars = std::move(scalars);
  options.memory_bytes = uint64_t{1} << 30;
  options.blank_value = kBlank;
  return options;
}

void changeManifest(const fs::path& cache, const std::function<void(nlohmann::ordered_json&)>& change) {
  auto manifest = nlohmann::ordered_json::parse(readTextFile(cache / "manifest.json"));
  manifest.erase("checksum");
  change(manifest);
  writeFileAtomically(cache / "manifest.json", manifest.dump());
}

/// The text of the exception that adding throws; empty if it does not.
std::string refusal(const GridSource& source, const AddScalarOptions& options) {
  return curvisplat::errorOf([&] { added(source, options); });
}

/// Expects that `files` has all payload and index files of `others`, byte for byte.
void expectHolds(const Files& files, const Files& others, const char* when) {
  for (const auto& [name, bytes] : others) {
    if (name == "manifest.json") continue;
    EXPECT_TRUE(files.contains(name) && files.at(name) == bytes) << when << ": " << name;
  }
}

/// Converts `source` with scalar 0, adds 1 and 2, and compares with converting all three. `source` has three.
void expectAsAtOnce(const GridSource& source) {
  const TemporaryFolder folder;
  convertTo(folder / "all.splats", source, {0, 1, 2});
  convertTo(folder / "first.splats", source, {0});
  const Files all = allFilesOf(folder / "all.splats"), first = allFilesOf(folder / "first.splats");
  const CacheReader expected(folder / "all.splats");

  struct Way {
    const char* name;
    unsigned threads;
    uint64_t memory_bytes;
    std::optional<uint64_t> bucket_splats;
    std::optional<uint32_t> most_buckets;
  };
  // Usually one for each grid, by turns, with each value once.
  std::vector<Way> ways{{"plain", 2, uint64_t{1} << 30, {}, {}},
                        {"one thread, the least memory, small buckets", 1, leastMemory(2), 20000, {}},
                        {"tiny buckets, divided twice", 2, uint64_t{1} << 30, 500, 3}};
  if (faults::isWholeSweep())
    ways.insert(ways.end(), {{"one thread", 1, uint64_t{1} << 30, {}, {}},
                             {"the least memory", 2, leastMemory(2), {}, {}},
                             {"small buckets", 2, uint64_t{1} << 30, 20000, {}}});
  static size_t usual = 0;
  if (!faults::isWholeSweep()) ways = {ways[usual++ % ways.size()]};
  for (const Way& way : ways) {
    const fs::path cache = folder / "added.splats";
    fs::copy(folder / "first.splats", cache);
    AddScalarOptions options = adding(cache, {1, 2});
    options.threads = way.threads;
    options.memory_bytes = way.memory_bytes;
    options.limits.bucket_splats = way.bucket_splats;
    options.limits.most_buckets = way.most_buckets;
    const AddScalarReport report = added(source, options);
    EXPECT_EQ(report.splats, expected.manifest().splats);

    const Files added = allFilesOf(cache);
    EXPECT_EQ(added.size(), all.size()) << way.name;
    expectHolds(added, all, way.name);
    expectHolds(added, first, way.name);

    const CacheReader reader(cache);
    ASSERT_EQ(reader.manifest().variables.size(), 3u);
    for (size_t v = 0; v < 3; ++v) {
      const VariableInfo &found = reader.manifest().variables[v], &wanted = expected.manifest().variables[v];
      EXPECT_EQ(found.number, wanted.number);
      EXPECT_EQ(found.name, wanted.name);
      EXPECT_EQ(found.min, wanted.min);
      EXPECT_EQ(found.max, wanted.max);
    }
    EXPECT_EQ(reader.manifest().steps.front().variables, expected.manifest().steps.front().variables);
    for (const std::string& finding : verifyCache(reader).findings) ADD_FAILURE() << way.name << finding;
    fs::remove_all(cache);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 2) << way.name;
  }
}

std::vector<float> scalarsAt(const glm::dvec3& x) {
  return {static_cast<float>(std::sin(2 * x.x) * x.y), static_cast<float>(300 + 5 * x.z - x.x * x.y),
          static_cast<float>(std::cos(3 * x.y) + 0.1 * std::sin(40 * x.x))};
}

NodeValues bentBox(const GridNode& node, const GridBlock& block) {
  const auto part = [](uint64_t index, uint64_t count) {
    return static_cast<double>(index) / static_cast<double>(std::max<uint64_t>(count - 1, 1));
  };
  const double u = part(node.i, block.ni), v = part(node.j, block.nj), w = part(node.k, block.nk);
  const glm::dvec3 position(u + 0.1 * std::sin(3 * v), v, w + 0.1 * u * v);
  return {position, scalarsAt(position), false};
}

FunctionGridSource bentBoxSource(uint64_t ni, uint64_t nj, uint64_t nk) {
  const GridBlock block = gridBlock(ni, nj, nk);
  return {{block}, 3, [=](const GridNode& node) { return bentBox(node, block); }};
}

/// An O-grid that closes on itself along i, and has a singular line at j = 0.
NodeValues ring(const GridNode& node, const GridBlock& block) {
  const double angle =
      2 * std::numbers::pi * static_cast<double>(node.i % (block.ni - 1)) / static_cast<double>(block.ni - 1);
  const double radius = 0.05 * std::pow(static_cast<double>(node.j), 1.3);
  const glm::dvec3 position(radius * std::cos(angle), radius * std::sin(angle),
                            0.1 * static_cast<double>(node.k));
  return {position, scalarsAt(position), false};
}

TEST(AddScalar, GivesTheBytesOfOneConversion) {
  expectAsAtOnce(bentBoxSource(46, 40, 40));
}

TEST(AddScalar, MergesSeamsAsConversionDid) {
  const GridBlock block = gridBlock(49, 38, 40);
  expectAsAtOnce(FunctionGridSource({block}, 3, [=](const GridNode& node) { return ring(node, block); }));
}

TEST(AddScalar, TakesManyBlocks) {
  // 5 x 4 x 3 blocks of 12³ nodes that share their faces.
  const std::vector<GridBlock> blocks(60, gridBlock(12, 12, 12));
  expectAsAtOnce(FunctionGridSource(blocks, 3, [](const GridNode& node) {
    const glm::dvec3 at(11 * (node.block % 5) + node.i, 11 * (node.block / 5 % 4) + node.j,
                        11 * (node.block / 20) + node.k);
    return NodeValues{at, scalarsAt(0.1 * at), false};
  }));
}

TEST(AddScalar, TakesCoincidentNodes) {
  const GridBlock block = gridBlock(50, 40, 38);
  // All in one place: a root of several bricks.
  expectAsAtOnce(FunctionGridSource({block}, 3, [](const GridNode& node) {
    const auto at = static_cast<float>(node.i + 2 * node.j);
    return NodeValues{glm::dvec3(1, 2, 3), {at, std::sin(at), at * at}, false};
  }));
  // A cluster in a grid: several bricks of one cell, below others.
  expectAsAtOnce(FunctionGridSource({block}, 3, [&](const GridNode& node) {
    NodeValues values = bentBox(node, block);
    if (node.k >= 3 && node.k < 36) values.position = glm::dvec3(0.5);
    return values;
  }));
}

TEST(AddScalar, LeavesOutWhatTheGridBlanks) {
  const GridBlock block = gridBlock(50, 40, 40);
  expectAsAtOnce(FunctionGridSource({block}, 3, [&](const GridNode& node) {
    NodeValues values = bentBox(node, block);
    values.blank = node.i < 3 || (node.j == 20 && node.k > 5);
    if (node.i == 7) values.position.x = std::numeric_limits<double>::quiet_NaN();
    if (values.blank) values.scalars.assign(3, kNotANumber);
    return values;
  }));
}

TEST(AddScalar, CutsOctantsInCachesThatHaveThemOnly) {
  GridBlock block = gridBlock(12, 11, 10);
  block.has_blanking = true;
  const FunctionGridSource source({block}, 2, [&](const GridNode& node) {
    NodeValues values = bentBox(node, block);
    values.scalars = {values.scalars[0], values.scalars[0]};
    values.blank = node.i > 3 && node.i < 8 && node.j > 3 && node.j < 8 && node.k > 3 && node.k < 8;
    return values;
  });
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  convertTo(cache, source, {0});
  ASSERT_TRUE(CacheReader(cache).manifest().hasFeature(kCellOctants));
  added(source, adding(cache, {1}));
  const Files files = allFilesOf(cache);
  EXPECT_TRUE(files.at("var.0.bin") == files.at("var.1.bin"));

  // A cache without the feature is expected to have whole pieces, which lie elsewhere.
  convertTo(folder / "older.splats", source, {0});
  changeManifest(folder / "older.splats", [](nlohmann::ordered_json& json) {
    std::erase(json["requires"].get_ref<nlohmann::ordered_json::array_t&>(), kCellOctants);
  });
  expectSays(refusal(source, adding(folder / "older.splats", {1})), "another position");
}

TEST(AddScalar, StretchesCellsThatGrowAsTheCacheDoes) {
  // Two blocks that meet where cells are largest, so that seams are found in the same way, too.
  constexpr uint64_t kNodes = 9;
  const std::vector<GridBlock> blocks(2, gridBlock(kNodes, kNodes, kNodes));
  const FunctionGridSource source(blocks, 2, [&](const GridNode& node) {
    const double up =
        std::pow(1.7, static_cast<double>(node.block == 0 ? node.i : 2 * (kNodes - 1) - node.i));
    const double x = node.block == 0 ? up : 2 * std::pow(1.7, static_cast<double>(kNodes - 1)) - up;
    const auto f = static_cast<float>(x);
    return NodeValues{{x, static_cast<double>(node.j), static_cast<double>(node.k)}, {f, f}};
  });
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  convertTo(cache, source, {0});
  ASSERT_EQ(CacheReader(cache).manifest().stretch, kCellWidths);
  added(source, adding(cache, {1}));
  const Files files = allFilesOf(cache);
  EXPECT_TRUE(files.at("var.0.bin") == files.at("var.1.bin"));

  // An older cache is expected to have splats as they were then.
  convertTo(folder / "older.splats", source, {0});
  changeManifest(folder / "older.splats", [](nlohmann::ordered_json& json) { json.erase("stretch"); });
  expectSays(refusal(source, adding(folder / "older.splats", {1})), "another position");
}

TEST(AddScalar, RefusesCachesWhoseSplatsHadOtherShapes) {
  // Layers of 1 cm around a cylinder, closed along i. Before kDualCells the nodes at the seam were as thick as the sagitta of a
  // cell; they lay where they lie today.
  const GridBlock block = gridBlock(25, 9, 9);
  const FunctionGridSource source({block}, 2, [&](const GridNode& node) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(node.i % (block.ni - 1)) /
                         static_cast<double>(block.ni - 1);
    const double radius = 10 + 0.01 * static_cast<double>(node.j);
    const auto f = static_cast<float>(node.j);
    return NodeValues{{radius * std::cos(angle), radius * std::sin(angle), static_cast<double>(node.k)},
                      {f, f}};
  });
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  convertTo(cache, source, {0});
  added(source, adding(cache, {1}));
  const Files files = allFilesOf(cache);
  EXPECT_TRUE(files.at("var.0.bin") == files.at("var.1.bin"));

  convertTo(folder / "older.splats", source, {0});
  changeManifest(folder / "older.splats",
                 [](nlohmann::ordered_json& json) { json["stretch"] = kSteepStretch; });
  const std::string refused = refusal(source, adding(folder / "older.splats", {1}));
  expectSays(refused, "cell of another shape");
  expectSays(refused, "convert again");
}

TEST(AddScalar, LeavesOutWhatOlderScalarsBlanked) {
  // The added ones have values in some of these nodes, and none in others.
  const auto blanked = [](const GridNode& node, NodeValues values) {
    const bool here = (node.i + node.j + node.k) % 11 == 0 || node.j == 13;
    if (here) values.scalars[0] = node.k % 2 ? kNotANumber : kBlank;
    if (here && node.k % 3 == 0) values.scalars[1] = kNotANumber;
    return values;
  };
  const GridBlock box = gridBlock(40, 30, 30), o_grid = gridBlock(45, 30, 20);
  // Without seams, and with one where only the older scalar and the cache know which nodes are there.
  expectAsAtOnce(
      FunctionGridSource({box}, 3, [=](const GridNode& node) { return blanked(node, bentBox(node, box)); }));
  expectAsAtOnce(FunctionGridSource({o_grid}, 3, [=](const GridNode& node) {
    GridNode on_ring = node;
    on_ring.i = node.j == 0 ? 0 : node.i % (o_grid.ni - 1);
    return blanked(on_ring, ring(node, o_grid));
  }));
}

TEST(AddScalar, SaysWhichValuesAreLeftOut) {
  const GridBlock box = gridBlock(20, 10, 10);
  const FunctionGridSource source({box}, 4, [=](const GridNode& node) {
    NodeValues values = bentBox(node, box);
    values.scalars.push_back(values.scalars[0]);
    if (node.i < 5) values.scalars[0] = values.scalars[1] = kNotANumber;
    if (node.i < 2) values.scalars[2] = kNotANumber;
    return values;
  });
  const TemporaryFolder folder;
  const auto warningsOfAdding = [&](const std::string& name, const std::vector<uint32_t>& scalars) {
    convertTo(folder / name, source, {0});
    return added(source, adding(folder / name, scalars)).warnings;
  };
  EXPECT_EQ(warningsOfAdding("same", {1}), std::vector<std::string>{});
  const std::vector<std::pair<std::vector<uint32_t>, std::string>> others{
      {{2}, "the values of s2 at 300 samples"},
      {{3}, "the values of s3 at 500 samples"},
      {{1, 2, 3}, "the values of s1, s2, s3 at 500 samples"}};
  for (const auto& [scalars, text] : others) {
    const std::vector<std::string> warnings = warningsOfAdding(text, scalars);
    ASSERT_EQ(warnings.size(), 1u) << text;
    expectSays(warnings[0], text);
    expectSays(warnings[0], "convert again with all scalars");
  }
}

TEST(AddScalar, RefusesBlanksThatTheCacheLeavesAmbiguous) {
  // The older scalar blanked some of the nodes that coincide: were the others merged, or blanked too?
  const TemporaryFolder folder;
  const GridBlock block = gridBlock(33, 20, 10);
  const FunctionGridSource source({block}, 2, [=](const GridNode& node) {
    NodeValues values = ring(node, block);
    if (node.j == 0 && node.i > 5 && node.i < 9) values.scalars[0] = kNotANumber;
    return values;
  });
  convertTo(folder / "a.splats", source, {0});
  const Files before = allFilesOf(folder / "a.splats");
  expectSays(refusal(source, adding(folder / "a.splats", {1})), "convert again with all scalars");
  EXPECT_TRUE(allFilesOf(folder / "a.splats") == before);
}

TEST(AddScalar, AddsOneAfterTheOther) {
  const TemporaryFolder folder;
  const FunctionGridSource source = bentBoxSource(30, 30, 30);
  convertTo(folder / "all.splats", source, {0, 1, 2});
  convertTo(folder / "a.splats", source, {0});
  added(source, adding(folder / "a.splats", {1}));
  added(source, adding(folder / "a.splats", {2}));
  const Files all = allFilesOf(folder / "all.splats"), added = allFilesOf(folder / "a.splats");
  expectHolds(added, all, "one after the other");
  EXPECT_EQ(added.size(), all.size());
  const CacheReader reader(folder / "a.splats");
  EXPECT_EQ(reader.manifest().sources, std::vector<std::string>{"function"});
}

/// A cache of a bent box with scalar 0, and what it was.
class ToAnExistingCache : public ::testing::Test {
 protected:
  ToAnExistingCache() {
    if (!made_) {
      made_ = std::make_unique<TemporaryFolder>();
      convertTo(*made_ / "a.splats", source, {0});
    }
    fs::copy(*made_ / "a.splats", cache);
    before = allFilesOf(cache);
  }
  static void TearDownTestSuite() { made_.reset(); }

  /// Expects that adding is refused with these words, and changes nothing.
  void expectRefused(const GridSource& from, const AddScalarOptions& options, const std::string& words) {
    const std::string text = refusal(from, options);
    expectSays(text, words);
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    expectUnchanged("after a refusal");
  }

  void expectUnchanged(const std::string& when) {
    EXPECT_TRUE(allFilesOf(cache) == before) << when;
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1) << when;
  }

  /// The box, with something changed.
  FunctionGridSource changed(std::function<void(const GridNode&, NodeValues&)> change) const {
    return {{block}, 3, [this, change](const GridNode& node) {
              NodeValues values = bentBox(node, block);
              change(node, values);
              return values;
            }};
  }

  static inline std::unique_ptr<TemporaryFolder> made_;  // by the first test
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  const GridBlock block = gridBlock(41, 41, 41);  // several bricks
  const FunctionGridSource source = bentBoxSource(41, 41, 41);
  Files before;
};

TEST_F(ToAnExistingCache, RefusesNamesThatItHas) {
  EXPECT_THROW(added(source, adding(cache, {1, 0})), UsageError);
  expectRefused(source, adding(cache, {0}), "already has a scalar 's0'; it has s0");
}

TEST_F(ToAnExistingCache, RefusesAnotherGrid) {
  const AddScalarOptions options = adding(cache, {1});
  expectRefused(bentBoxSource(41, 41, 42), options,
                "41x41x41 nodes when the cache was made; in this grid it has 41x41x42");
  expectRefused(
      FunctionGridSource({block, block}, 3, [&](const GridNode& node) { return bentBox(node, block); }),
      options, "1 block");
  expectRefused(changed([](const GridNode&, NodeValues& values) { values.position *= 1.5; }), options,
                "was made from a grid from");
  expectRefused(changed([](const GridNode& node, NodeValues& values) { values.blank = node.i == 9; }),
                options, "not the one the cache was made from");
  // The same bounds and counts from here on. A node elsewhere in its cell, or in another's cell:
  for (const double shift : {0.01, 0.4}) {
    expectRefused(changed([&](const GridNode& node, NodeValues& values) {
                    if (node.i == 20 && node.j == 20 && node.k == 20) values.position.x += shift;
                  }),
                  options, "not the one the cache was made from");
  }
  // Nodes in another order.
  const auto mirrored = [this](const GridNode& node) {
    return bentBox({node.block, node.i, node.j, block.nk - 1 - node.k}, block);
  };
  expectRefused(FunctionGridSource({block}, 3, mirrored), options, "not the one the cache was made from");
}

TEST_F(ToAnExistingCache, RefusesOtherNodesInTheSamePlace) {
  const auto allButOne = [this](uint64_t missing) {
    return changed([=](const GridNode& node, NodeValues& values) {
      values.position = glm::dvec3(1, 2, 3);
      values.blank = node.i == missing && node.j == 5 && node.k == 5;
    });
  };
  // Cells that touch the blanked node and have no volume are not drawn, so its neighbours differ; any brick may be the first.
  fs::remove_all(cache);
  convertTo(cache, allButOne(9), {0});
  before = allFilesOf(cache);
  expectRefused(allButOne(10), adding(cache, {1}), "of block 1, but the grid has node 9 ");
}

TEST_F(ToAnExistingCache, RefusesMissingValues) {
  const auto lacking = changed([](const GridNode& node, NodeValues& values) {
    if (node.i == 3 && node.j == 4) values.scalars[1] = kNotANumber;
    if (node.i == 5 && node.j == 4) values.scalars[2] = kBlank;
  });
  expectRefused(lacking, adding(cache, {1}), "41 of its samples have no value of s1 (41 not finite");
  expectRefused(lacking, adding(cache, {1, 2}), "82 of its samples have no value of s1, s2");
}

TEST_F(ToAnExistingCache, RefusesAFolderThatIsNotACache) {
  fs::create_directory(folder / "empty");
  EXPECT_NE(refusal(source, adding(folder / "empty", {1})), "");
  EXPECT_NE(refusal(source, adding(folder / "missing", {1})), "");
  AddScalarOptions options = adding(cache, {1});
  options.temporary_folder = folder / "missing";
  expectSays(refusal(source, options), "--tmp");
}

TEST_F(ToAnExistingCache, RefusesWhileAnotherChangesIt) {
  {
    const CacheLock lock(cache);
    expectRefused(source, adding(cache, {1}), "another program is changing this cache");
  }
  EXPECT_EQ(refusal(source, adding(cache, {1})), "");
}

TEST_F(ToAnExistingCache, RefusesDamagedGeometry) {
  std::fstream file(cache / "geometry.bin", std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(500);
  file.put(static_cast<char>(before["geometry.bin"][500] ^ 1));
  file.close();
  before = allFilesOf(cache);
  expectRefused(source, adding(cache, {1}), "checksum");
}

TEST_F(ToAnExistingCache, ClearsWhatAKilledOneLeft) {
  std::ofstream(cache / "var.1.bin.part") << "rest";
  std::ofstream(cache / "var.2.bin.part") << "rest";
  EXPECT_TRUE(verifyCache(CacheReader(cache)).findings.empty());
  added(source, adding(cache, {1}));
  const Files after = allFilesOf(cache);
  EXPECT_EQ(after.size(), before.size() + 1);
  EXPECT_TRUE(after.contains("var.1.bin"));
}

TEST_F(ToAnExistingCache, ClearsAConversionKilledAtItsEnd) {
  const fs::path scratch = folder / "a.splats.tmp.7.0";
  fs::create_directory(scratch);
  std::ofstream(scratch / "splats.bin") << "rest";
  writeJournal(cache, {{}, scratch, std::nullopt});
  std::ofstream(cache / kBrickLogName) << "rest";
  std::ofstream(cache / kPartialLock) << kPartialMark;
  added(source, adding(cache, {1}));
  EXPECT_EQ(allFilesOf(cache).size(), before.size() + 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST_F(ToAnExistingCache, IsAsItWasWhenADiskFails) {
  using faults::FaultySystemCalls;
  AddScalarOptions options = adding(cache, {1, 2});
  options.limits.bucket_splats = 20000;
  FaultySystemCalls counting;
  const fs::path copy = folder / "copy.splats";
  fs::copy(cache, copy);
  {
    const ScopedSystemCalls scope(counting);
    AddScalarOptions of_copy = options;
    of_copy.cache = copy;
    added(source, of_copy);
  }
  const Files whole = allFilesOf(copy);
  fs::remove_all(copy);

  struct Kind {
    const char* name;
    int64_t FaultySystemCalls::*fail_at;
    int64_t count;
  };
  for (const Kind& kind : {Kind{"write", &FaultySystemCalls::fail_write_at, counting.writes},
                           Kind{"read", &FaultySystemCalls::fail_read_at, counting.reads},
                           Kind{"rename", &FaultySystemCalls::fail_rename_at, counting.renames},
                           Kind{"sync", &FaultySystemCalls::fail_sync_at, counting.syncs}}) {
    ASSERT_GE(kind.count, 3) << kind.name;
    for (int64_t at = 0; at < kind.count;
         at += std::max<int64_t>(1, kind.count / (faults::isWholeSweep() ? 20 : 4))) {
      FaultySystemCalls failing;
      failing.*kind.fail_at = at;
      failing.error = EIO;
      const std::string when = fmt::format("{} {} of {}", kind.name, at, kind.count);
      {
        const ScopedSystemCalls scope(failing);
        EXPECT_NE(refusal(source, options), "") << when;
      }
      // The last sync comes when the new manifest is in place.
      if (allFilesOf(cache) == whole) {
        EXPECT_EQ(when, fmt::format("sync {0} of {1}", kind.count - 1, kind.count));
        break;
      }
      expectUnchanged(when);
    }
  }
}

}  // namespace
}  // namespace curvisplat
