// The parts of the rule that chooses a transfer function and a view from the data, on values whose
// percentiles, histogram and silhouette are known.
#include "render/automatic/first_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <initializer_list>
#include <numbers>
#include <random>
#include <string>
#include <string_view>

#include "render/automatic/coarse_samples.h"
#include "render/automatic/opacity_rule.h"
#include "render/automatic/view_rule.h"
#include "render/camera/camera.h"
#include "render/colour/function_parts.h"
#include "render/image/image.h"
#include "stream/base/error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

/// `count` values evenly spread over [0, 1], each of volume 1.
CoarseSamples evenSamples(size_t count) {
  CoarseSamples samples;
  for (size_t n = 0; n < count; ++n) {
    samples.positions.emplace_back(static_cast<double>(n) / static_cast<double>(count), 0, 0);
    samples.values.push_back(static_cast<float>((static_cast<double>(n) + 0.5) / static_cast<double>(count)));
    samples.volumes.push_back(1);
  }
  samples.volume = static_cast<double>(count);
  return samples;
}

void add(CoarseSamples& samples, float value, double volume) {
  samples.positions.emplace_back(0);
  samples.values.push_back(value);
  samples.volumes.push_back(volume);
  samples.volume += volume;
}

TEST(FirstChoice, PercentilesAreOfTheVolume) {
  CoarseSamples samples = evenSamples(10'000);
  for (int n = 0; n < 5000; ++n) add(samples, 1000, 1e-9);  // degenerate cells
  const ValueDistribution distribution(samples);
  EXPECT_NEAR(distribution.percentile(0.01), 0.01, 1e-3);
  EXPECT_NEAR(distribution.percentile(0.5), 0.5, 1e-3);
  EXPECT_NEAR(distribution.percentile(0.99), 0.99, 1e-3);
  EXPECT_EQ(distribution.percentileOfSamples(0.9), 1000);
}

TEST(FirstChoice, OutliersMakeTheAxisAsinh) {
  CoarseSamples samples = evenSamples(10'000);
  EXPECT_FALSE(volumeHistogram(samples, ValueDistribution(samples))->asinh);
  for (int n = 0; n < 50; ++n) add(samples, 1000, 1e-3);
  const auto histogram = volumeHistogram(samples, ValueDistribution(samples));
  ASSERT_TRUE(histogram && histogram->asinh);
  EXPECT_NEAR(histogram->asinh->centre, 0.5, 0.3);
  EXPECT_NEAR(histogram->scalar(histogram->high), 1000, 1e-6);
  double sum = 0, smoothed = 0;
  for (size_t bin = 0; bin < VolumeHistogram::kBins; ++bin) {
    sum += histogram->shares[bin];
    smoothed += histogram->smoothed[bin];
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_NEAR(smoothed, 1, 1e-9);
}

TEST(FirstChoice, OneValueHasNoHistogram) {
  CoarseSamples samples;
  for (int n = 0; n < 100; ++n) add(samples, 7, 1);
  EXPECT_FALSE(volumeHistogram(samples, ValueDistribution(samples)));
}

TEST(FirstChoice, RareValuesAreMoreOpaqueAndTheModeIsClear) {
  CoarseSamples samples = evenSamples(10'000);
  for (int n = 0; n < 10'000; ++n) add(samples, 0.25f, 30);  // nearly all of the volume
  const auto histogram = volumeHistogram(samples, ValueDistribution(samples));
  ASSERT_TRUE(histogram);
  const BinExtinctions extinctions = extinctionsOf(*histogram);
  EXPECT_EQ(extinctions[histogram->binOf(0.25)], 0);
  EXPECT_GT(extinctions[histogram->binOf(0.75)], 0.5);
  const auto points = opacityPoints(*histogram, extinctions, histogram->low, histogram->high);
  EXPECT_LE(points.size(), 24u);
  const OpacityCurve curve(points);
  EXPECT_LT(curve.at(0.25), 0.01);
  EXPECT_GT(curve.at(0.75), 0.5);
}

/// The cleared values lie beyond the range, whose end has an opacity of its own: as the far field of a
/// vortex.
TEST(FirstChoice, WhatIsClearedBeyondTheRangeStaysClear) {
  CoarseSamples samples;
  for (int n = 0; n < 200; ++n) add(samples, 0, 50);  // the far field
  for (int n = 0; n < 10'000; ++n) add(samples, 5 + 95 * static_cast<float>(n) / 10'000, 0.001f);
  const auto histogram = volumeHistogram(samples, ValueDistribution(samples));
  ASSERT_TRUE(histogram);
  const BinExtinctions extinctions = extinctionsOf(*histogram);
  const auto [begin, end] = seenInterval(*histogram, extinctions);
  ASSERT_GT(begin, histogram->coordinate(1));
  const auto points = opacityPoints(*histogram, extinctions, begin, end);
  EXPECT_LT(points.front().opacity, 0.001);
  EXPECT_GT(OpacityCurve(points).at(0.02), 0.1);
}

TEST(FirstChoice, SilhouetteIsThatOfTheSamples) {
  // A square plate in the plane z = 0, in a box that is as high as wide because of two lone samples.
  CoarseSamples samples;
  for (int y = 0; y < 400; ++y)
    for (int x = 0; x < 400; ++x) {
      add(samples, 1, 1);
      samples.positions.back() = {x / 400.0, y / 400.0, 0};
    }
  add(samples, 1, 1);
  samples.positions.back() = {0.5, 0.5, -0.5};
  add(samples, 1, 1);
  samples.positions.back() = {0.5, 0.5, 0.5};
  const Silhouette silhouette = widestSilhouette(samples);
  EXPECT_EQ(silhouette.view, "+z");
  EXPECT_NEAR(silhouette.area, 1, 0.03);
}

// A unit square, of fewer samples than a pixel of a picture of 80 x 80 would need.
TEST(FirstChoice, FewSamplesLeaveNoGapsInASilhouette) {
  CoarseSamples samples;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int n = 0; n < 5000; ++n) {
    add(samples, 1, 1);
    samples.positions.back() = {unit(random), unit(random), 0};
  }
  EXPECT_NEAR(seenArea(samples, "+z", samples.volumes), 1, 0.02);
}

// 300,000 samples for few splats took most of the time of a small picture.
TEST(FirstChoice, SmallGridsHaveFewerSamples) {
  const TemporaryFolder folder;
  for (const size_t most_splats : {60u, 1500u}) {
    const auto path = folder / std::to_string(most_splats);
    writeRandomCache(path, 1, most_splats);
    const CacheReader cache(path);
    size_t splats = 0;
    for (const uint32_t brick : bricksAtALevel(cache, 50'000)) splats += cache.bricks()[brick].splats;
    const size_t samples = coarseSamples(cache, 0, glm::dvec3(1)).size();
    EXPECT_GE(samples, 60'000u) << splats;
    EXPECT_LE(samples, std::max<size_t>(80'000, 4 * splats)) << splats;
  }
}

/// A bright disc in a far field that is nearly clear: only the disc is seen.
TEST(FirstChoice, WhatIsSeenMayBeASmallPartOfTheSilhouette) {
  CoarseSamples samples;
  std::vector<double> depths;
  for (int y = 0; y < 400; ++y)
    for (int x = 0; x < 400; ++x) {
      add(samples, 1, 1);
      samples.positions.back() = {x / 400.0, y / 400.0, 0};
      const bool inside = std::hypot(x / 400.0 - 0.5, y / 400.0 - 0.5) < 0.25;
      depths.push_back(inside ? 1 : 1e-4);
    }
  const Silhouette silhouette = widestSilhouette(samples);
  ASSERT_EQ(silhouette.view, "+z");
  EXPECT_NEAR(seenArea(samples, "+z", depths), std::numbers::pi / 16, 0.02);
  std::fill(depths.begin(), depths.end(), 1e-4);
  EXPECT_NEAR(seenArea(samples, "+z", depths), silhouette.area, 1e-9);
  std::fill(depths.begin(), depths.end(), 0);
  EXPECT_EQ(seenArea(samples, "+z", depths), 0);
  EXPECT_EQ(seenArea(CoarseSamples(), "+z", {}), 0);
}

/// A cube of haze, with a dense ball in one of its corners: it is looked at from that corner, unless that is below, and the
/// whole cube is in the picture, hardly smaller than it can be.
TEST(FirstChoice, LooksFromWhereRareValuesAreSeen) {
  for (const glm::dvec3& corner : {glm::dvec3(0, 0, 1), {1, 1, 1}}) {
    CoarseSamples samples;
    std::vector<double> depths;
    constexpr int kAlong = 40;
    for (int n = 0; n < kAlong * kAlong * kAlong; ++n) {
      const glm::dvec3 place =
          (glm::dvec3(n % kAlong, n / kAlong % kAlong, n / kAlong / kAlong) + 0.5) / double{kAlong};
      const double volume = 1.0 / (kAlong * kAlong * kAlong);
      add(samples, 1, volume);
      samples.positions.back() = place;
      depths.push_back(volume * (glm::distance(place, 0.2 + 0.6 * corner) < 0.15 ? 60 : 6));
    }
    const Silhouette widest = widestSilhouette(samples);
    ASSERT_EQ(widest.view, "iso");
    constexpr ImageSize kSize{300, 200};
    const glm::dvec3 lower(0), upper(1);
    const ViewChoice choice = chooseView({samples, depths, widest, lower, upper}, kSize, Framed::kSeen);
    ASSERT_TRUE(choice.position);
    const Camera camera = cameraOf(choice, lower, upper, kSize);
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_EQ(camera.position[axis] > 0.5, corner[axis] > 0.5)
          << axis << " " << corner.x << corner.y << corner.z;
    double reach = 0;
    for (const glm::dvec3& place : samples.positions) {
      const glm::dvec3 seen(camera.viewFromWorld() * glm::dvec4(place, 1));
      const double half = -seen.z * std::tan(camera.view_angle_deg * std::numbers::pi / 360);
      reach = std::max({reach, std::abs(seen.y) / half, std::abs(seen.x) / half / 1.5});
    }
    EXPECT_GT(reach, 0.85);
    EXPECT_LT(reach, 0.9);
  }
}

/// A cube of dense haze with a core of another value: whatever is seen is haze, and the range is that of the haze.
TEST(FirstChoice, WhatIsHiddenTakesNoColours) {
  constexpr int kAlong = 40;
  const auto lightOf = [](float value, double depth) {
    CoarseSamples samples;
    std::vector<double> depths;
    for (int n = 0; n < kAlong * kAlong * kAlong; ++n) {
      const glm::dvec3 place =
          (glm::dvec3(n % kAlong, n / kAlong % kAlong, n / kAlong / kAlong) + 0.5) / double{kAlong};
      const double volume = 1.0 / (kAlong * kAlong * kAlong);
      add(samples, glm::distance(place, glm::dvec3(0.5)) < 0.15 ? 1.0f : 0.0f, volume);
      samples.positions.back() = place;
      depths.push_back(volume * depth);
    }
    const SeenValues seen = seenValues(samples, depths, glm::dvec3(0), glm::dvec3(1));
    double sum = 0, of_value = 0;
    for (size_t n = 0; n < seen.values.size(); ++n) {
      sum += seen.areas[n];
      if (seen.values[n] == value) of_value += seen.areas[n];
    }
    return of_value / sum;
  };
  EXPECT_NEAR(lightOf(1, 1e-3), 4 * std::numbers::pi / 3 * std::pow(0.15, 3),
              0.002);  // its share of the volume
  EXPECT_LT(lightOf(1, 20), 0.001);
  EXPECT_GT(lightOf(0, 20), 0.999);
}

TEST(FirstChoice, ARangeOfWhichLittleIsSeenIsNarrowed) {
  VolumeHistogram histogram;
  histogram.low = -1;
  histogram.high = 3;
  BinWeights seen{};
  std::fill_n(seen.begin() + 32, 32, 1.0);    // 0..1
  std::fill_n(seen.begin() + 64, 64, 0.002);  // 1..3: 0.4 % of it
  const auto narrowed = narrowedInterval(histogram, seen, -1, 3, std::nullopt);
  ASSERT_TRUE(narrowed);
  EXPECT_NEAR(narrowed->first, 0.01, 0.001);
  EXPECT_NEAR(narrowed->second, 0.994, 0.001);
  EXPECT_FALSE(narrowedInterval(histogram, seen, 0, 1, std::nullopt));
  EXPECT_FALSE(narrowedInterval(histogram, {}, -1, 3, std::nullopt));
  // A diverging map keeps as much on either side of its middle.
  const auto symmetric = narrowedInterval(histogram, seen, -3, 3, 0);
  ASSERT_TRUE(symmetric);
  EXPECT_EQ(symmetric->second, narrowed->second);
  EXPECT_EQ(symmetric->first, -symmetric->second);
  std::fill_n(seen.begin() + 64, 64, 0.15);  // a quarter of it
  EXPECT_FALSE(narrowedInterval(histogram, seen, -1, 3, std::nullopt));
}

/// A plate across each axis, dense on one of its sides: that side is looked at, but for one below that is only a little denser.
TEST(FirstChoice, LooksAtTheDenseSideOfAPlate) {
  static constexpr std::string_view kAcross[] = {"+x", "+y", "+z"};
  const auto chosen = [](int axis, bool upper_side, double factor) {
    CoarseSamples samples;
    std::vector<double> depths;
    constexpr int kAlong = 60;
    for (int n = 0; n < 4 * kAlong * kAlong; ++n) {
      glm::dvec3 place;
      place[axis] = 0.01 * (n % 4);
      place[(axis + 1) % 3] = n / 4 % kAlong / double{kAlong};
      place[(axis + 2) % 3] = n / 4 / kAlong / double{kAlong};
      const double volume = 0.01 / (kAlong * kAlong);
      add(samples, 1, volume);
      samples.positions.back() = place;
      depths.push_back(volume * 100 * ((n % 4 >= 2) == upper_side ? factor : 1));
    }
    const glm::dvec3 lower(0);
    glm::dvec3 upper(1);
    upper[axis] = 0.04;
    const Silhouette widest{kAcross[axis], 1};
    return chooseView({samples, depths, widest, lower, upper}, {300, 200}, Framed::kSeen).view;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name(1, "xyz"[axis]);
    EXPECT_EQ(chosen(axis, true, 10), "+" + name);
    EXPECT_EQ(chosen(axis, false, 10), "-" + name);
    EXPECT_EQ(chosen(axis, false, 1), "+" + name);
  }
  EXPECT_EQ(chosen(2, false, 1.2), "+z");
}

TEST(FirstChoice, ConstantScalarsAreRecognised) {
  Manifest manifest;
  manifest.variables = {{0, "energy", "", 0, 0},
                        {1, "density", "", 0.99999, 1.00001},
                        {2, "tiny", "", 0, 1e-40},
                        {3, "pressure", "", 1, 1.1},
                        {4, "other", "", 0, 1}};
  EXPECT_EQ(firstVaryingVariable(manifest), 3u);
  manifest.variables.resize(3);
  EXPECT_EQ(firstVaryingVariable(manifest), 0u);
}

TEST(FirstChoice, RoundingErrorsOfAVectorAreNotDrawn) {
  Manifest manifest;
  manifest.variables = {{0, "Taus:0", "", -1e-19, 1e-18},
                        {1, "VelocityZ", "", -4.7e-14, 4.1e-14},
                        {2, "Taus:4", "", -9e-5, 2e-4},
                        {3, "Velocity:mag", "", 800, 2200}};
  EXPECT_EQ(firstVaryingVariable(manifest), 2u);
  manifest.variables.erase(manifest.variables.begin() + 2);  // small, but nothing says that it is noise
  EXPECT_EQ(firstVaryingVariable(manifest), 0u);
  manifest.variables.erase(manifest.variables.begin());
  EXPECT_EQ(firstVaryingVariable(manifest), 1u);
}

TEST(FirstChoice, NumbersOfPointsAreTheLastScalarToDraw) {
  Manifest manifest;
  manifest.variables = {{0, "GlobalNodeId", "", 1, 6724}, {1, "ObjectId", "", 1, 2}, {2, "EQPS", "", 0, 3}};
  EXPECT_EQ(firstVaryingVariable(manifest), 2u);
  manifest.variables[2].max = 0;
  EXPECT_EQ(firstVaryingVariable(manifest), 0u);
}

TEST(FirstChoice, FieldsComeBeforeMaterialsPlacesAndNumberings) {
  Manifest manifest;
  const auto firstOf = [&](std::initializer_list<const char*> names) {
    manifest.variables.clear();
    for (const char* name : names) manifest.variables.push_back({0, name, "", 0, 9});
    return manifest.variables[firstVaryingVariable(manifest)].name;
  };
  EXPECT_EQ(
      firstOf({"Coordinate:mag", "Depth wrt surface", "nav_lat", "lon_rho", "x", "cellID", "Temperature"}),
      "Temperature");
  EXPECT_EQ(firstOf({"node_groups", "Coords:x", "mat_id", "MaterialIds"}), "mat_id");
  EXPECT_EQ(firstOf({"GlobalNodeId", "PointIds", "latitude"}), "latitude");
  EXPECT_EQ(firstOf({"GlobalNodeId", "gmsh:physical"}), "gmsh:physical");
  for (const char* field : {"Void_Fraction", "fluid", "X-momentum", "XVelocity", "material density", "1",
                            "\xc3\xa9nergie", "Z", "y+", "optical_depth"})
    EXPECT_EQ(firstOf({"Topography", field, "T"}), field);
}

TEST(FirstChoice, FewValuesThatFillTheVolumeAreCounted) {
  VolumeHistogram histogram;
  for (const size_t bin : {0, 63, 64, 127}) histogram.shares[bin] = 0.22;  // a value may lie between two bins
  EXPECT_EQ(fillingValues(histogram), 3u);
  histogram.shares[0] = histogram.shares[63] = 0;
  EXPECT_EQ(fillingValues(histogram), 0u) << "less than most of the volume";
  histogram.shares = {};
  histogram.shares[5] = 0.98;
  EXPECT_EQ(fillingValues(histogram), 1u);
  std::fill_n(histogram.shares.begin(), 12, 1.0 / 12);
  EXPECT_EQ(fillingValues(histogram), 0u) << "spread";
}

TEST(FirstChoice, NumbersAreRoundedToDigitsOfTheScale) {
  EXPECT_EQ(roundedTo(0.123456, 0.5, 3), 0.123);
  EXPECT_EQ(roundedTo(101.23456, 0.5, 2), 101.23);
  EXPECT_EQ(roundedTo(123456, 123456, 3), 123000);
  EXPECT_EQ(roundedTo(-1e-9, 1, 3), 0);
  EXPECT_EQ(roundedTo(9.9996, 1, 3), 10);
  EXPECT_EQ(fmt::format("{}", roundedTo(0.1 + 0.2, 0.3, 3)), "0.3");
}

TEST(FunctionParts, OpacitiesAreReadAndWritten) {
  const auto points = parseOpacities("--opacity", "0.2:0,0.5:0.8,1:0.1");
  ASSERT_EQ(points.size(), 4u);  // one is added at 0
  EXPECT_EQ(points[0].x, 0);
  EXPECT_EQ(points[0].opacity, 0);
  EXPECT_EQ(points[2].opacity, 0.8);
  EXPECT_EQ(textOf(points), "0:0,0.2:0,0.5:0.8,1:0.1");
  for (const char* wrong : {"", "0.5", "0:0", "0:0,1:2", "0:0,-1:0.5", "0.5:0,0.2:1", "0:0;1:1", "a:b,c:d"})
    EXPECT_THROW(parseOpacities("--opacity", wrong), UsageError) << wrong;
}

TEST(FunctionParts, AnAsinhScaleSpreadsValuesNearItsCentre) {
  FunctionParts parts;
  parts.map = "grey";
  parts.range = {-1000, 1000};
  parts.opacities = parseOpacities("--opacity", "0:0,1:1");
  const TransferFunction linear = parts.function();
  parts.asinh = AsinhScale{0, 1};
  const TransferFunction spread = parts.function();
  for (const double end : {-1000.0, 1000.0})
    EXPECT_NEAR(spread.at(end).colour.x, linear.at(end).colour.x, 1e-6);
  for (const double scalar : {-300.0, -2.0, 0.0, 1.0, 50.0})
    EXPECT_NEAR(spread.at(scalar).colour.x, 0.5 + 0.5 * std::asinh(scalar) / std::asinh(1000.0), 2e-4)
        << scalar;
}

TEST(PictureContrast, CountsWhatDiffersFromBackgroundAndMode) {
  Image image({10, 10});
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      const float value = y < 5 ? 1.0f : y < 8 ? 0.5f : 0.2f;  // background, mode, the rest
      std::fill_n(image.pixel(x, y), 3, value);
      image.pixel(x, y)[3] = 1;
    }
  const PictureContrast contrast = contrastOf(image, glm::vec4(1));
  EXPECT_EQ(contrast.seen, 0.5);
  EXPECT_EQ(contrast.other, 0.2);
  EXPECT_EQ(contrastOf(Image({4, 4}), glm::vec4(0)).seen, 0);
}

}  // namespace
}  // namespace curvisplat
