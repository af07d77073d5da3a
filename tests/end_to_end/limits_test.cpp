// The limits: as little memory, as many threads, as large and as small a picture as there may be; and an
// index of a million bricks, as 10^10 nodes have: opened, planned and drawn in bounded memory. How long that
// takes is for bench/index_bench.cpp to say.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/cube_files.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/memory_limit.h"
#include "tests/support/program_test.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

class LimitsTest : public ProgramSuite<LimitsTest> {
 protected:
  static void prepare() {
    setenv("CURVISPLAT_START", "1", 1);  // forks share memory, and are nobody's children here
    writeCube(*folder_ / "cube", 12, [](const GridNode& node, NodeValues& values) {
      values.scalars[0] = static_cast<float>(node.i);
    });
    run(cubeArguments(file("cube")));
  }

  /// Draws the cube to `name`, 100x100 unless `more` has another size.
  static Words render(const std::string& name, const Words& more = {}) {
    return sized(Words{"render", file("cube.splats"), "-o", file(name)} + more, "100x100");
  }
  static std::string rendered(const std::string& name, const Words& more = {}) {
    run(render(name, more));
    return readTextFile(file(name));
  }

  /// N of "at least N MiB" in the one line that a program has said; 0: none.
  static uint64_t leastMebibytes(const ProgramResult& result) {
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    expectSays(result.err, "--memory");
    const std::string before = "at least ";
    const size_t at = result.err.find(before);
    EXPECT_NE(at, std::string::npos) << result.err;
    return at == std::string::npos ? 0 : std::stoull(result.err.substr(at + before.size()));
  }

  /// The most memory in MiB that any program has taken that this process has run.
  static uint64_t largestProgram() {
    rusage usage{};
    EXPECT_EQ(getrusage(RUSAGE_CHILDREN, &usage), 0);
    return static_cast<uint64_t>(usage.ru_maxrss) >> 10;
  }
};

/// Sanitizers need memory of their own.
void expectAtMost(uint64_t mebibytes, uint64_t peak_bytes) {
  if (!kIsSanitized) {
    EXPECT_LE(peak_bytes, mebibytes << 20);
  }
}

std::string mebibytes(uint64_t count) {
  return fmt::format("{}M", count);
}

TEST_F(LimitsTest, ConversionNamesTheLeastMemoryThatItTakes) {
  const auto convert = [&](uint64_t least) {
    return cubeArguments(file("cube"), {"--memory", mebibytes(least)}, file("least.splats"));
  };
  const ProgramResult refused = runProgram(convert(1));
  EXPECT_EQ(refused.status, 1);
  const uint64_t least = leastMebibytes(refused);
  ASSERT_GT(least, 1u);
  EXPECT_EQ(runProgram(convert(least - 1)).status, 1);
  EXPECT_FALSE(std::filesystem::exists(file("least.splats")));
  run(convert(least));
}

TEST_F(LimitsTest, LongRowsAreConvertedWithinTheMemory) {
  constexpr int kMebibytes = 160;
  // Rows that have to be cut, of ever smaller cross sections; usually the quickest.
  for (const std::string size : {"20000x9x9", "100000x3x2", "250000x2x2", "80000x2x2"}) {
    if (size != "80000x2x2" && !faults::isWholeSweep()) continue;
    SCOPED_TRACE(size);
    run({"generate", "wake", "--size", size, "-o", file("long")});
    run({"convert", file("long.xyz"), file("long.fun"), "-o", file("long.splats"), "--overwrite", "--refine",
         "1", "--memory", mebibytes(kMebibytes), "--stats", file("long.json")});
    const auto stats = jsonOf(file("long.json"));
    expectAtMost(kMebibytes, stats["peak_memory_bytes"].get<uint64_t>());
  }
  run({"convert", file("long.xyz"), "--add-scalar", "j", "--to", file("long.splats"), "--memory",
       mebibytes(kMebibytes)});
}

