// Values streams that are predicted in time decode to the same numbers as those of the step alone.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <utility>

#include "stream/base/error.h"
#include "stream/codec/prediction.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {
namespace {

constexpr uint32_t kCount = 3000;

/// Values at a time: waves that move, and noise that depends on the seed alone.
std::vector<SplatScalar> valuesAt(double time, unsigned noise_seed, double noise) {
  std::mt19937 random(noise_seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<SplatScalar> values(kCount);
  for (uint32_t n = 0; n < kCount; ++n) {
    const double x = 0.7 * n;
    values[n].mean = 5 + time + noise * uniform(random) + 0.1 * std::sin(x);
    values[n].slope = {0.1 * std::cos(x + time), 0.02 * uniform(random), -0.5 * noise};
    values[n].variance = n % 3 ? 0 : 1e-3 * (1 + 0.1 * time);
  }
  return values;
}

SplatVariable decoded(std::span<const std::byte> bytes, const TimeReferences& references = {}) {
  SplatVariable values;
  values.resize(kCount);
  decodeValuesStream(kCount, bytes, arraysOf(values), references);
  return values;
}

void expectSame(const SplatVariable& a, const SplatVariable& b) {
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.slope0, b.slope0);
  EXPECT_EQ(a.slope1, b.slope1);
  EXPECT_EQ(a.slope2, b.slope2);
  EXPECT_EQ(a.variance, b.variance);
}

TEST(TimePrediction, DecodesToTheSameNumbersInFewerBytes) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0.1, 1, 1), third = valuesAt(0.2, 1, 1);
  const auto first_stream = encodeValuesStream(rows, first);
  const SplatVariable first_values = decoded(first_stream);

  TimeReferences one;
  one.steps_back = {1, 0};
  one.values[0] = arraysOf(first_values);
  auto second_alone = second;
  const auto alone = encodeValuesStream(rows, second_alone), timed = encodeValuesStream(rows, second, one);
  EXPECT_EQ(stepsBackOf(alone), (std::array<uint8_t, 2>{0, 0}));
  EXPECT_EQ(stepsBackOf(timed), (std::array<uint8_t, 2>{1, 0}));
  EXPECT_LT(timed.size(), alone.size() * 6 / 10);
  expectSame(decoded(timed, one), decoded(alone));
  for (uint32_t n = 0; n < kCount; ++n) EXPECT_EQ(second[n].mean, second_alone[n].mean);

  const SplatVariable second_values = decoded(alone);
  TimeReferences two;
  two.steps_back = {1, 2};
  two.values = {arraysOf(second_values), arraysOf(first_values)};
  auto third_alone = third;
  const auto third_stream = encodeValuesStream(rows, third_alone);
  const auto third_timed = encodeValuesStream(rows, third, two);
  EXPECT_EQ(stepsBackOf(third_timed), (std::array<uint8_t, 2>{1, 2}));
  EXPECT_LT(third_timed.size(), third_stream.size());
  expectSame(decoded(third_timed, two), decoded(third_stream));
}

TEST(TimePrediction, IsNotUsedWhereItGainsNothing) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0, 2, 1);
  const SplatVariable values = decoded(encodeValuesStream(rows, first));
  TimeReferences references;
  references.steps_back = {1, 0};
  references.values[0] = arraysOf(values);
  auto alone = second;
  const auto without = encodeValuesStream(rows, alone), with = encodeValuesStream(rows, second, references);
  EXPECT_LE(static_cast<double>(with.size()), 1.01 * static_cast<double>(without.size()));
}

TEST(TimePrediction, HostileHeadersAreRefused) {
  const std::vector<Row> rows{{0, kCount, kNoRow}};
  auto first = valuesAt(0, 1, 1), second = valuesAt(0.1, 1, 1);
  const SplatVariable values = decoded(encodeValuesStream(rows, first));
  TimeReferences references;
  references.steps_back = {1, 0};
  references.values[0] = arraysOf(values);
  std::vector<std::byte> stream = encodeValuesStream(rows, second, references);
  EXPECT_THROW(decoded(stream), Error);  // its reference is missing
  for (const auto& back : {std::array<uint8_t, 2>{0, 3}, {3, 3}, {4, 2}}) {
    stream[38] = std::byte{back[0]};
    stream[39] = std::byte{back[1]};
    EXPECT_THROW(stepsBackOf(stream), Error);
  }
  EXPECT_THROW(stepsBackOf(std::span(stream).first(20)), Error);
  stream[38] = std::byte{1};
  stream[39] = std::byte{0};
  for (size_t byte = 28; byte < 38; ++byte) {
    std::vector<std::byte> damaged = stream;
    damaged[byte] = std::byte{0x15};
    EXPECT_THROW(decoded(damaged, references), Error);
  }
}

}  // namespace
}  // namespace curvisplat
