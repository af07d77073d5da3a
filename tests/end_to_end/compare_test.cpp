// `curvisplat compare`, as a person or a script calls it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class Compare : public ProgramTest {
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
};

TEST_F(Compare, ReportsIdenticalPicturesAcrossFormats) {
  const ProgramResult result = run({"compare", file("white.pfm"), file("white.png"), "--min-psnr", "200"});
  EXPECT_EQ(result.out, "identical\n");
}

TEST_F(Compare, ReportsPsnrAndTheWorstPixel) {
  const ProgramResult result = run({"compare", file("white.pfm"), file("dot.pfm"), "--min-psnr", "25.8"});
  // One of 96 values is off by a half: 10 log10(96 / 0.25).
  EXPECT_EQ(result.out, "PSNR 25.84 dB, largest difference 0.500000 at pixel (5, 2)\n");
}

TEST_F(Compare, FailsBelowTheLimit) {
  expectRefused({"compare", file("white.pfm"), file("dot.pfm"), "--min-psnr", "25.9"}, 1, {"25.84"});
}

TEST_F(Compare, WritesTheDifference) {
  run({"compare", file("white.pfm"), file("dot.pfm"), "--difference", file("difference.png")});
  const Image difference = readImage(file("difference.png"));
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 8; ++x) EXPECT_EQ(difference.pixel(x, y)[0], x == 5 && y == 2 ? 1 : 0);
}

TEST_F(Compare, RefusesOtherSizes) {
  expectRefused({"compare", file("white.pfm"), file("turned.pfm")}, 1, {"turned.pfm"});
}

}  // namespace
}  // namespace curvisplat
