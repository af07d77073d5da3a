// --lod-pixels at its default against the finest level: coarser where the function hides it, and nowhere else.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

const std::vector<std::string> kStep = {"--opacity", "0:0,0.499:0,0.501:0.9,1:0.9"};
const std::vector<std::string> kEven = {"--opacity", "0:0.3,1:0.3", "--tf", "grey"};
const std::vector<std::string> kFaint = {"--opacity", "0:0.01,1:0.03"};

class DefaultDetail : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    for (const auto& [scene, size] :
         {std::pair{"half-annulus", "192x96x96"}, std::pair{"sheared-waves", "128x128x128"}}) {
      run({"generate", scene, "--size", size, "-o", file(scene)});
      run({"convert", file(scene) + ".xyz", file(scene) + ".fun", "-o", file(scene) + ".splats"});
    }
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string file(const std::string& name) { return (*folder_ / name).string(); }
  static void run(const std::vector<std::string>& arguments) {
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
  }
  /// Draws `scene` as `name`.pfm. Returns the number of splats.
  static uint64_t draw(const std::string& scene, const std::string& name,
                       const std::vector<std::string>& options, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{
        "render",  file(scene + ".splats"), "-o", file(name + ".pfm"), "--size", "128x128",
        "--stats", file("stats.json")};
    arguments.insert(arguments.end(), options.begin(), options.end());
    arguments.insert(arguments.end(), more.begin(), more.end());
    run(arguments);
    return nlohmann::json::parse(readTextFile(file("stats.json")))["frames"][0]["splats_drawn"];
  }
  static double psnr(const std::string& a, const std::string& b) {
    return compareImages(readImage(file(a + ".pfm")), readImage(file(b + ".pfm"))).psnr_db;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};

std::unique_ptr<TemporaryFolder> DefaultDetail::folder_;

TEST_F(DefaultDetail, HoldsFiftyDecibelsAgainstTheFinestLevel) {
  for (const char* scene : {"half-annulus", "sheared-waves"}) {
    for (const char* view : {"iso", "+x"}) {
      for (const auto& function : {std::vector<std::string>{}, kStep, kEven, kFaint}) {
        std::vector<std::string> options{"--view", view};
        options.insert(options.end(), function.begin(), function.end());
        const uint64_t finest = draw(scene, "finest", options, {"--lod-pixels", "0"});
        const uint64_t drawn = draw(scene, "drawn", options);
        const double psnr_db = psnr("finest", "drawn");
        fmt::print("{} {} {}: {} of {} splats, {:.1f} dB\n", scene, view, function.empty() ? "" : function[1],
                   drawn, finest, psnr_db);
        EXPECT_GE(psnr_db, 50) << scene << ' ' << view;
        EXPECT_LE(drawn, finest);
      }
    }
  }
}

/// Where only the geometry counts, as in lit pictures, the error on the screen alone decides. Along an axis of the lattice its
/// ripples would show.
TEST_F(DefaultDetail, DrawsFewerSplatsWhereTheFunctionHidesTheirDetail) {
  const auto splatsOf = [](std::vector<std::string> options, const std::vector<std::string>& more) {
    options.insert(options.end(), more.begin(), more.end());
    return draw("half-annulus", "drawn", options);
  };
  const uint64_t lit = splatsOf({"--view", "iso", "--shade"}, {});
  EXPECT_LE(1.5 * static_cast<double>(splatsOf({"--view", "iso"}, {})), static_cast<double>(lit));
  EXPECT_LE(3 * splatsOf({"--view", "iso"}, kFaint), lit);
  EXPECT_LE(3 * splatsOf({"--view", "iso"}, kEven), lit);
  EXPECT_EQ(splatsOf({"--view", "+x"}, kEven), splatsOf({"--view", "+x", "--shade"}, kEven));
  // At 4 pixels and more nothing is hidden further.
  const std::vector<std::string> coarse = {"--view", "iso", "--lod-pixels", "4"};
  EXPECT_EQ(splatsOf({}, coarse), splatsOf({"--shade"}, coarse));
}

/// A step may lie in every brick.
TEST_F(DefaultDetail, KeepsStepsAsTheyWere) {
  std::string steps = "0:0.9";
  for (int n = 1; n < 20; ++n)
    steps += fmt::format(",{}:{},{}:{}", 0.05 * n, n % 2 ? 0.9 : 0.1, 0.05 * n + 0.001, n % 2 ? 0.1 : 0.9);
  const std::vector<std::string> function = {
      "--view", "iso", "--range", "0,1", "--opacity", steps + ",1:0.1", "--opacity-unit", "0.2"};
  EXPECT_EQ(draw("sheared-waves", "drawn", function), draw("sheared-waves", "lit", function, {"--shade"}));
}

TEST_F(DefaultDetail, MorePixelsNeverDrawMoreSplats) {
  uint64_t finer = UINT64_MAX;
  for (const char* lod_pixels : {"0", "0.3", "0.5", "1", "1.5", "2", "3", "4", "8", "1000"}) {
    const uint64_t drawn = draw("half-annulus", "drawn", {"--view", "iso", "--lod-pixels", lod_pixels});
    EXPECT_LE(drawn, finer) << lod_pixels;
    finer = drawn;
  }
}

}  // namespace
}  // namespace curvisplat
