#include "tools/viewer/edited_function.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

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

}  // namespace
}  // namespace curvisplat
