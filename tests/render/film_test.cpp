// Films: what key frames show, what is shown between them, and the file.
#include "render/film/film.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "render/colour/function_blend.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

constexpr const char* kCamera =
    R"("position": [5, 0, 0], "focal_point": [0, 0, 0], "view_up": [0, 0, 1], "parallel_scale": 1.5)";

class FilmTest : public testing::Test {
 protected:
  Film read(const std::string& text) {
    std::ofstream(folder_ / "film.json") << text;
    return Film::fromFile(folder_ / "film.json");
  }
  /// A film of key frames at 0, 2, 4, ... that have these fields besides.
  static std::string keys(const std::vector<std::string>& fields, const std::string& scalar = "") {
    std::string json = scalar.empty() ? "{" : "{\"scalar\": \"" + scalar + "\", ";
    json += "\"key_frames\": [";
    for (size_t n = 0; n < fields.size(); ++n)
      json += fmt::format("{}{{\"time\": {}, {}{}{}}}", n == 0 ? "" : ", ", 2 * n, kCamera,
                          fields[n].empty() ? "" : ", ", fields[n]);
    return json + "]}";
  }
  void expectRefused(const std::vector<std::string>& fields, const std::vector<std::string>& words) {
    const std::string error = errorOf([&] { read(keys(fields)); });
    for (const std::string& word : words) EXPECT_NE(error.find(word), std::string::npos) << error;
    EXPECT_NE(error.find("film.json: "), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }

  TemporaryFolder folder_;
};

std::string parts(const std::string& map, const std::string& range, const std::string& opacities,
                  const std::string& unit = "0.5") {
  return fmt::format(R"("function": {{"map": "{}", "range": [{}], "opacities": "{}", "opacity_unit": {}}})",
                     map, range, opacities, unit);
}

TransferFunction functionAt(const Film& film, double time) {
  const auto definition = film.lookAt(time).function.value();
  return TransferFunction(definition, nullptr, definition.opacity_unit);
}

void expectSameFunction(const TransferFunction& a, const TransferFunction& b, double tolerance) {
  EXPECT_NEAR(a.range().first, b.range().first, 1e-12);
  EXPECT_NEAR(a.range().second, b.range().second, 1e-12);
  for (double x = a.range().first; x <= a.range().second; x += 0.0137) {
    EXPECT_NEAR(a.extinctionAt(x), b.extinctionAt(x), tolerance * (1 + b.extinctionAt(x))) << x;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.at(x).colour[c], b.at(x).colour[c], tolerance) << x;
  }
}

TEST_F(FilmTest, OneMapMovesItsRangeAndItsPoints) {
  const Film film = read(keys({parts("viridis", "0, 1", "0:0,0.2:0.1,1:0.5", "0.25"),
                               parts("viridis", "2, 5", "0:0.4,0.6:0.3,1:0.1", "1")}));
  EXPECT_TRUE(film.functionsChange());
  expectSameFunction(functionAt(film, 0),
                     FunctionParts{"viridis", {0, 1}, {}, {{0, 0}, {0.2, 0.1}, {1, 0.5}}, 0.25}.function(),
                     0);
  expectSameFunction(functionAt(film, 2),
                     FunctionParts{"viridis", {2, 5}, {}, {{0, 0.4}, {0.6, 0.3}, {1, 0.1}}, 1}.function(), 0);
  // Half way the range is 1 to 3.
  expectSameFunction(functionAt(film, 1),
                     FunctionParts{"viridis", {1, 3}, {}, {{0, 0.2}, {0.4, 0.2}, {1, 0.3}}, 0.5}.function(),
                     1e-9);
}

TEST_F(FilmTest, OtherMapsAndCountsOfPointsAreBlended) {
  const Film film = read(keys({parts("viridis", "0, 1", "0:0,0.5:0.8,1:0"),
                               parts("cool-warm", "0, 1", "0:0.2,0.25:0.2,0.25:0.6,1:0.6")}));
  const TransferFunction a = functionAt(film, 0), b = functionAt(film, 2);
  const auto opacityOf = [](const TransferFunction& f, double x) {
    return 1 - std::exp(-f.extinctionAt(x) * f.opacityUnit());
  };
  for (const double part : {0.001, 0.3, 0.999}) {
    const TransferFunction between = functionAt(film, 2 * part);
    for (double x = 0.003; x < 1; x += 0.01) {
      EXPECT_NEAR(opacityOf(between, x), std::lerp(opacityOf(a, x), opacityOf(b, x), part), 1e-6) << x;
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(between.at(x).colour[c], std::lerp(a.at(x).colour[c], b.at(x).colour[c], part), 2e-3)
            << x;
    }
  }
}

