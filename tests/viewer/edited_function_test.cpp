#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/temporary_folder.h"
#include "tools/view/edited_function.h"
#include "tools/view/first_view.h"

namespace curvisplat {
namespace {

void expectSame(const TransferFunction& a, const TransferFunction& b, double low, double high) {
  for (int n = -5; n <= 105; ++n) {
    const double scalar = low + (high - low) * n / 100;
    EXPECT_NEAR(a.at(scalar).extinction, b.at(scalar).extinction, 1e-9) << scalar;
    EXPECT_LE(glm::length(a.at(scalar).colour - b.at(scalar).colour), 1e-9) << scalar;
  }
}

TEST(EditedFunction, APresetIsThatPreset) {
  const EditedFunction edited("inferno", 0.5, 3, 0.2);
  EXPECT_EQ(edited.preset(), "inferno");
  expectSame(edited.function(), TransferFunction::preset("inferno", 0.5, 3, 0.2), 0.5, 3);
}

TEST(EditedFunction, ItsDefinitionStandsAtScalars) {
  EditedFunction edited("viridis", -2, 6, 0.1);
  edited.addPoint(0.3, 0.9);
  const TransferFunctionDefinition definition = edited.definition();
  EXPECT_DOUBLE_EQ(definition.colours.front().x, -2);
  EXPECT_DOUBLE_EQ(definition.opacities.back().x, 6);
  expectSame(edited.function(), TransferFunction(definition, nullptr, 0.1), -2, 6);
}

TEST(EditedFunction, ADefinitionComesBackTheSame) {
  EditedFunction edited("plasma", 0.1, 1000, 0.1);
  ASSERT_TRUE(edited.setLogScale(true));
  edited.addPoint(0.5, 0.7);
  edited.setOpacityUnit(3);
  const EditedFunction again(edited.definition(), 17);
  EXPECT_EQ(again.opacityUnit(), 3);
  EXPECT_TRUE(again.logScale());
  expectSame(edited.function(), again.function(), 0.1, 1000);
}

/// A band keeps its form, and ends where its first point would leave the range.
TEST(EditedFunction, InnerPointsAreMovedTogether) {
  EditedFunction edited("grey", 0, 1, 1);
  edited.setOpacities({{0, 0}, {0.4, 0}, {0.5, 0.5}, {0.6, 0}, {1, 0}});
  const auto expectAt = [&](const std::vector<double>& places) {
    ASSERT_EQ(edited.points().size(), places.size());
    for (size_t n = 0; n < places.size(); ++n) EXPECT_NEAR(edited.points()[n].x, places[n], 1e-12) << n;
    EXPECT_EQ(edited.points()[2].opacity, 0.5);
  };
  edited.movePointsTogether(0.25);
  expectAt({0, 0.65, 0.75, 0.85, 1});
  edited.movePointsTogether(0.25);
  expectAt({0, 0.8, 0.9, 1, 1});
  edited.movePointsTogether(-3);
  expectAt({0, 0, 0.1, 0.2, 1});
  edited.setOpacities({{0, 0}, {1, 1}});
  edited.movePointsTogether(0.5);
  EXPECT_EQ(edited.points().back().x, 1);
}

TEST(EditedFunction, OpacitiesNarrowerThanTheColoursKeepTheirPlaces) {
  TransferFunctionDefinition definition = presetDefinition("grey");
  definition.colours = {{0, glm::dvec3(0)}, {10, glm::dvec3(1)}};
  definition.opacities = {{4, 0.0}, {5, 0.8}, {6, 0.25}};
  const EditedFunction edited(definition, 1);
  EXPECT_EQ(edited.range(), std::pair(0.0, 10.0));
  expectSame(edited.function(), TransferFunction(definition, nullptr, 1), 0, 10);
}

TEST(EditedFunction, PointsMoveBetweenTheirNeighbours) {
  EditedFunction edited("grey", 0, 1, 1);
  while (edited.points().size() > 2) edited.removePoint(1);
  const size_t a = edited.addPoint(0.4, 0.5), b = edited.addPoint(0.6, 0.5);
  EXPECT_EQ(a, 1u);
  EXPECT_EQ(b, 2u);
  edited.movePoint(a, 0.9, 2);
  EXPECT_EQ(edited.points()[a].x, 0.6);
  EXPECT_EQ(edited.points()[a].opacity, 1);
  edited.movePoint(0, 0.3, -1);
  EXPECT_EQ(edited.points()[0].x, 0);
  EXPECT_EQ(edited.points()[0].opacity, 0);
  edited.removePoint(0);
  edited.removePoint(3);
  EXPECT_EQ(edited.points().size(), 4u);
}

TEST(EditedFunction, ChangesMakeItNoPreset) {
  EditedFunction edited("grey", 0, 1, 1);
  edited.setRange(2, 3);
  edited.setOpacityUnit(4);
  EXPECT_EQ(edited.preset(), "grey");
  edited.addPoint(0.1, 0.1);
  EXPECT_EQ(edited.preset(), "");
}

/// The points stay where they are along the range.
TEST(EditedFunction, TheScaleAloneBecomesLinear) {
  const FunctionParts parts{"inferno", {0, 4}, AsinhScale{1, 0.25}, {{0, 0.5}, {0.25, 0}, {1, 0.75}}, 0.5};
  EditedFunction function(parts);
  ASSERT_TRUE(function.asinhScale());
  function.setLinear();
  EXPECT_FALSE(function.asinhScale());
  EXPECT_EQ(function.scalarAt(0.25), 1);
  ASSERT_TRUE(function.parts());
  EXPECT_EQ(textOf(function.parts()->opacities), textOf(parts.opacities));
}

/// The share below x is x squared where the histogram is even and opacities rise as x.
TEST(EditedFunction, AnIsosurfaceBeginsInTheMiddleOfWhatIsSeen) {
  EditedFunction function("viridis", 10, 20, 1);
  function.setOpacities({{0, 0}, {1, 1}});
  const std::vector<double> even(500, 1.0 / 500);
  EXPECT_NEAR(middleOfSeen(even, function), 10 + 10 * std::sqrt(0.5), 1e-3);
  function.setOpacities({{0, 0}, {1, 0}});
  EXPECT_NEAR(middleOfSeen(even, function), 15, 1e-9);
  EXPECT_NEAR(middleOfSeen(even, function, 0.25), 12.5, 1e-9);
  EXPECT_NEAR(middleOfSeen({}, function), 15, 1e-9);
  EXPECT_NEAR(middleOfSeen({0, 0, 0}, function), 15, 1e-9);
  // All of the volume in the second of four bins.
  EXPECT_NEAR(middleOfSeen({0, 1, 0, 0}, function), 10 + 10 * 0.375, 1e-9);
}

/// Opacities and their unit are of a scalar, a colour map is the user's.
TEST(EditedFunction, OfAnotherScalarIsChosenAnew) {
  const EditedFunction automatic =
      EditedFunction::automatic({kMapsOnDark.diverging, {-3, 3}, {}, {{0, 1}, {0.5, 0}, {1, 1}}, 0.25});
  EditedFunction edited(kMapsOnDark.sequential, 0, 100, 7);
  edited.addPoint(0.5, 0.9);
  const EditedFunction anew = chosenAnew(edited, automatic);
  EXPECT_TRUE(anew.isAutomatic());
  EXPECT_EQ(anew.map(), kMapsOnDark.diverging);
  EXPECT_EQ(anew.opacityUnit(), 0.25);
  edited.setColours("viridis");
  const EditedFunction with_map = chosenAnew(edited, automatic);
  EXPECT_EQ(with_map.map(), "viridis");
  EXPECT_EQ(with_map.range(), automatic.range());
  EXPECT_EQ(with_map.opacityUnit(), 0.25);
  ASSERT_EQ(with_map.points().size(), 3u);
  EXPECT_EQ(with_map.points()[1].opacity, 0);
}

TEST(EditedFunction, InvalidRangesAreRefused) {
  EditedFunction edited("grey", -1, 1, 1);
  EXPECT_FALSE(edited.setLogScale(true));
  EXPECT_FALSE(edited.setRange(2, 2));
  EXPECT_FALSE(edited.setRange(0, INFINITY));
  EXPECT_TRUE(edited.setRange(1, 10));
  EXPECT_TRUE(edited.setLogScale(true));
  EXPECT_FALSE(edited.setRange(0, 10));
  EXPECT_EQ(edited.range(), std::pair(1.0, 10.0));
}

using For = FunctionChooser::For;

class FunctionChooserTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {24, 12, 12}), *folder_ / "scene.splats");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  /// The questions that are answered until nothing is to come.
  static std::vector<FunctionChooser::Question> answersOf(FunctionChooser& chooser) {
    std::vector<FunctionChooser::Question> answers;
    while (chooser.busy()) {
      if (const auto answer = chooser.poll()) answers.push_back(answer->question);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return answers;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  const CacheReader cache_{*folder_ / "scene.splats"};
  const std::string scalar_ = cache_.manifest().variables.front().name;
  FunctionChooser chooser_{cache_, [] {}};
};
std::unique_ptr<TemporaryFolder> FunctionChooserTest::folder_;

TEST_F(FunctionChooserTest, AQuestionForOnePurposeDropsNoneForAnother) {
  chooser_.ask({For::kScalar, scalar_});
  chooser_.ask({For::kOpacities, scalar_});
  EXPECT_EQ(answersOf(chooser_),
            (std::vector<FunctionChooser::Question>{{For::kScalar, scalar_}, {For::kOpacities, scalar_}}));
}

TEST_F(FunctionChooserTest, OfOnePurposeTheNewestIsAnswered) {
  chooser_.ask({For::kScalar, "a scalar that would be an error"});
  chooser_.ask({For::kScalar, scalar_});
  EXPECT_EQ(answersOf(chooser_), (std::vector<FunctionChooser::Question>{{For::kScalar, scalar_}}));
}

TEST_F(FunctionChooserTest, WhatIsDroppedIsNotAnswered) {
  chooser_.ask({For::kOpacities, scalar_});
  chooser_.ask({For::kSameScalar, scalar_});
  chooser_.drop(For::kOpacities);
  EXPECT_EQ(answersOf(chooser_), (std::vector<FunctionChooser::Question>{{For::kSameScalar, scalar_}}));
  chooser_.ask({For::kScalar, scalar_});
  chooser_.drop();
  EXPECT_FALSE(chooser_.busy());
  EXPECT_FALSE(chooser_.poll());
}

TEST_F(FunctionChooserTest, AnErrorEndsItsQuestionOnly) {
  chooser_.ask({For::kScalar, "no scalar"});
  chooser_.ask({For::kOpacities, scalar_});
  EXPECT_THROW(answersOf(chooser_), Error);
  EXPECT_EQ(answersOf(chooser_), (std::vector<FunctionChooser::Question>{{For::kOpacities, scalar_}}));
}

/// A view is replaced while it chooses.
TEST_F(FunctionChooserTest, AnotherTakesItsQuestions) {
  FunctionChooser next(cache_, [] {});
  chooser_.ask({For::kScalar, scalar_});
  chooser_.ask({For::kOpacities, scalar_});
  next.takeQuestionsOf(chooser_);
  EXPECT_FALSE(chooser_.busy());
  EXPECT_EQ(answersOf(next),
            (std::vector<FunctionChooser::Question>{{For::kScalar, scalar_}, {For::kOpacities, scalar_}}));
}

}  // namespace
}  // namespace curvisplat
