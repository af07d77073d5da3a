// Plots, by their pixels: bars are as long as their values, points are where they belong.
#include "tools/bench/plot.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "render/image.h"
#include "stream/file.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

Image imageOf(const std::vector<std::byte>& png) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "plot.png", png);
  return readImage(folder / "plot.png");
}

bool isBlue(const float* pixel) {  // the first colour, (0, 0.45, 0.70)
  return pixel[0] < 0.02f && std::abs(pixel[1] - 0.45f) < 0.02f && std::abs(pixel[2] - 0.70f) < 0.02f;
}

/// The pixels of the first colour, row by row: how many, and where the first one is.
struct Row {
  int count = 0, first = 0;
};
std::vector<Row> blueRows(const Image& image) {
  std::vector<Row> rows(static_cast<size_t>(image.size.height));
  for (int y = 0; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x)
      if (isBlue(image.pixel(x, y))) {
        Row& row = rows[static_cast<size_t>(y)];
        if (row.count++ == 0) row.first = x;
      }
  return rows;
}

TEST(BarPlot, BarsAreAsLongAsTheirValues) {
  const BarPanel panel{"Title", "seconds", {{"one", 1, "1 s", 0}, {"three", 3, "3 s", 0}}, {}};
  const Image image = imageOf(drawPlot(std::vector{panel}));
  std::vector<int> lengths;  // of the two bars, by their rows
  int before = 0;
  for (const Row& row : blueRows(image)) {
    if (row.count > 0 && before == 0) lengths.push_back(0);
    if (row.count > 0) lengths.back() = std::max(lengths.back(), row.count);
    before = row.count;
  }
  ASSERT_EQ(lengths.size(), 2u);
  EXPECT_NEAR(lengths[1], 3.0 * lengths[0], 4);
  EXPECT_GT(lengths[0], 50);
}

TEST(BarPlot, OfNothingButZerosIsAPlot) {
  const BarPanel panel{"Title", "seconds", {{"none", 0, "0 s", 0}}, {}};
  EXPECT_GT(imageOf(drawPlot(std::vector{panel})).size.width, 100);
}

/// Columns and rows of the middle of the dots, from the left.
TEST(LinePlot, PointsStandAtEqualRatiosAndTheirHeights) {
  const LinePanel panel{"Title", "size", "MiB/s", {{"only", {{4, 10}, {16, 10}, {64, 10}}}}, [](double x) {
                          return std::to_string(static_cast<int>(x));
                        }};
  const Image flat = imageOf(drawPlot(std::vector{panel}));
  int top = flat.size.height, bottom = 0;
  for (int y = 0; y < flat.size.height; ++y)
    if (blueRows(flat)[static_cast<size_t>(y)].count > 0) {
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  EXPECT_LT(bottom - top, 20) << "a level line";
}

TEST(LinePlot, DrawsOnePointWithoutALine) {
  const LinePanel panel{
      "Title", "size", "MiB/s", {{"only", {{4, 0}}}}, [](double) { return std::string("4"); }};
  const Image image = imageOf(drawPlot(std::vector{panel}));
  int blue = 0;
  for (const Row& row : blueRows(image)) blue += row.count;
  EXPECT_GT(blue, 10);
}

TEST(Plots, PanelsStandSideBySide) {
  const BarPanel panel{"Title", "seconds", {{"a", 1, "1 s", 0}}, {"first", "second"}};
  const Image one = imageOf(drawPlot(std::vector{panel}));
  const Image two = imageOf(drawPlot(std::vector{panel, panel}));
  EXPECT_EQ(two.size.width, 2 * one.size.width);
  EXPECT_EQ(two.size.height, one.size.height);
}

}  // namespace
}  // namespace curvisplat
