// Codes of logarithms that are found several at once are those by std::log(), in every instruction set.
#include "stream/codec/log_codes.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace curvisplat {
namespace {

void expectCodesOfLogs(const std::vector<double>& values, double step) {
  std::vector<uint32_t> codes(values.size());
  const std::optional<LogCodes> found = logCodes(values, step, 0xffff, codes.data());
  ASSERT_TRUE(found);
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (const double value : values) {
    lowest = std::min(lowest, std::log(value));
    highest = std::max(highest, std::log(value));
  }
  EXPECT_EQ(found->lowest, lowest);
  EXPECT_EQ(found->largest, static_cast<uint32_t>((highest - lowest) / step) + 1);
  for (size_t n = 0; n < values.size(); ++n)
    ASSERT_EQ(codes[n], static_cast<uint32_t>((std::log(values[n]) - lowest) / step + 0.5)) << values[n];
}

class LogCodesTest : public testing::TestWithParam<int64_t> {
 protected:
  LogCodesTest() { hwy::SetSupportedTargetsForTest(GetParam()); }
  ~LogCodesTest() override { hwy::SetSupportedTargetsForTest(0); }
};
INSTANTIATE_TEST_SUITE_P(Targets, LogCodesTest, testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         [](const auto& target) { return hwy::TargetName(target.param); });

TEST_P(LogCodesTest, AreThoseByTheLibrary) {
  std::mt19937_64 random(1);
  for (const size_t count : {1u, 2u, 7u, 8u, 9u, 1000u, 20001u}) {
    for (const double scale : {1.0, 1e-30, 1e30, 1e-300}) {
      std::uniform_real_distribution<double> exponent(-40, 40);
      std::vector<double> values(count);
      for (double& value : values) value = scale * std::exp(exponent(random));
      expectCodesOfLogs(values, 0.014);
      expectCodesOfLogs(values, 0.0016);
    }
  }
}

TEST_P(LogCodesTest, BetweenTwoCodesAreThoseByTheLibrary) {
  // Half a step from a code, and the next numbers to either side.
  constexpr double kStep = 0.014;
  std::vector<double> values{1};
  for (int n = 0; n < 5000; ++n) {
    double value = std::exp((n + 0.5) * kStep);
    for (int m = 0; m < 4; ++m) value = std::nextafter(value, 0.0);
    for (int m = 0; m < 8; ++m) values.push_back(value = std::nextafter(value, 1e300));
  }
  expectCodesOfLogs(values, kStep);
}

TEST_P(LogCodesTest, OfEqualValuesAreZero) {
  expectCodesOfLogs(std::vector<double>(77, 0.3), 0.014);
  expectCodesOfLogs(std::vector<double>(77, std::numeric_limits<double>::denorm_min()), 0.014);
}

TEST_P(LogCodesTest, ThatDoNotFitAreRefused) {
  std::vector<uint32_t> codes(9);
  std::vector<double> values(9, 1.0);
  values[8] = std::exp(100 * 0.014);
  EXPECT_TRUE(logCodes(values, 0.014, 101, codes.data()));
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
  values[8] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
  values[8] = 0;  // a volume that underflows
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
  std::fill(values.begin(), values.end(), 0.0);
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
}

}  // namespace
}  // namespace curvisplat