// The blocks' boxes overlap, so that the check for overlaps picks the points of all of them.
TEST_F(LimitsTest, ManySmallBlocksAreConvertedWithinTheMemory) {
  constexpr uint64_t kMebibytes = 160;
  constexpr int32_t kSide = 4;
  const int32_t blocks = faults::isWholeSweep() ? 10'000 : 2'000;
  std::vector<int32_t> grid_header{blocks}, function_header{blocks};
  std::vector<float> coordinates, values;
  for (int32_t n = 0; n < blocks; ++n) {
    grid_header.insert(grid_header.end(), {kSide, kSide, kSide});
    function_header.insert(function_header.end(), {kSide, kSide, kSide, 1});
    for (int axis = 0; axis < 3; ++axis)
      for (int32_t node = 0; node < kSide * kSide * kSide; ++node) {
        const double x = n % 20 + node % kSide / 3.0, y = n / 20 % 20 + node / kSide % kSide / 3.0;
        const double z = n / 400 + node / (kSide * kSide) / 3.0;
        const double at[] = {0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, z + 0.1 * x};
        coordinates.push_back(static_cast<float>(at[axis]));
        if (axis == 0) values.push_back(static_cast<float>(z));
      }
  }
  const auto write = [](const std::string& path, const std::vector<int32_t>& header,
                        const std::vector<float>& numbers) {
    std::string bytes(reinterpret_cast<const char*>(header.data()), header.size() * sizeof(int32_t));
    bytes.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float));
    writeFileAtomically(path, bytes);
  };
  write(file("blocks.xyz"), grid_header, coordinates);
  write(file("blocks.fun"), function_header, values);
  run({"convert", file("blocks.xyz"), file("blocks.fun"), "-o", file("blocks.splats"), "--memory",
       mebibytes(kMebibytes), "--stats", file("blocks.json")});
  const auto stats = jsonOf(file("blocks.json"));
  expectAtMost(kMebibytes, stats["peak_memory_bytes"].get<uint64_t>());
}

TEST_F(LimitsTest, TheLayoutOfAFileWithLongRowsIsFoundWithinTheMemory) {
  constexpr uint64_t kMebibytes = 160;
  const std::array<int32_t, 3> size{500000, 8, 8};
  const std::string grid = file("zeros.xyz");
  writeFileAtomically(grid, std::as_bytes(std::span(size)));
  constexpr uint64_t kNodes = 500000 * 8 * 8;
  std::filesystem::resize_file(grid, sizeof size + 3 * sizeof(float) * kNodes);
  const uint64_t before = largestProgram();
  const ProgramResult result = runProgram(
      {"convert", grid, "--scalar", "none", "-o", file("none.splats"), "--memory", mebibytes(kMebibytes)});
  expectSays(result.err, "no scalar 'none'");
  if (!kIsSanitized) {
    EXPECT_LE(largestProgram(), std::max(before, kMebibytes));
  }
}

TEST_F(LimitsTest, AddingAScalarNamesTheLeastMemoryThatItTakes) {
  const auto add = [&](uint64_t least) {
    return Words{"convert", file("cube.xyz"),     file("cube.fun"), "--add-scalar",  "j",
                 "--to",    file("added.splats"), "--memory",       mebibytes(least)};
  };
  std::filesystem::copy(file("cube.splats"), file("added.splats"));
  const ProgramResult refused = runProgram(add(1));
  EXPECT_EQ(refused.status, 1);
  const uint64_t least = leastMebibytes(refused);
  ASSERT_GT(least, 1u);
  EXPECT_EQ(runProgram(add(least - 1)).status, 1);
  run(add(least));
}

TEST_F(LimitsTest, RenderingNamesTheLeastMemoryThatItTakes) {
  const ProgramResult refused = runProgram(render("least.png", {"--memory", "1"}));
  EXPECT_EQ(refused.status, 2);
  const uint64_t least = leastMebibytes(refused);
  ASSERT_GT(least, 1u);
  EXPECT_EQ(leastMebibytes(runProgram(render("least.png", {"--memory", mebibytes(least - 1)}))), least);
  EXPECT_FALSE(std::filesystem::exists(file("least.png")));
  EXPECT_EQ(rendered("least.png", {"--memory", mebibytes(least)}), rendered("much.png"));
}

TEST_F(LimitsTest, AHugePictureNamesItsMemoryBeforeItTakesAny) {
  constexpr uint64_t kPictureMebibytes = 16384 / 1024 * (16384 / 1024) * 16;
  for (const char* backend : {"cpu", "osmesa"}) {
    SCOPED_TRACE(backend);
    const ProgramResult refused =
        runProgram(render("huge.png", {"--size", "16384x16384", "--backend", backend}));
    EXPECT_EQ(refused.status, 2);
    EXPECT_GT(leastMebibytes(refused), kPictureMebibytes);
  }
  EXPECT_LT(largestProgram(), kPictureMebibytes / 4);
  EXPECT_EQ(runProgram(render("huge.png", {"--size", "16385x1"})).status, 2);
}

