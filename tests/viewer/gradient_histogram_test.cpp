#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "tools/view/gradient_histogram.h"

namespace curvisplat {
namespace {

/// Half of the volume is flat, the other half has magnitudes from 1 to 100, each decade as much.
GradientPercentiles halfFlat() {
  std::vector<float> magnitudes(1000, 0.0f);
  for (int n = 0; n < 1000; ++n) magnitudes.push_back(static_cast<float>(std::pow(10, 2 * n / 999.0)));
  return {magnitudes, std::vector<float>(2000, 0.5f)};
}

TEST(GradientHistogram, HasTheSharesOfTheVolumeOnALogarithmicAxis) {
  const GradientHistogram histogram(halfFlat(), 10);
  const std::vector<double>& shares = histogram.shares();
  ASSERT_EQ(shares.size(), 10u);
  EXPECT_NEAR(std::accumulate(shares.begin(), shares.end(), 0.0), 1, 1e-12);
  EXPECT_NEAR(shares[0], 0.55, 0.01);
  for (size_t n = 1; n < 10; ++n) EXPECT_NEAR(shares[n], 0.05, 0.01) << n;
  EXPECT_NEAR(histogram.magnitudeAt(0.5), 10, 0.5);
  EXPECT_NEAR(histogram.coordinateOf(10), 0.5, 0.02);
  EXPECT_EQ(histogram.coordinateOf(0), 0);
  EXPECT_EQ(histogram.coordinateOf(1e6), 1);
}

TEST(GradientHistogram, SharesAndMagnitudesAreInverse) {
  const GradientPercentiles percentiles = halfFlat();
  for (const double share : {0.6, 0.75, 0.999})
    EXPECT_NEAR(percentiles.shareBelow(percentiles.magnitudeAt(share)), share, 1e-6);
  EXPECT_EQ(percentiles.shareBelow(0), 0);
  EXPECT_NEAR(percentiles.shareBelow(10), 0.75, 0.005);
  EXPECT_EQ(percentiles.shareBelow(1000), 1);
}

TEST(GradientHistogram, IsEmptyWhereNothingChanges) {
  const GradientHistogram histogram(GradientPercentiles({}, {}), 10);
  EXPECT_TRUE(histogram.shares().empty());
  EXPECT_EQ(histogram.magnitudeAt(0.5), 0);
  EXPECT_EQ(histogram.coordinateOf(1), 0);
}

TEST(GradientHistogram, NamesTheUnitOfTheScalarPerLength) {
  VariableInfo scalar;
  EXPECT_EQ(gradientText(0.25, scalar, false), "0.25 per length");
  scalar.unit = "K";
  EXPECT_EQ(gradientText(0.25, scalar, true), "0.25 K per km");
}

}  // namespace
}  // namespace curvisplat