TEST_F(FilmTest, ColoursOfOneSpaceChangeInIt) {
  TransferFunctionDefinition red, green;
  red.colour_space = green.colour_space = ColourSpace::kHsv;
  red.colours = {{0, {1, 0, 0}}, {1, {1, 0, 0}}};
  green.colours = {{0, {0, 1, 0}}, {1, {0, 1, 0}}};
  red.opacity_unit = green.opacity_unit = 1;
  const TransferFunctionDefinition between = blended(red, green, 0.5);
  EXPECT_NEAR(between.colours[1].rgb.x, 1, 1e-9);  // yellow
  EXPECT_NEAR(between.colours[1].rgb.y, 1, 1e-9);
  // Msh has white between blue and red; in time there is none.
  red.colour_space = green.colour_space = ColourSpace::kDiverging;
  green.colours = {{0, {0, 0, 1}}, {1, {0, 0, 1}}};
  const glm::dvec3 violet = blended(red, green, 0.5).colours[0].rgb;
  EXPECT_LT(violet.y, 0.3);
}

TEST_F(FilmTest, BoxesAndPlanesMove) {
  const Film film = read(keys(
      {R"("clip_box": [0, 1, 0, 2, 0, 3], "clip_planes": [[1, 0, 0, 2, 0, 0]], "slices": [[0, 0, 0, 1, 0, 0]])",
       R"("clip_box": [1, 2, 0, 2, -1, 5], "clip_planes": [[3, 2, 0, 0, 0.5, 0]], "slices": [[0, 0, 1, -1, 0, 0]])",
       R"("clip_planes": [])"}));
  const KeyLook first = film.lookAt(0);
  EXPECT_EQ(first.clip_planes->at(0).normal, glm::dvec3(2, 0, 0));  // as it is given
  const KeyLook half = film.lookAt(1);
  EXPECT_EQ(half.clip_box->lower, glm::dvec3(0.5, 0, -0.5));
  EXPECT_EQ(half.clip_box->upper, glm::dvec3(1.5, 2, 4));
  EXPECT_EQ(half.clip_planes->at(0).point, glm::dvec3(2, 1, 0));
  const glm::dvec3 normal = half.clip_planes->at(0).normal;
  EXPECT_NEAR(normal.x, std::numbers::sqrt2 / 2, 1e-12);
  EXPECT_NEAR(normal.y, std::numbers::sqrt2 / 2, 1e-12);
  EXPECT_NEAR(std::hypot(half.slices->at(0).normal.y, half.slices->at(0).normal.z), 1, 1e-12);  // opposite
  // What the next key frame lacks stays until then.
  EXPECT_EQ(film.lookAt(3.9).clip_box->upper, glm::dvec3(2, 2, 5));
  EXPECT_EQ(film.lookAt(3.9).clip_planes->size(), 1u);
  EXPECT_FALSE(film.lookAt(4).clip_box);
  EXPECT_TRUE(film.lookAt(9).clip_planes->empty());
  EXPECT_TRUE(film.lookAt(4).slices->empty());
  EXPECT_TRUE(film.stated().slices);
  EXPECT_FALSE(film.stated().functions);
}

/// The place of the data in focus is (2, 3, 4), whatever the scale.
TEST_F(FilmTest, CamerasKeepTheirPlaceInAnotherScale) {
  const std::string keys_of_scale =
      R"({{"scale": {}, "key_frames": [{{"time": 0, "position": [12, 3, 200], "focal_point": [2, 3, 200],
      "view_up": [0, 0, 1], "view_angle": 20}}]}})";
  const Film film = read(fmt::format(fmt::runtime(keys_of_scale), "[1, 1, 50]"));
  EXPECT_EQ(film.scale(), glm::dvec3(1, 1, 50));
  const Film moved = film.inScale({3, 1, 10});
  const Camera camera = moved.cameras().at(0);
  EXPECT_EQ(camera.focal_point, glm::dvec3(6, 3, 40));
  EXPECT_EQ(camera.position, glm::dvec3(16, 3, 40));
  EXPECT_EQ(camera.view_angle_deg, 20);
  const Film again = read(moved.toJson());
  EXPECT_EQ(again.scale(), glm::dvec3(3, 1, 10));
  EXPECT_EQ(again.cameras().at(0).position, camera.position);
  // One that states no scale is for any.
  const Film any = read(keys({"", ""}));
  EXPECT_FALSE(any.scale());
  EXPECT_EQ(any.inScale({1, 1, 50}).cameras().at(0).position, glm::dvec3(5, 0, 0));
  EXPECT_EQ(any.toJson().find("scale\": ["), std::string::npos);
  for (const char* wrong : {"[1, 1]", "[1, 0, 1]", "[1, 1, 1e7]", "2"}) {
    const std::string error = errorOf([&] { read(fmt::format(fmt::runtime(keys_of_scale), wrong)); });
    EXPECT_NE(error.find("scale"), std::string::npos) << error;
  }
}

