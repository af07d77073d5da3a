// Layers of thin cells, merged in a decoded brick.
#include "stream/paging/layer_merger.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <numeric>

#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr float kLength = 4;

/// Columns of cells of kLength x kLength, each `thickness` thick, with the scalar `slope` z.
struct Layers {
  SplatGeometry geometry;
  SplatVariable values;

  Layers(size_t columns, size_t layers, float thickness, float slope = 0) {
    geometry.resize(columns * layers);
    values.resize(columns * layers);
    for (size_t n = 0; n < geometry.size(); ++n) {
      const auto column = static_cast<float>(n % columns);
      geometry.x[n] = (column + 0.5f) * kLength;
      geometry.y[n] = 0.5f * kLength;
      geometry.z[n] = (static_cast<float>(n / columns) + 0.5f) * thickness;
      geometry.axis0[n] = geometry.axis1[n] = kLength;
      geometry.axis2[n] = thickness;
      geometry.weight[n] = kLength * kLength * thickness;
      geometry.growth_code[n] = 1;
      values.mean[n] = slope * geometry.z[n];
      values.slope2[n] = slope * thickness;
    }
  }
  void merge(const LayerMerging& merging, double largest_radius = 10) {
    LayerMerger().merge(merging, largest_radius, geometry, values, nullptr);
  }
};

/// One bin for each unit from 0 to `count`.
ScalarBins bins(size_t count) {
  ScalarBins made{false, 1, 0, std::vector<uint16_t>(count + 2)};
  std::iota(made.bins.begin(), made.bins.end(), uint16_t{0});
  return made;
}

LayerMerging voxelsOf(double length, size_t bin_count = 1000) {
  return {1, glm::dvec3(length), bins(bin_count)};
}

TEST(LayerMerger, AColumnBecomesTheCellThatItsCellsMakeUp) {
  const float slope = 0.25f;
  Layers layers(3, 16, 0.125f, slope);
  layers.merge(voxelsOf(0.5));
  ASSERT_EQ(layers.geometry.size(), 12u);  // 3 columns of 4 voxels
  for (size_t n = 0; n < 12; ++n) {
    const SplatGeometry& g = layers.geometry;
    EXPECT_FLOAT_EQ(g.x[n], (static_cast<float>(n % 3) + 0.5f) * kLength);
    EXPECT_FLOAT_EQ(g.z[n], (static_cast<float>(n / 3) + 0.5f) * 0.5f);
    EXPECT_FLOAT_EQ(g.axis0[n], kLength);
    EXPECT_FLOAT_EQ(g.axis1[n], kLength);
    EXPECT_FLOAT_EQ(g.axis2[n], 0.5f);
    EXPECT_FLOAT_EQ(g.weight[n], 0.5f * kLength * kLength);
    EXPECT_EQ(g.growth_code[n], kNoGrowth);
    EXPECT_FLOAT_EQ(layers.values.mean[n], slope * g.z[n]);
    EXPECT_FLOAT_EQ(layers.values.slope2[n], slope * 0.5f);
    EXPECT_NEAR(layers.values.variance[n], 0, 1e-7);
  }
}

TEST(LayerMerger, ColumnsStayApartInVoxelsThatAreLongerThanTheirCells) {
  for (const double voxel : {0.7, 1.0, 1.5, 2.0, 2.5}) {
    Layers layers(10, 16, 0.125f);
    layers.merge(voxelsOf(voxel * kLength));
    EXPECT_LT(layers.geometry.size(), 50u) << voxel;
    for (const float axis : layers.geometry.axis0) EXPECT_FLOAT_EQ(axis, kLength) << voxel;
    for (const float axis : layers.geometry.axis1) EXPECT_FLOAT_EQ(axis, kLength) << voxel;
  }
}

TEST(LayerMerger, WhatTheFunctionTellsApartStaysApart) {
  Layers layers(1, 4, 0.125f, 8);  // the values 0.5, 1.5, 2.5, 3.5
  layers.merge(voxelsOf(0.5));
  EXPECT_EQ(layers.geometry.size(), 4u);
  Layers alike(1, 4, 0.125f, 8);
  alike.merge(voxelsOf(0.5, 1));  // all but the first lie above the only bin
  EXPECT_EQ(alike.geometry.size(), 2u);
}

TEST(LayerMerger, OtherCellsStayAsTheyAre) {
  const auto expectUnchanged = [](const Layers& before, double voxel) {
    Layers after = before;
    after.merge(voxelsOf(voxel));
    EXPECT_EQ(after.geometry.size(), before.geometry.size());
    EXPECT_EQ(after.geometry.axis2, before.geometry.axis2);
    EXPECT_EQ(after.geometry.growth_code, before.geometry.growth_code);
    EXPECT_EQ(after.values.mean, before.values.mean);
  };
  expectUnchanged(Layers(2, 8, 0.8f * kLength), 4 * kLength);  // nearly as thick as wide
  expectUnchanged(Layers(2, 8, 0.125f), 0.1);                  // thicker than a voxel
  Layers at_border(2, 8, 0.125f);
  for (uint32_t& code : at_border.geometry.border_code) code = 1;
  expectUnchanged(at_border, 0.5);
}

TEST(LayerMerger, ASupportStaysWithinTheBricksRadius) {
  Layers layers(2, 2, 0.25f);
  layers.geometry.x = {0.4f, 0.6f, 0.4f, 0.6f};
  const double radius = kKernelSupport * kLength;
  layers.merge(voxelsOf(1), radius);
  ASSERT_EQ(layers.geometry.size(), 1u);
  EXPECT_LE(kKernelSupport * layers.geometry.axis0[0], radius);
  EXPECT_GT(kKernelSupport * layers.geometry.axis0[0], 0.999 * radius);
}

TEST(LayerMerger, ASecondScalarIsMergedToo) {
  Layers layers(1, 4, 0.125f, 0.25f);
  SplatVariable second = layers.values;
  for (float& mean : second.mean) mean += 1;
  LayerMerging merging = voxelsOf(0.5);
  merging.second_bins = bins(1000);
  LayerMerger().merge(merging, 10, layers.geometry, layers.values, &second);
  ASSERT_EQ(second.size(), 1u);
  EXPECT_FLOAT_EQ(second.mean[0], layers.values.mean[0] + 1);
  EXPECT_FLOAT_EQ(second.slope2[0], layers.values.slope2[0]);
}

}  // namespace
}  // namespace curvisplat