TEST_F(LimitsTest, FewAndManyThreadsDrawTheSame) {
  const std::string one = rendered("threads.pfm", {"--threads", "1"});
  EXPECT_EQ(rendered("threads.pfm", {"--threads", "64"}), one) << "as many of them as the memory is for";
  EXPECT_EQ(rendered("threads.pfm", {"--threads", "64", "--memory", "8G"}), one);
  EXPECT_EQ(runProgram(render("threads.pfm", {"--threads", "1025"})).status, 2);
  EXPECT_EQ(runProgram(render("threads.pfm", {"--threads", "-1"})).status, 2);
}

TEST_F(LimitsTest, FewAndManyThreadsConvertToTheSame) {
  for (const char* threads : {"1", "64"}) {
    SCOPED_TRACE(threads);
    run(cubeArguments(file("cube"), {"--overwrite", "--threads", threads, "--memory", "8G"},
                      file("threads.splats")));
    for (const char* name : {"manifest.json", "bricks.bin", "geometry.bin", "var.0.bin", "bricks.vdb"})
      EXPECT_EQ(readTextFile(file("threads.splats/") + name), readTextFile(file("cube.splats/") + name))
          << name;
  }
  EXPECT_EQ(runProgram(cubeArguments(file("cube"), {"--threads", "1025"}, file("no.splats"))).status, 2);
}

TEST_F(LimitsTest, APictureMayBeOnePixel) {
  for (const char* backend : {"cpu", "osmesa"})
    for (const char* name : {"one.png", "one.exr", "one.pfm"}) {
      SCOPED_TRACE(fmt::format("{} {}", backend, name));
      rendered(name, {"--size", "1x1", "--backend", backend, "--parallel-scale", "2", "--opacity-unit", "0.1",
                      "--background", "white"});
      const Image image = readImage(file(name));
      ASSERT_EQ(image.size.width, 1);
      ASSERT_EQ(image.size.height, 1);
      EXPECT_LT(image.pixel(0, 0)[0], 0.95f) << "white: nothing is drawn";
    }
}

TEST_F(LimitsTest, ALineOfPixelsHasRoomForAnnotations) {
  for (const char* size : {"1x1", "1x3000", "3000x1", "2x2"}) {
    SCOPED_TRACE(size);
    rendered("line.png", {"--size", size, "--scalar-bar", "--axes", "--outline", "--view-angle", "40",
                          "--first-image", file("first.png")});
  }
}

/// The root, and eights: with tools/test.sh --whole as many as 10^10 nodes take.
uint64_t brickCount() {
  return faults::isWholeSweep() ? 1'000'001 : 200'001;
}
/// The memory of 144 + 40 bytes a brick on disk, and what the program takes without them.
uint64_t maxMemoryBytes() {
  return (uint64_t{144} << 20) + 184 * brickCount();
}

class SparseCache : public ProgramSuite<SparseCache> {
 protected:
  static void prepare() { writeSparseCache(*folder_ / "sparse.splats", brickCount()); }

  struct Drawn {
    std::string picture;
    nlohmann::json statistics;
  };
  static Drawn draw(const std::string& cache, const Words& options) {
    run(Words{"render", cache, "-o", file("a.pfm"), "--size", "256x256", "--tf", "viridis", "--stats",
              file("a.json"), "--range", "0,32", "--view", "iso", "--opacity", "0:0.5,1:0.5",
              "--opacity-unit", "0.5"} +
        options);
    return {readTextFile(file("a.pfm")), jsonOf(file("a.json"))};
  }
};

TEST_F(SparseCache, IsDescribed) {
  const ProgramResult result = run({"info", file("sparse.splats"), "--json"});
  const auto info = nlohmann::json::parse(result.out);
  EXPECT_EQ(info["bricks"], brickCount());
  EXPECT_GT(info["splats"], 9'000 * brickCount());
}

/// The sparse cache's coarse levels are those of the lattice, of which the third is the finest.
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
      EXPECT_LE(sparse.statistics["peak_memory_bytes"], maxMemoryBytes());
    }
  }
}

}  // namespace
}  // namespace curvisplat
