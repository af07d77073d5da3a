#include "render/colour/transfer_function.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include "stream/base/error.h"
#include "tests/render/expected_colour.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

double opacityOf(const TransferFunction& function, double scalar) {
  return -std::expm1(-function.at(scalar).extinction * function.opacityUnit());
}

TEST(TransferFunction, PresetsMatchTheirMapsAndShowMoreWhereTheScalarIsHigh) {
  const struct {
    const char* name;
    glm::dvec3 low, middle, high;  // matplotlib's and ParaView's own values
  } expected[] = {
      {"viridis",
       {0.267004, 0.004874, 0.329415},
       {0.127568, 0.566949, 0.550556},
       {0.993248, 0.906157, 0.143936}},
      {"inferno",
       {0.001462, 0.000466, 0.013866},
       {0.735683, 0.215906, 0.330245},
       {0.988362, 0.998364, 0.644924}},
      {"plasma",
       {0.050383, 0.029803, 0.527975},
       {0.798216, 0.280197, 0.469538},
       {0.940015, 0.975158, 0.131326}},
      {"cool-warm", {0.231373, 0.298039, 0.752941}, {0.865, 0.865, 0.865}, {0.705882, 0.015686, 0.149020}},
      {"grey", {0, 0, 0}, {0.5, 0.5, 0.5}, {1, 1, 1}}};
  for (const auto& e : expected) {
    const TransferFunction function = TransferFunction::preset(e.name, -10, 30, 2);
    EXPECT_EQ(function.range(), std::pair(-10.0, 30.0));
    expectColour(function.at(-10).colour, e.low, 0.003);
    expectColour(function.at(-10 + 40 * 128 / 255.0).colour, e.middle, 0.005);
    expectColour(function.at(30).colour, e.high, 0.003);
    EXPECT_GT(function.at(30).extinction, function.at(12).extinction);
    EXPECT_TRUE(function.notes().empty());
  }
  EXPECT_EQ(TransferFunction::preset("viridis", 0, 1, 1).at(0).extinction, 0);
  const TransferFunction diverging = TransferFunction::preset("cool-warm", 0, 1, 1);
  EXPECT_EQ(diverging.at(0.5).extinction, 0);
  EXPECT_EQ(diverging.at(0).extinction, diverging.at(1).extinction);
}

TEST(TransferFunction, AnUnknownPresetIsAnsweredWithTheClosest) {
  try {
    TransferFunction::preset("virdis", 0, 1, 1);
    FAIL() << "accepted";
  } catch (const UsageError& error) {
    const std::string what = error.what();
    expectSays(what, "did you mean viridis?");
    expectSays(what, "curvisplat colormaps");
  }
}

