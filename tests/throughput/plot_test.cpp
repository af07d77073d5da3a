// Plots, by their pixels: bars are as long as their values, points are where they belong.
#include "tools/throughput/plot.h"
#include "render/image/image_file.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render/image/image.h"
#include "stream/base/file.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

Image imageOf(const std::vector<std::byte>& png) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "plot.png", png);
  return readImage(folder / "plot.png");
}

struct Colour {
  float r, g, b;
  bool is(const float* pixel) const {
    return std::abs(pixel[0] - r) < 0.02f && std::abs(pixel[1] - g) < 0.02f && std::abs(pixel[2] - b) < 0.02f;
  }
};
constexpr int kBelowTheKey = 98;
constexpr Colour kFirst{0.00f, 0.45f, 0.70f}, kSecond{0.84f, 0.37f, 0.00f};

/// How many pixels of a colour there are in each row, below the key.
std::vector<int> rowsOf(const Image& image, const Colour& colour) {
  std::vector<int> rows(static_cast<size_t>(image.size.height));
  for (int y = kBelowTheKey; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x) rows[static_cast<size_t>(y)] += colour.is(image.pixel(x, y));
  return rows;
}
std::vector<int> columnsOf(const Image& image, const Colour& colour) {
  std::vector<int> columns(static_cast<size_t>(image.size.width));
  for (int y = kBelowTheKey; y < image.size.height; ++y)
    for (int x = 0; x < image.size.width; ++x)
      columns[static_cast<size_t>(x)] += colour.is(image.pixel(x, y));
  return columns;
}
/// The middles of the runs of numbers of at least `least`.
std::vector<double> middlesOf(const std::vector<int>& numbers, int least) {
  std::vector<double> middles;
  for (size_t n = 0; n < numbers.size(); ++n) {
    if (numbers[n] < least) continue;
    const size_t begin = n;
    while (n < numbers.size() && numbers[n] >= least) ++n;
    middles.push_back(0.5 * static_cast<double>(begin + n - 1));
  }
  return middles;
}

TEST(BarPlot, BarsAreAsLongAsTheirValues) {
  const BarPanel panel{"Title", "seconds", {{"one", 1, "1 s", 0}, {"three", 3, "3 s", 0}}, {}};
  const Image image = imageOf(drawPlot(std::vector{panel}));
  const std::vector<int> rows = rowsOf(image, kFirst);
  std::vector<int> lengths;
  for (const double middle : middlesOf(rows, 1)) lengths.push_back(rows[static_cast<size_t>(middle)]);
  ASSERT_EQ(lengths.size(), 2u);
  EXPECT_NEAR(lengths[1], 3.0 * lengths[0], 4);
  EXPECT_GT(lengths[0], 50);
}

TEST(BarPlot, OfNothingButZerosIsAPlot) {
  const BarPanel panel{"Title", "seconds", {{"none", 0, "0 s", 0}}, {}};
  EXPECT_GT(imageOf(drawPlot(std::vector{panel})).size.width, 100);
}

LinePanel panelOf(std::vector<PlotLine> lines, bool log_values) {
  return {"Title",   "size", "MiB/s", std::move(lines), [](double x) { return fmt::format("{:g}", x); },
          log_values};
}

TEST(LinePlot, PointsStandAtEqualRatios) {
  const Image image = imageOf(
      drawPlot(std::vector{panelOf({{"flat", {{4, 10}, {16, 10}, {64, 10}}}, {"other", {{4, 1}}}}, false)}));
  const std::vector<double> dots = middlesOf(columnsOf(image, kFirst), 8);  // the line is thinner
  ASSERT_EQ(dots.size(), 3u);
  EXPECT_NEAR(dots[1] - dots[0], dots[2] - dots[1], 2);
  EXPECT_GT(dots[1] - dots[0], 100);
}

TEST(LinePlot, ValuesStandWhereTheyBelong) {
  const auto heightsOf = [](double value, bool log_values) {
    const LinePanel panel =
        panelOf({{"flat", {{1, value}, {2, value}}}, {"ends", {{1, 1}, {2, 100}}}}, log_values);
    const Image image = imageOf(drawPlot(std::vector{panel}));
    const std::vector<double> level = middlesOf(rowsOf(image, kFirst), 300);
    const std::vector<int> ends = rowsOf(image, kSecond);
    const auto top = std::find_if(ends.begin(), ends.end(), [](int n) { return n > 0; }) - ends.begin();
    const auto bottom =
        ends.rend() - std::find_if(ends.rbegin(), ends.rend(), [](int n) { return n > 0; }) - 1;
    EXPECT_EQ(level.size(), 1u);
    return (static_cast<double>(bottom) - level.at(0)) / static_cast<double>(bottom - top);
  };
  EXPECT_NEAR(heightsOf(10, true), 0.5, 0.02);
  EXPECT_NEAR(heightsOf(50.5, false), 0.5, 0.02);
}

TEST(LinePlot, DrawsOnePointWithoutALine) {
  const LinePanel panel{
      "Title", "size", "MiB/s", {{"only", {{4, 0}}}}, [](double) { return std::string("4"); }};
  const Image image = imageOf(drawPlot(std::vector{panel}));
  EXPECT_EQ(middlesOf(rowsOf(image, kFirst), 1).size(), 1u);
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