TEST_F(FilmTest, APathOfCamerasStatesNothingElse) {
  const Film film = read(keys({"", ""}));
  EXPECT_FALSE(film.stated().any());
  EXPECT_FALSE(film.lookAt(1).clip_planes);
  EXPECT_EQ(film.timeOf(0, 90), 0);
  EXPECT_EQ(film.timeOf(89, 90), 2);
  EXPECT_EQ(film.timeOf(1, 3), 1);
  EXPECT_EQ(film.timeOf(0, 1), 0);
}

TEST_F(FilmTest, IsWrittenAsItIsRead) {
  const std::string preset =
      R"("function": {"Name": "mine", "ColorSpace": "Lab", "RGBPoints": [1, 0, 0, 1, 9, 1, 0.5, 0],
    "Points": [1, 0, 0.3, 0.2, 9, 0.7, 0.5, 0], "ScalarOpacityUnitDistance": 0.25, "UseLogScale": 1})";
  for (const std::string& function : {preset, parts("plasma", "-1, 1", "0:0,1:0.5")}) {
    const Film film = read(keys({function + R"(, "series_time": 3, "clip_box": [0, 1, 0, 1, 0, 1])",
                                 function + R"(, "series_time": 4, "slices": [[1, 2, 3, 0, 0, 1]])"},
                                "density"));
    const std::string text = film.toJson();
    EXPECT_EQ(read(text).toJson(), text);
    EXPECT_EQ(film.scalar(), "density");
    EXPECT_FALSE(film.functionsChange());
    EXPECT_EQ(film.cameras().seriesTimeAt(1), 3.5);
    expectSameFunction(functionAt(read(text), 1), functionAt(film, 0), 1e-9);
  }
}

TEST_F(FilmTest, NamesTheKeyFrameAndTheField) {
  const std::string good = parts("viridis", "0, 1", "0:0,1:0.5");
  expectRefused({good, ""}, {"key frame 1 has no function"});
  expectRefused({good, R"("function": 7)"}, {"key_frames[1].function"});
  expectRefused({good, parts("nothing", "0, 1", "0:0,1:1")}, {"key_frames[1].function.map", "colormaps"});
  expectRefused({parts("viridis", "1, 1", "0:0,1:1")}, {"key_frames[0].function.range"});
  expectRefused({parts("viridis", "-1e200, 1", "0:0,1:1")}, {"key_frames[0].function.range", "1e30"});
  expectRefused(
      {R"("function": {"RGBPoints": [0, 0, 0, 1, 1e99, 1, 0.5, 0], "ScalarOpacityUnitDistance": 1})"},
      {"key_frames[0].function", "1e30"});
  expectRefused({parts("viridis", "0, 1", "0:0,2:1")}, {"key_frames[0].function.opacities"});
  expectRefused({parts("viridis", "0, 1", "0:0,1:1", "0")}, {"key_frames[0].function.opacity_unit"});
  expectRefused({R"("function": {"map": "viridis", "range": [0, 1]})"},
                {"key_frames[0].function", "opacity_unit"});
  expectRefused({R"("function": {"RGBPoints": [0, 0, 0, 1, 1, 1, 0.5, 0]})"},
                {"key_frames[0].function", "ScalarOpacityUnitDistance"});
  expectRefused({R"("function": {"RGBPoints": [0, 0, 0]})"}, {"key_frames[0].function", "RGBPoints"});
  expectRefused({R"("function": {"RGBPoints": [-1, 0, 0, 1, 1, 1, 0.5, 0], "UseLogScale": 1,
                     "ScalarOpacityUnitDistance": 1})"},
                {"key_frames[0].function", "above zero"});
  expectRefused({good, R"("function": {"RGBPoints": [1, 0, 0, 1, 2, 1, 0.5, 0], "UseLogScale": 1,
                           "ScalarOpacityUnitDistance": 1})"},
                {"key frame 1", "logarithmic"});
  expectRefused({R"("clip_box": [0, 1, 0, 1, 0])"}, {"key_frames[0].clip_box", "six numbers"});
  expectRefused({R"("clip_box": [0, 1, 0, 1, 2, 1])"}, {"key_frames[0].clip_box", "z0 < z1"});
  expectRefused({"", R"("clip_planes": [[0, 0, 0, 0, 0, 0]])"}, {"key_frames[1].clip_planes[0]", "normal"});
  expectRefused({R"("slices": [[0, 0, 0, 1e200, 0, 0]])"}, {"key_frames[0].slices[0]"});
  expectRefused({R"("slices": [1, 2])"}, {"key_frames[0].slices[0]"});
  expectRefused({R"("clip_planes": [1, 1, 1, 1, 1, 1, 1])"}, {"key_frames[0].clip_planes"});
}

}  // namespace
}  // namespace curvisplat