TEST(TransferFunction, PublishedMapsHaveTheirPublishedColours) {
  EXPECT_GE(builtInMaps().size(), 40u);
  const auto expectColour = [](const char* map, double x, const glm::dvec3& expected) {
    const glm::dvec3 colour = TransferFunction::preset(map, 0, 1, 1).at(x).colour;
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(colour[channel], expected[channel], 1.01 / 255) << map << " at " << x;
  };
  // From matplotlib 3.6.3 (cmap(x), 256 colours), cmocean's tables and ParaView's presets.
  expectColour("magma", 128.0 / 255, {0.716387, 0.214982, 0.47529});
  expectColour("turbo", 64.0 / 255, {0.15844, 0.73551, 0.92305});
  expectColour("RdBu", 0.5, {0.969, 0.969, 0.969});
  expectColour("thermal", 0, {4 / 255.0, 35 / 255.0, 51 / 255.0});
  expectColour("balance", 1, {60 / 255.0, 9 / 255.0, 18 / 255.0});
  expectColour("Cool-Warm-Extended", 0, {0, 0, 0.34902});
  expectColour("blue-red-rainbow", 0.5, {0, 1, 0});
  for (const PublishedMap& map : builtInMaps()) {
    const std::string name(map.name);
    const TransferFunction forward = TransferFunction::preset(name, 0, 1, 1);
    const TransferFunction reversed = TransferFunction::preset(name + "_r", 0, 1, 1);
    for (const double x : {0.0, 0.3, 1.0})
      for (int channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(forward.at(x).colour[channel], reversed.at(1 - x).colour[channel], 1e-3) << name;
    EXPECT_EQ(forward.at(0.5).extinction == 0, map.category == MapCategory::kDiverging) << name;
  }
}

TEST(TransferFunction, AConstantScalarGetsTheMiddle) {
  for (const double value : {0.0, -7.0, 1e-12}) {
    const TransferFunction function = TransferFunction::preset("grey", value, value, 1);
    expectColour(function.at(value).colour, glm::dvec3(0.5), 1e-6);
    ASSERT_EQ(function.notes().size(), 1u);
  }
}

TEST(TransferFunction, NanHasNoExtinction) {
  EXPECT_EQ(TransferFunction::preset("grey", 0, 1, 1).at(NAN).extinction, 0);
}

class TransferFunctionFile : public testing::Test {
 protected:
  TransferFunctionFile() : path_(testing::TempDir() + fmt::format("tf_{}.json", getpid())) {}
  ~TransferFunctionFile() override { std::filesystem::remove(path_); }

  TransferFunction open(const std::string& text, const std::pair<double, double>* range = nullptr,
                        double unit = 0) {
    std::ofstream(path_) << text;
    return TransferFunction::fromFile(path_, range, unit, 5.0);
  }
  TransferFunction open(const Json& preset, const std::pair<double, double>* range = nullptr,
                        double unit = 0) {
    return open(Json::array({preset}).dump(), range, unit);
  }
  /// Opens, and expects an Error that names the file and has all of `words`.
  template <typename Input>
  void expectError(const Input& input, const std::vector<std::string>& words) {
    SCOPED_TRACE(testing::PrintToString(input));
    curvisplat::expectError([&] { open(input); }, {path_.string()});
    curvisplat::expectError([&] { open(input); }, words);
  }

  const std::filesystem::path path_;
  const Json plain_ = {{"Name", "plain"},
                       {"ColorSpace", "RGB"},
                       {"RGBPoints", {10, 0, 0, 0, 20, 1, 0.5, 0}},
                       {"Points", {10, 0.1, 0.5, 0, 20, 0.9, 0.5, 0}}};
};

TEST_F(TransferFunctionFile, IsTakenAsItIs) {
  const TransferFunction function = open(plain_);
  EXPECT_EQ(function.name(), "plain");
  EXPECT_EQ(function.range(), std::pair(10.0, 20.0));
  EXPECT_TRUE(function.notes().empty());
  expectColour(function.at(15).colour, {0.5, 0.25, 0}, 1e-12);
  EXPECT_NEAR(opacityOf(function, 15), 0.5, 1e-12);
  EXPECT_NEAR(function.at(15).extinction, -std::log(0.5) / 5, 1e-12);
}

TEST_F(TransferFunctionFile, TheFirstPresetOfAListIsUsedWhichIsReported) {
  Json other = plain_;
  other["Name"] = "other";
  const TransferFunction function = open(Json::array({plain_, other}).dump());
  EXPECT_EQ(function.name(), "plain");
  ASSERT_EQ(function.notes().size(), 1u);
  expectSays(function.notes()[0], "2 presets");
  EXPECT_EQ(open(plain_.dump()).name(), "plain") << "an object instead of a list";
}

TEST_F(TransferFunctionFile, StretchesColoursAndOpacitiesEachByTheirOwnEnds) {
  Json preset = plain_;
  preset["Points"] = {0, 0, 0.5, 0, 0.5, 0.8, 0.5, 0, 1, 0, 0.5, 0};
  const std::pair<double, double> range(-1, 3);
  const TransferFunction function = open(preset, &range);
  EXPECT_EQ(function.range(), range);
  expectColour(function.at(0).colour, {0.25, 0.125, 0}, 1e-12);
  EXPECT_NEAR(opacityOf(function, 1), 0.8, 1e-12);
  EXPECT_NEAR(opacityOf(function, 0), 0.4, 1e-12);
}

TEST_F(TransferFunctionFile, RangeSpansOpacitiesToo) {
  Json preset = plain_;
  preset["Points"] = {5, 0, 0.5, 0, 40, 1, 0.5, 0};
  EXPECT_EQ(open(preset).range(), std::pair(5.0, 40.0));
}

TEST_F(TransferFunctionFile, UnsortedPointsAreSorted) {
  Json preset = plain_;
  preset["RGBPoints"] = {20, 1, 0.5, 0, 10, 0, 0, 0};
  preset["Points"] = {20, 0.9, 0.5, 0, 10, 0.1, 0.5, 0};
  const TransferFunction function = open(preset);
  EXPECT_EQ(function.range(), std::pair(10.0, 20.0));
  expectColour(function.at(15).colour, {0.5, 0.25, 0}, 1e-12);
}

TEST_F(TransferFunctionFile, OpacityUnitByPrecedence) {
  EXPECT_EQ(open(plain_).opacityUnit(), 5);
  Json preset = plain_;
  preset["ScalarOpacityUnitDistance"] = 0.25;
  EXPECT_EQ(open(preset).opacityUnit(), 0.25);
  EXPECT_EQ(open(preset, nullptr, 3).opacityUnit(), 3);
}

TEST_F(TransferFunctionFile, OpacityOneIsCapped) {
  Json preset = plain_;
  preset["Points"] = {10, 1, 0.5, 0, 20, 1, 0.5, 0};
  EXPECT_NEAR(open(preset, nullptr, 2).at(12).extinction, -std::log(1e-4) / 2, 1e-9);
}

TEST_F(TransferFunctionFile, WithoutPointsGetsTheDefaultRampWhichIsReported) {
  Json preset = plain_;
  preset.erase("Points");
  const TransferFunction function = open(preset);
  ASSERT_EQ(function.notes().size(), 1u);
  expectSays(function.notes()[0], "no Points");
  const TransferFunction grey = TransferFunction::preset("grey", 10, 20, 5);
  for (double x = 9; x < 22; x += 0.5) EXPECT_NEAR(function.at(x).extinction, grey.at(x).extinction, 1e-12);
}

TEST_F(TransferFunctionFile, ColourSpacesAreHonoured) {
  Json preset = plain_;
  preset["RGBPoints"] = {0, 1, 0, 0, 1, 0, 0, 1};
  const std::pair<const char*, ColourSpace> spaces[] = {{"RGB", ColourSpace::kRgb},
                                                        {"HSV", ColourSpace::kHsv},
                                                        {"HSVNoWrap", ColourSpace::kHsvNoWrap},
                                                        {"Lab", ColourSpace::kLab},
                                                        {"Diverging", ColourSpace::kDiverging},
                                                        {"Step", ColourSpace::kStep}};
  for (const auto& [name, space] : spaces) {
    preset["ColorSpace"] = name;
    expectColour(open(preset).at(0.3).colour, redToBlue(space).at(0.3), 1e-12);
  }
  preset["ColorSpace"] = "HSV";
  preset["HSVWrap"] = 0;
  expectColour(open(preset).at(0.3).colour, redToBlue(ColourSpace::kHsvNoWrap).at(0.3), 1e-12);
}

TEST_F(TransferFunctionFile, LogScaleInterpolatesInTheLogarithm) {
  for (const char* field : {"UseLogScale", "LogScale"}) {
    Json preset = plain_;
    preset[field] = 1;
    preset["RGBPoints"] = {1, 0, 0, 0, 100, 1, 1, 1};
    preset["Points"] = {1, 0, 0.5, 0, 100, 0.8, 0.5, 0};
    const TransferFunction function = open(preset);
    EXPECT_TRUE(function.logScale());
    EXPECT_NEAR(function.at(10).colour.r, 0.5, 1e-12);
    EXPECT_NEAR(opacityOf(function, 10), 0.4, 1e-12);
    EXPECT_EQ(function.at(0).colour.r, 0) << "zero and below: the lower end goes on";
    EXPECT_EQ(function.at(-3).extinction, 0);
    const std::pair<double, double> range(1e-3, 1e5);
    EXPECT_NEAR(open(preset, &range).at(10).colour.r, 0.5, 1e-12);
  }
}

TEST_F(TransferFunctionFile, LogScaleOverAnUnstatedIntervalFollowsTheRange) {
  Json preset = plain_;
  preset["UseLogScale"] = true;
  preset["RGBPoints"] = {0, 0, 0, 0, 1, 1, 1, 1};
  preset.erase("Points");
  const std::pair<double, double> range(1, 100);
  const TransferFunction function = open(preset, &range);
  EXPECT_NEAR(function.at(10).colour.r, 0.5, 1e-12);
  const TransferFunction grey = TransferFunction::preset("grey", 0, 2, 5);
  EXPECT_NEAR(function.at(10).extinction, grey.at(1).extinction, 1e-12) << "the ramp is in the logarithm too";
}

TEST_F(TransferFunctionFile, LogScaleNeedsPositiveScalars) {
  Json preset = plain_;
  preset["UseLogScale"] = 1;
  preset["RGBPoints"] = {0, 0, 0, 0, 20, 1, 0.5, 0};
  expectError(preset, {"UseLogScale", "begin at 0", "--range"});
  const std::pair<double, double> negative(-1, 1), positive(1, 2);
  EXPECT_THROW(open(preset, &negative), UsageError);
  EXPECT_NO_THROW(open(preset, &positive));
  preset["RGBPoints"] = {1, 0, 0, 0, 20, 1, 0.5, 0};
  preset["Points"] = {-1, 0, 0.5, 0, 20, 1, 0.5, 0};
  expectError(preset, {"UseLogScale", "begin at -1"});
}

TEST_F(TransferFunctionFile, AReversedRangeIsWrongUsage) {
  const std::pair<double, double> range(3, 2);
  EXPECT_THROW(open(plain_, &range), UsageError);
}

TEST_F(TransferFunctionFile, NanColorIsReadButReportedAsUnused) {
  Json preset = plain_;
  preset["NanColor"] = {0.25, 0, 1};
  const TransferFunction function = open(preset);
  expectColour(function.at(NAN).colour, {0.25, 0, 1}, 0);
  EXPECT_EQ(function.at(NAN).extinction, 0);
  ASSERT_EQ(function.notes().size(), 1u);
  expectSays(function.notes()[0], "NanColor");
}

TEST_F(TransferFunctionFile, MalformedFieldsAreNamed) {
  const struct {
    const char* field;
    Json value;
    const char* found;
  } cases[] = {{"RGBPoints", {1, 2, 3, 4, 5}, "not 5 in all"},
               {"RGBPoints", Json::array(), "not 0 in all"},
               {"RGBPoints", "viridis", "\"viridis\""},
               {"RGBPoints", {0, 0, "a", 0}, "RGBPoints[2]"},
               {"RGBPoints", {0, 0, 0, 0, 1, 1, 1.5, 1}, "1.5"},
               {"RGBPoints", {0, 0, 0, 0, 0, 1, 1, 1}, "two or more different"},
               {"RGBPoints", {0, 0, 0, 0}, "two or more different"},
               {"Points", {0, 1, 0.5}, "not 3 in all"},
               {"Points", {0, -0.1, 0.5, 0, 1, 1, 0.5, 0}, "-0.1"},
               {"Points", {0, 0, 1.5, 0, 1, 1, 0.5, 0}, "midpoints"},
               {"Points", {0, 0, 0.5, 2, 1, 1, 0.5, 0}, "sharpnesses"},
               {"ColorSpace", "CMYK", "CMYK"},
               {"ColorSpace", 3, "3"},
               {"UseLogScale", "yes", "yes"},
               {"UseLogScale", 2, "2"},
               {"NanColor", {1, 0}, "three numbers"},
               {"NanColor", {1, 0, 0, 1, 0, 0}, "three numbers"},
               {"NanColor", {1, 0, 7}, "7"},
               {"ScalarOpacityUnitDistance", 0, "0"},
               {"ScalarOpacityUnitDistance", "far", "far"},
               {"Name", 12, "12"}};
  for (const auto& c : cases) {
    Json preset = plain_;
    preset[c.field] = c.value;
    SCOPED_TRACE(preset.dump());
    expectError(preset, {c.field, c.found});
  }
  Json preset = plain_;
  preset.erase("RGBPoints");
  expectError(preset, {"RGBPoints", "is missing"});
}

TEST_F(TransferFunctionFile, CategoriesAreRefused) {
  Json preset = {{"Name", "elements"}, {"IndexedColors", {1, 0, 0, 0, 1, 0}}};
  expectError(preset, {"IndexedColors", "continuous"});
  preset = plain_;
  preset["IndexedColors"] = {1, 0, 0};
  EXPECT_NO_THROW(open(preset)) << "there is a continuous map beside them";
  preset["IndexedLookup"] = 1;
  expectError(preset, {"IndexedColors"});
}

TEST_F(TransferFunctionFile, OtherFilesAreRefused) {
  expectError(std::string(), {"JSON"});
  expectError(std::string("<ColorMap name=\"x\"/>"), {"JSON"});
  expectError(std::string("[]"), {"colour-map preset"});
  expectError(std::string("[3]"), {"object"});
  expectError(std::string("\"text\""), {"object"});
  expectError(std::string("[{\"Name\": \"a\", \"RGBPoints\": [0,0,0,0, 1e999,1,1,1]}]"), {"JSON"});
  const std::string whole = Json::array({plain_}).dump();
  for (size_t length = 0; length < whole.size(); ++length) expectError(whole.substr(0, length), {"JSON"});
  expectError(std::string("[{\"Name\": \"a\\nb\"}]"), {"RGBPoints", "is missing"});
  std::filesystem::remove(path_);
  EXPECT_THROW(TransferFunction::fromFile(path_, nullptr, 0, 1), Error);
}

}  // namespace
}  // namespace curvisplat
