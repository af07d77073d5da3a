// Sums of optical depths in a tile, against the compositor of splats in double precision, on every instruction set.
#include "render/cpu/half_depths.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <cmath>
#include <string>
#include <vector>

#include "render/cpu/cpu_painter.h"
#include "tests/reference/painted_splats.h"
#include "tests/reference/splat_compositor.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{kTileSide, kTileSide};

class HalfDepths : public testing::TestWithParam<int64_t>, public HalfEvents {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }

  void passLayers(size_t pixel, double distance) override {
    EXPECT_GT(distance, tile_.next_layer[pixel]);
    tile_.next_layer[pixel] = INFINITY;
    ++layers_;
  }
  void reach(size_t pixel, double part) override {
    EXPECT_LE(tile_.target[pixel], tile_.depth[pixel]);
    EXPECT_GT(part, 0);
    EXPECT_LE(part, 1);
    tile_.target[pixel] = HalfTile::kFound;
    ++reached_;
  }

  /// All of them, in any order.
  void add(const std::vector<ScreenSplat>& splats, const ClassificationTable& table) {
    const MeanExtinction extinction(table);
    for (const ScreenSplat& of : splats) {
      if (isRecord(of)) continue;
      const SplatRecords records = SplatRecords::beside(&of, 1, false);
      const auto cut = records.cut ? ScreenCut::of(*records.cut) : ScreenCut();
      const FootprintSkew skew = FootprintSkew::unpack(of.skew);
      HalfSplat splat{};
      splat.x = of.x;
      splat.y = of.y;
      splat.per_l11 = 1 / double{of.l11};
      splat.l21 = of.l21;
      splat.per_l22 = 1 / double{of.l22};
      splat.amplitude = std::abs(of.amplitude);
      splat.mean = of.mean;
      splat.slope0 = of.slope0;
      splat.slope1 = of.slope1;
      splat.half_width = of.half_width;
      splat.depth.middle = 2;
      splat.cut = records.cut ? &cut : nullptr;
      splat.skew = of.skew != 0 ? &skew : nullptr;
      addToHalf(splat, {0, 0, 0, 0, kTileSide - 1, kTileSide - 1}, extinction, tile_, *this);
    }
  }
  HalfTile tile_;
  size_t reached_ = 0, layers_ = 0;
};

INSTANTIATE_TEST_SUITE_P(, HalfDepths, testing::ValuesIn(CpuPainter::targets()),
                         [](const testing::TestParamInfo<int64_t>& tested) {
                           return std::string(hwy::TargetName(tested.param));
                         });

TEST_P(HalfDepths, AddUpToWhatThePictureHas) {
  for (const bool log_scale : {false, true})
    for (const auto& table : {lively(log_scale), smooth(log_scale)}) {
      const auto splats = randomSplats(40, 7, kSize, 0.3f, 0.1f);
      const Image specified = compositeSplats(splats, table, {true}, kSize, glm::vec4(0.0f));
      tile_ = {};
      tile_.target.fill(1e300);
      tile_.next_layer.fill(INFINITY);
      add(splats, table);
      double most = 0;
      for (size_t n = 0; n < HalfTile::kPixels; ++n) {
        const auto alpha = static_cast<double>(specified.rgba[4 * n + 3]);
        EXPECT_NEAR(-std::expm1(-tile_.depth[n]), alpha, 1e-3 * alpha + 1e-4) << n;
        most = std::max(most, alpha);
      }
      EXPECT_GT(most, 0.05);
      EXPECT_EQ(reached_ + layers_, 0u);
    }
}

TEST_P(HalfDepths, CutSplatsLeaveTheirShare) {
  const auto table = smooth(false);
  auto splats = cutSome(randomSplats(40, 9, kSize, 0.3f, 0.1f), 3);
  // Where the scalar does not vary along the ray a cut takes its share of the optical depth, and nothing else.
  for (ScreenSplat& splat : splats)
    if (!isRecord(splat)) splat.half_width = 0;
  const Image specified = compositeSplats(splats, table, {true}, kSize, glm::vec4(0.0f));
  tile_.target.fill(1e300);
  tile_.next_layer.fill(INFINITY);
  add(splats, table);
  for (size_t n = 0; n < HalfTile::kPixels; ++n) {
    const auto alpha = static_cast<double>(specified.rgba[4 * n + 3]);
    EXPECT_NEAR(-std::expm1(-tile_.depth[n]), alpha, 1e-3 * alpha + 1e-4) << n;
  }
}

TEST_P(HalfDepths, EveryPixelReachesItsTargetOnce) {
  const auto table = smooth(false);
  const auto splats = randomSplats(40, 7, kSize, 0.3f, 0.1f);
  tile_.target.fill(1e300);
  tile_.next_layer.fill(1);
  add(splats, table);
  size_t touched = 0;
  for (const double depth : tile_.depth) touched += depth > 0;
  EXPECT_GT(touched, HalfTile::kPixels / 2);
  EXPECT_EQ(layers_, touched);  // before all splats
  HalfTile again;
  again.next_layer.fill(INFINITY);
  for (size_t n = 0; n < HalfTile::kPixels; ++n)
    again.target[n] = tile_.depth[n] > 0 ? 0.5 * tile_.depth[n] : HalfTile::kFound;
  tile_ = again;
  add(splats, table);
  EXPECT_EQ(reached_, touched);
}

}  // namespace
}  // namespace curvisplat
