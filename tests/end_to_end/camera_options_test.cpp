// Options of the camera: turned on top of where it is, and fitted to what a clip box leaves.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class CameraOptions : public ProgramSuite<CameraOptions> {
 protected:
  static void prepare() { madeCache(file("a"), "half-annulus", "48x24x24"); }

  static Image render(const Words& options, const std::string& output = "a.exr") {
    last_ = run(sized(
        Words{"render", file("a.splats"), "-o", file(output), "--background", "white"} + options, "96x96"));
    return readImage(file(output));
  }
  static nlohmann::json cameraOf(const Words& options) {
    render(options + Words{"--stats", file("stats.json")});
    return jsonOf(file("stats.json"))["frames"][0]["camera"];
  }

  static inline ProgramResult last_;
};

TEST_F(CameraOptions, ACameraIsTurnedOnTopOfWhereItIs) {
  const auto expectAlike = [](const Words& turned, const Words& placed, double least_db = 60) {
    const Image a = render(turned, "a.exr"), b = render(placed, "b.exr");
    EXPECT_GT(compareImages(a, b).psnr_db, least_db) << testing::PrintToString(turned);
  };
  expectAlike({"--view", "+x", "--azimuth", "90"}, {"--view", "+y"});
  expectAlike({"--view", "+x", "--azimuth=-45", "--elevation", "35.264389682754654"},
              {"--position", "9.5,-10,10.5"});
  expectAlike({"--position", "9.5,0,0.5", "--azimuth", "45", "--elevation", "35.264389682754654"},
              {"--view", "iso"});
  expectAlike({"--view", "+x", "--view-angle", "40", "--azimuth", "90"},
              {"--view", "+y", "--view-angle", "40"});
  expectAlike({"--view", "+z", "--roll", "90"}, {"--position", "-0.5,0,9", "--view-up", "1,0,0"});
  expectAlike({"--view", "+z", "--parallel-scale", "3", "--zoom", "2"},
              {"--view", "+z", "--parallel-scale", "1.5"});
  nlohmann::json wide = cameraOf({"--view", "+z", "--view-angle", "40"});
  EXPECT_EQ(wide["view_angle_deg"], 40);
  wide["view_angle_deg"] = 20.0;
  EXPECT_EQ(cameraOf({"--view", "+z", "--view-angle", "40", "--zoom", "2"}), wide);
  EXPECT_LT(compareImages(render({"--view", "+z"}), render({"--view", "+z", "--zoom", "2"})).psnr_db, 30);
  // On top of the one that was chosen; what is printed is where it was before.
  render({"--azimuth", "30", "--zoom", "1.25"}, "a.exr");
  const std::string words = "chosen from the data: ", out = last_.out;
  std::istringstream chosen(out.substr(out.find(words) + words.size()));
  Words again{"--azimuth", "30", "--zoom", "1.25"};
  for (std::string word; chosen >> word;) again.push_back(word);
  expectSays(out, "--position");
  EXPECT_EQ(compareImages(readImage(file("a.exr")), render(again, "b.exr")).largest, 0) << out;
}

/// The printed choice has the scale, so that it draws the same picture when the data or the box are others.
TEST_F(CameraOptions, TheScaleThatFitsIsPrinted) {
  for (const Words& view : {Words{"--view", "+x"},
                            {"--position", "1,7,3"},
                            {"--view", "iso", "--azimuth", "20", "--roll", "30", "--zoom", "1.5"}}) {
    const nlohmann::json camera = cameraOf(view);
    const std::string words = "--parallel-scale ", out = last_.out;
    ASSERT_NE(out.find(words), std::string::npos) << testing::PrintToString(view) << out;
    const double zoom = view.back() == "1.5" ? 1.5 : 1,
                 printed = std::stod(out.substr(out.find(words) + words.size()));
    EXPECT_NEAR(printed / zoom, camera["parallel_scale"], 1e-12) << testing::PrintToString(view);
    EXPECT_EQ(cameraOf(view + Words{"--parallel-scale", fmt::format("{}", printed)}), camera);
    EXPECT_EQ(last_.out.find(words), std::string::npos) << last_.out;
  }
  cameraOf({"--view", "+x", "--view-angle", "30"});
  EXPECT_EQ(last_.out.find("--parallel-scale"), std::string::npos) << last_.out;
}

TEST_F(CameraOptions, AViewFitsWhatAClipBoxLeaves) {
  const auto lineOf = [](const Image& image, bool row) {  // pixels that are drawn, of the rows or the columns
    std::set<int> drawn;
    for (int y = 0; y < image.size.height; ++y)
      for (int x = 0; x < image.size.width; ++x)
        if (image.pixel(x, y)[1] != 1) drawn.insert(row ? y : x);
    return std::max(drawn.size(), size_t{1});
  };
  const Words box{"--clip-box", "-0.6,-0.3,0.5,0.8,0.2,0.5"};
  for (const Words& view :
       {Words{"--view", "+z"}, {"--position", "1,7,3"}, {"--view", "iso", "--view-angle", "30"}, {}}) {
    const Image clipped = render(view + box);
    EXPECT_GT(std::max(lineOf(clipped, true), lineOf(clipped, false)), 80u) << testing::PrintToString(view);
    EXPECT_EQ(clipped.pixel(0, 0)[1], 1) << testing::PrintToString(view);
  }
  // Nothing is left, or all is shown anyway.
  const Words outside{"--view", "+z", "--outline", "--clip-box", "50,51,0,1,0,1"},
      none{"--view", "+z", "--outline"};
  EXPECT_EQ(cameraOf(outside), cameraOf(none));
  EXPECT_EQ(cameraOf(none + box), cameraOf(none));
}

}  // namespace
}  // namespace curvisplat
