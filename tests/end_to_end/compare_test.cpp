// `curvisplat compare`, as a person or a script calls it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class Compare : public testing::Test {
 protected:
  Compare() {
    Image image({8, 4});
    std::fill(image.rgba.begin(), image.rgba.end(), 1.0f);
    writeImage(image, folder_ / "white.pfm");
    writeImage(image, folder_ / "white.png");
    image.pixel(5, 2)[0] = 0.5f;
    writeImage(image, folder_ / "dot.pfm");
    writeImage(Image({4, 8}), folder_ / "turned.pfm");
  }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  TemporaryFolder folder_;
};

TEST_F(Compare, ReportsIdenticalPicturesAcrossFormats) {
  const ProgramResult result =
      runProgram({"compare", file("white.pfm"), file("white.png"), "--min-psnr", "200"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out, "identical\n");
}

TEST_F(Compare, ReportsPsnrAndTheWorstPixel) {
  const ProgramResult result =
      runProgram({"compare", file("white.pfm"), file("dot.pfm"), "--min-psnr", "25.8"});
  EXPECT_EQ(result.status, 0) << result.err;
  // One of 96 values is off by a half: 10 log10(96 / 0.25).
  EXPECT_EQ(result.out, "PSNR 25.84 dB, largest difference 0.500000 at pixel (5, 2)\n");
}

TEST_F(Compare, FailsBelowTheLimit) {
  const ProgramResult result =
      runProgram({"compare", file("white.pfm"), file("dot.pfm"), "--min-psnr", "25.9"});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1);
  EXPECT_NE(result.err.find("25.84"), std::string::npos) << result.err;
}

TEST_F(Compare, WritesTheDifference) {
  const ProgramResult result =
      runProgram({"compare", file("white.pfm"), file("dot.pfm"), "--difference", file("difference.png")});
  EXPECT_EQ(result.status, 0) << result.err;
  const Image difference = readImage(file("difference.png"));
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 8; ++x) EXPECT_EQ(difference.pixel(x, y)[0], x == 5 && y == 2 ? 1 : 0);
}

TEST_F(Compare, RefusesOtherSizes) {
  const ProgramResult result = runProgram({"compare", file("white.pfm"), file("turned.pfm")});
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1);
  EXPECT_NE(result.err.find("turned.pfm"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace curvisplat
