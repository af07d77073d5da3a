#include "tools/throughput/measurements.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace curvisplat {
namespace {

TEST(Measurements, MedianIsTheMiddleSampleOrTheMeanOfTwo) {
  EXPECT_EQ(medianOf({7}), 7);
  EXPECT_EQ(medianOf({9, 1, 4}), 4);
  EXPECT_EQ(medianOf({8, 1, 4, 2}), 3);
}

TEST(Measurements, SpreadIsHalfTheRangeOverTheMedian) {
  EXPECT_EQ(spreadOf({5}), 0);
  EXPECT_DOUBLE_EQ(spreadOf({9, 10, 13}), 0.2);
  EXPECT_EQ(spreadOf({0, 0}), 0);
}

TEST(Measurements, KnowsWhatIsBetter) {
  EXPECT_TRUE((Measurement{"a", "splats/s", {1}}).moreIsBetter());
  EXPECT_TRUE((Measurement{"a", "B/s", {1}}).moreIsBetter());
  EXPECT_FALSE((Measurement{"a", "s", {1}}).moreIsBetter());
  EXPECT_FALSE((Measurement{"a", "B", {1}}).moreIsBetter());
}

TEST(Measurements, AreFoundByName) {
  Measurements measurements;
  measurements.add("a/b:1", "s", {3, 1, 2});
  EXPECT_EQ(measurements.median("a/b:1"), 2);
  EXPECT_EQ(measurements.median("a/b:2"), std::nullopt);
  ASSERT_NE(measurements.find("a/b:1"), nullptr);
  EXPECT_EQ(measurements.find("a/b:1")->samples, (std::vector<double>{3, 1, 2}));
}

TEST(Measurements, AsJsonKeepEverySampleAndEveryReason) {
  Measurements measurements;
  measurements.add("disk/direct", "B/s", {3, 1, 2});
  measurements.leaveOut("disk/cold", "tmpfs has no disk");
  EXPECT_EQ(measurements.toJson().dump(),
            R"([{"name":"disk/direct","unit":"B/s","better":"more","median":2.0,"samples":[3.0,1.0,2.0]}])");
  EXPECT_EQ(measurements.leftOutAsJson().dump(), R"([{"name":"disk/cold","reason":"tmpfs has no disk"}])");
}

TEST(MeasurementsDeath, ANameComesOnceAndSamplesAreNumbers) {
  Measurements measurements;
  measurements.add("a", "s", {1});
  EXPECT_DEATH(measurements.add("a", "s", {1}), "internal error");
  EXPECT_DEATH(measurements.add("b", "s", {}), "internal error");
  EXPECT_DEATH(measurements.add("b", "s", {std::numeric_limits<double>::infinity()}), "internal error");
}

}  // namespace
}  // namespace curvisplat
