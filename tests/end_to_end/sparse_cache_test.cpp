// An index of a million bricks, as 10^10 nodes have: opened, planned and drawn in bounded memory. How long that takes is for
// bench/index_bench.cpp to say.
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/file.h"
#include "tests/support/lattice_cache.h"
#include "tests/support/run_program.h"
#include "tests/support/sanitizers.h"
#include "tests/support/sparse_cache.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr uint64_t kBricks = 1'000'001;  // the root, and eights
// Of 144 + 40 bytes a brick on disk, and what the program takes without them.
constexpr uint64_t kMaxMemoryBytes = uint64_t{320} << 20;

class SparseCache : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    writeSparseCache(*folder_ / "sparse.splats", kBricks);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string file(const std::string& name) { return (*folder_ / name).string(); }

  struct Drawn {
    std::string picture;
    nlohmann::json statistics;
  };
  static Drawn draw(const std::string& cache, const std::vector<std::string>& options) {
    std::vector<std::string> words{
        "render", cache,     "-o",        file("a.pfm"),  "--size",         "256x256",
        "--tf",   "viridis", "--stats",   file("a.json"), "--range",        "0,32",
        "--view", "iso",     "--opacity", "0:0.5,1:0.5",  "--opacity-unit", "0.5"};
    words.insert(words.end(), options.begin(), options.end());
    const ProgramResult result = runProgram(words);
    EXPECT_EQ(result.status, 0) << result.err;
    if (result.status != 0) return {};
    return {readTextFile(file("a.pfm")), nlohmann::json::parse(readTextFile(file("a.json")))};
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> SparseCache::folder_;

TEST_F(SparseCache, IsDescribed) {
  const ProgramResult result = runProgram({"info", file("sparse.splats"), "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto info = nlohmann::json::parse(result.out);
  EXPECT_EQ(info["bricks"], kBricks);
  EXPECT_GT(info["splats"], 9'000'000'000);
}

/// Its coarse levels are those of the lattice, of which the third is the finest.
TEST_F(SparseCache, IsDrawnAsTheLatticeWithinItsMemory) {
  writeLatticeCache(file("lattice.splats"), 0, {1, 0, 0});
  // On the screen a cell of level n is 150 / 2^n pixels long; the sparse cache's errors are a sixteenth of that.
  for (const auto& [lod_pixels, bricks] : {std::pair("30", 1), std::pair("9", 8), std::pair("4", 64)}) {
    SCOPED_TRACE(lod_pixels);
    const Drawn sparse = draw(file("sparse.splats"), {"--lod-pixels", lod_pixels});
    ASSERT_FALSE(sparse.picture.empty());
    EXPECT_EQ(sparse.statistics["frames"][0]["bricks_drawn"], bricks);
    EXPECT_TRUE(sparse.picture == draw(file("lattice.splats"), {"--lod-pixels", lod_pixels}).picture);
    if (!kIsSanitized) {
      EXPECT_LE(sparse.statistics["peak_memory_bytes"], kMaxMemoryBytes);
    }
  }
}

}  // namespace
}  // namespace curvisplat
