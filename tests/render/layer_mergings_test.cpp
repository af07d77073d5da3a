// How a picture has layers of thin cells merged: by its pixels and its transfer function.
#include "render/frame/layer_mergings.h"

#include <gtest/gtest.h>

#include <cmath>

namespace curvisplat {
namespace {

using FunctionValue = TransferFunction::Value;

/// Grey from black to white, equally opaque everywhere.
ClassificationTable ramp(double extinction) {
  return {[=](double f) { return FunctionValue{glm::dvec3(f), extinction}; }, 0, 1};
}

std::shared_ptr<const LayerMerging> mergingOf(const ClassificationTable& table, double length = 1) {
  return LayerMergings().of(length, {table, nullptr, glm::dvec3(1.0)});
}

size_t binsOf(const LayerMerging& merging) {
  return size_t{merging.bins.bins.back()} + 1;
}

TEST(LayerMergings, AVoxelHasTheLengthThatIsAllowed) {
  const ClassificationTable table = ramp(1);
  LayerMergings mergings;
  const glm::dvec3 scale(1, 2, 50);
  for (double length = 1e-4; length < 1e4; length *= 1.37) {
    const auto merging = mergings.of(length, {table, nullptr, scale});
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(merging->voxel[axis] * scale[axis], 1.64 * length);
      EXPECT_GT(merging->voxel[axis] * scale[axis], 1.37 * length);
    }
  }
  for (const double length : {0.0, -1.0, HUGE_VAL, std::nan("")})
    EXPECT_FALSE(mergings.of(length, {table, nullptr, scale}));
}

TEST(LayerMergings, IsTheSameUntilSomethingChanges) {
  const ClassificationTable table = ramp(1);
  LayerMergings mergings;
  const auto first = mergings.of(1, {table, nullptr, glm::dvec3(1.0)});
  EXPECT_EQ(first, mergings.of(1.02, {table, nullptr, glm::dvec3(1.0)}));
  const auto longer = mergings.of(1.3, {table, nullptr, glm::dvec3(1.0)});
  EXPECT_NE(first->number, longer->number);
  EXPECT_NE(first->number, mergings.of(1, {table, nullptr, glm::dvec3(1, 1, 2)})->number);
  EXPECT_NE(first->number, mergingOf(table)->number);
}

TEST(LayerMergings, WhatIsNearlyTransparentIsAlike) {
  EXPECT_EQ(binsOf(*mergingOf(ramp(0.001))), 1u);
  const size_t opaque = binsOf(*mergingOf(ramp(100)));
  EXPECT_GT(opaque, 10u);
  EXPECT_LT(opaque, 100u);
  EXPECT_GT(opaque, binsOf(*mergingOf(ramp(0.2))));
  EXPECT_LT(binsOf(*mergingOf(ramp(1), 0.1)), binsOf(*mergingOf(ramp(1), 1)));
}

TEST(LayerMergings, AStepOfTheFunctionDivides) {
  const auto merging = mergingOf({[](double f) {
                                    return FunctionValue{glm::dvec3(0.5), f > 0.5 ? 10.0 : 0.0};
                                  },
                                  0, 1});
  EXPECT_EQ(merging->bins.of(0.1f), merging->bins.of(0.49f));
  EXPECT_NE(merging->bins.of(0.49f), merging->bins.of(0.51f));
  EXPECT_EQ(merging->bins.of(0.51f), merging->bins.of(0.9f));
  EXPECT_EQ(merging->bins.of(0.9f), merging->bins.of(100.0f));
  EXPECT_EQ(merging->bins.of(0.1f), merging->bins.of(-100.0f));
}

TEST(LayerMergings, ColoursOfASecondScalarDivideWhereTheFirstIsOpaque) {
  const ClassificationTable colours = ramp(1);
  const auto merged = [&](const ClassificationTable& table) {
    return LayerMergings().of(1, {table, &colours, glm::dvec3(1.0)});
  };
  EXPECT_GT(merged(ramp(10))->second_bins->bins.back(), 10);
  EXPECT_EQ(merged(ramp(0.001))->second_bins->bins.back(), 0);
}

}  // namespace
}  // namespace curvisplat
