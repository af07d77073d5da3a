// `curvisplat render` of a cache with bricks that cannot be read.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/random_cache.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

TEST(DamagedCache, IsRefusedOrDrawnFromCoarserLevels) {
  const TemporaryFolder folder;
  const auto file = [&](const char* name) { return (folder / name).string(); };
  writeRandomCache(folder / "a.splats");
  const auto render = [&](const char* output, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"render", file("a.splats"), "-o",           file(output),
                                       "--size", "64x48",          "--lod-pixels", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return runProgram(arguments);
  };
  ProgramResult result = render("whole.exr", {});
  ASSERT_EQ(result.status, 0) << result.err;

  {
    const CacheReader cache(folder / "a.splats");
    std::fstream geometry(cache.geometryPath(), std::ios::in | std::ios::out | std::ios::binary);
    geometry.seekp(static_cast<std::streamoff>(cache.bricks().back().geometry.offset));
    geometry.put('\x55').put('\x5a').put('\xa5');
  }
  const std::string last = "brick " + std::to_string(CacheReader(folder / "a.splats").bricks().size() - 1);
  result = render("refused.exr", {});
  EXPECT_EQ(result.status, 1);
  EXPECT_NE(result.err.find(last), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(file("refused.exr")));

  result = render("coarser.exr", {"--keep-going", "--stats", file("stats.json")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.err.find("warning: 1 of "), std::string::npos) << result.err;
  EXPECT_NE(result.err.find(last), std::string::npos) << result.err;
  const auto stats = nlohmann::json::parse(readTextFile(file("stats.json")));
  const auto& unreadable = stats["frames"][0]["bricks_unreadable"];
  ASSERT_EQ(unreadable.size(), 1u);
  EXPECT_EQ("brick " + std::to_string(unreadable[0]["brick"].get<uint32_t>()), last);
  const double psnr_db = compareImages(readImage(file("coarser.exr")), readImage(file("whole.exr"))).psnr_db;
  EXPECT_TRUE(std::isfinite(psnr_db));
  EXPECT_GT(psnr_db, 15);
}

}  // namespace
}  // namespace curvisplat
