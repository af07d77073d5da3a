#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/text.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tools/view/picture_layout.h"
#include "tools/view/saved_views.h"
#include "tools/view/view_state.h"

namespace curvisplat {
namespace {

Manifest manifest() {
  Manifest made;
  made.lower = {0, 0, 0};
  made.upper = {2, 1, 1};
  made.variables = {{0, "density", "kg/m3", 0.5, 3}, {1, "u v", "", -1, 1}};
  return made;
}

ViewState changedState() {
  ViewState state = firstViewOf(manifest(), {300, 200});
  chooseVariable(state, manifest(), "u v");
  state.camera.position = {0.1, -3, 2.0 / 3};
  state.function.addPoint(0.3, 0.7);
  state.function.thinColours();
  state.function.setColour(1, {1, 0, 0.5});
  state.opacity_by = OpacityScalar{"density", EditedFunction("inferno", 0.5, 2, 0.1)};
  state.opacity_by->function.addPoint(0.25, 0.5);
  state.markers = {{"nose", {0.5, 0.25, 0.125}, "density", "kg/m3", 1.5, 2, 3, 4, 5}};
  state.lod_pixels = 2.5;
  state.scale = {1, 1, 50};
  state.clip_box = WorldBox{{0, -0.5, 0.25}, {1, 1, 1}};
  state.clip_planes = {{ClipPlane{{0, 0.5, 0}, {1, 0, -2}}}, {ClipPlane{{0.25, 0, 0}, {0, 1, 0}}, false}};
  state.surfaces = {{"/a/wing.stl", {1, 0.5f, 0}, nullptr, 0.25, false}};
  state.faces = {{"block 3:k=min", {0, 1, 0.5f}, {0.5, true}}, {"walls", {0.5f, 0.5f, 0.5f}, {}, false}};
  state.faces_by = FacesScalar{"density", EditedFunction("magma", 0.5, 2, 0.1)};
  state.isosurfaces = {{"density", 0.25, true, glm::vec3(1, 0.5f, 0)}, {"u v", -0.5, false}};
  state.iso_opacity = {0.75, true};
  state.slices = {{ClipPlane{{0, 0.25, 0}, {0, -1, 2}}, false}};
  state.slice_opacity = {0.5, true};
  state.volume = false;
  state.lit = true;
  state.shadow = 0.5;
  state.ambient_occlusion = 0.25;
  state.light_strength = 0.5;
  state.light_direction = {1, 0, 2};
  state.gradient_opacity = {{0, 0.25}, {0.5, 1}, {1, 0}};
  state.dark = true;
  state.annotations.axes = false;
  state.classification = Classification::kFlat;
  return state;
}

/// The page changes the points alone: a built-in map and its opacities are stated by options even so.
TEST(ViewState, PointsOfABuiltInMapNeedNoFile) {
  Manifest manifest;
  manifest.upper = {1, 1, 1};
  manifest.variables = {{0, "density", "", 0, 1}};
  ViewState state = firstViewOf(manifest, {300, 200});
  auto json = nlohmann::ordered_json::parse(toJson(state));
  const EditedFunction viridis("viridis", 2, 4, 0.5);
  json["function"] = nlohmann::ordered_json::parse(toParaViewPreset(viridis.definition())).front();
  json["preset"] = "";
  const ViewState read = viewStateFromJson(json.dump(), "test", manifest);
  ASSERT_TRUE(read.function.parts());
  EXPECT_EQ(read.function.parts()->map, "viridis");
  EXPECT_EQ(read.function.range(), std::pair(2.0, 4.0));
  EXPECT_NE(renderCommand(read, {}).find("--tf viridis --range 2,4"), std::string::npos)
      << renderCommand(read, {});
  json["function"]["RGBPoints"][1] = 0.9;  // a colour that is not the map's
  EXPECT_TRUE(needsFile(viewStateFromJson(json.dump(), "test", manifest).function));
}

TEST(ViewState, ComesBackFromItsText) {
  const std::string text = toJson(changedState());
  const auto before = nlohmann::json::parse(text).flatten();
  const auto after = nlohmann::json::parse(toJson(viewStateFromJson(text, "a.json", manifest()))).flatten();
  ASSERT_EQ(before.size(), after.size());
  for (const auto& [field, value] : before.items()) {
    ASSERT_TRUE(after.contains(field)) << field;
    if (value.is_number())
      EXPECT_NEAR(value.get<double>(), after.at(field).get<double>(), 1e-12)
          << field;  // moved to 0..1 and back
    else
      EXPECT_EQ(value, after.at(field)) << field;
  }
}

TEST(ViewState, OfAnEarlierVersionHasNoClipPlanesAndNoLight) {
  auto json = nlohmann::json::parse(toJson(changedState()));
  for (const char* field :
       {"clip_planes", "surfaces", "faces", "faces_by", "isovalues", "isosurfaces", "iso_opacity",
        "isosurfaces_by_function", "slices", "slice_opacity", "slices_by_function", "volume"})
    json.erase(field);
  for (const char* field : {"lit", "shadow", "ambient_occlusion", "light_strength", "light_direction"})
    json.erase(field);
  json.erase("gradient_opacity");
  const ViewState state = viewStateFromJson(json.dump(), "a.json", manifest());
  EXPECT_TRUE(state.clip_planes.empty());
  EXPECT_TRUE(state.surfaces.empty());
  EXPECT_TRUE(state.faces.empty());
  EXPECT_FALSE(state.faces_by);
  EXPECT_TRUE(state.isosurfaces.empty());
  EXPECT_TRUE(state.slices.empty());
  EXPECT_TRUE(state.volume);
  EXPECT_FALSE(state.lit);
  EXPECT_EQ(state.shadow + state.ambient_occlusion, 0);
  EXPECT_EQ(state.light_strength, ViewState::kLightStrength);
  EXPECT_FALSE(state.light_direction);
  EXPECT_TRUE(state.gradient_opacity.empty());
}

TEST(ViewState, APresetStaysOne) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.function.setRange(1, 2);
  const ViewState again = viewStateFromJson(toJson(state), "a.json", manifest());
  EXPECT_EQ(again.function.preset(), "glow");
  EXPECT_EQ(again.function.range(), std::pair(1.0, 2.0));
}

TEST(ViewState, ErrorsNameFileAndField) {
  const auto expectError = [](const char* pointer, const nlohmann::json& value, const std::string& word) {
    nlohmann::json json = nlohmann::json::parse(toJson(changedState()));
    json[nlohmann::json::json_pointer(pointer)] = value;
    curvisplat::expectError([&] { viewStateFromJson(json.dump(), "a.json", manifest()); }, {"a.json", word});
  };
  expectError("/curvisplat_view", 2, "curvisplat_view");
  expectError("/variable", "pressure", "variable");
  expectError("/variable", 3, "variable");
  expectError("/camera/position", nlohmann::json::array({1, 2}), "camera.position");
  expectError("/camera/view_angle", 180, "camera.view_angle");
  expectError("/camera/parallel_scale", -1, "camera.parallel_scale");
  expectError("/camera", nullptr, "camera");
  expectError("/gradient_opacity", "0.5", "gradient_opacity");
  expectError("/shadow", 2, "shadow");
  expectError("/light_strength", 2, "light_strength");
  expectError("/light_direction", nlohmann::json::array({0, 0, 0}), "light_direction");
  expectError("/scale", nlohmann::json::array({1, 1, 0}), "scale");
  expectError("/scale", nlohmann::json::array({1, 1e-7, 1}), "scale");
  expectError("/scale", nlohmann::json::array({1e7, 1, 1}), "scale");
  expectError("/clip_box/lower", nlohmann::json::array({5, 0, 0}), "clip_box.lower");
  expectError("/clip_planes", 3, "clip_planes");
  expectError("/slices/0/normal", nlohmann::json::array({0, 0, 0}), "slices[0].normal");
  expectError("/surfaces/0/colour", nlohmann::json::array({0, 0, 2}), "surfaces[0].colour");
  expectError("/faces/0/opacity", 2, "faces[0].opacity");
  expectError("/faces/1/colour", nlohmann::json::array({0, 0, 2}), "faces[1].colour");
  expectError("/faces_by/variable", "pressure", "faces_by.variable");
  expectError("/isosurfaces/1/value", "high", "isosurfaces[1].value");
  expectError("/isosurfaces/1/colour", nlohmann::json::array({0, 0, 2}), "isosurfaces[1].colour");
  expectError("/slice_opacity", 2, "slice_opacity");
  expectError("/slices_by_function", 2, "slices_by_function");
  expectError("/surfaces/0/opacity", 0, "surfaces[0].opacity");
  expectError("/clip_planes/1/normal", nlohmann::json::array({0, 0, 0}), "clip_planes[1].normal");
  expectError("/dark", "yes", "dark");
  expectError("/function", 5, "preset");
  expectError("/preset", "no map", "preset");
  expectError("/memory_bytes", -1, "memory_bytes");
  const auto messageOf = [](const std::string& text) -> std::string {
    return curvisplat::errorOf([&] { viewStateFromJson(text, "a.json", manifest()); });
  };
  EXPECT_EQ(messageOf("[]"), "a.json: is invalid (found [], expected an object)");
  EXPECT_EQ(messageOf("{\n  \"a\": 1,\n  oops\n}"),
            "a.json: is not JSON (found a syntax error at line 3, column 3, expected the state of a window)");
  EXPECT_EQ(messageOf(" \n"), "a.json: is not JSON (found no text, expected the state of a window)");
  EXPECT_EQ(messageOf("{\"a\": 1e999}"),
            "a.json: is not JSON (found a number that is too large, expected the state of a window)");
  nlohmann::json json = nlohmann::json::parse(toJson(changedState()));
  json["camera"] = 5;
  EXPECT_EQ(messageOf(json.dump()), "a.json: camera is invalid (found 5, expected an object)");
}

TEST(ViewState, VariablesKeepTheFunctionOverTheirOwnRange) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  EXPECT_EQ(state.function.range(), std::pair(0.5, 3.0));
  ASSERT_TRUE(state.function.setLogScale(true));
  chooseVariable(state, manifest(), "u v");
  EXPECT_EQ(state.function.range(), std::pair(-1.0, 1.0));
  EXPECT_FALSE(state.function.logScale());
  EXPECT_THROW(chooseVariable(state, manifest(), "w"), UsageError);
}

TEST(ViewState, OfAnotherCacheHasNothingOfScalarsThatThatLacks) {
  const ViewState before = changedState();
  ViewState same = before;
  leaveOtherScalars(same, manifest(), "density");
  EXPECT_EQ(toJson(same), toJson(before));

  Manifest other = manifest();
  other.variables = {{0, "half", "", 5, 6}};
  ViewState state = before;
  leaveOtherScalars(state, other, "half");
  EXPECT_EQ(state.variable, "half");
  EXPECT_EQ(state.function.range(), std::pair(5.0, 6.0));
  EXPECT_FALSE(state.opacity_by);
  EXPECT_FALSE(state.faces_by);
  ASSERT_EQ(state.isosurfaces.size(), 2u);  // which come back with their scalars
  for (const Isosurface& one : state.isosurfaces) EXPECT_FALSE(one.visible) << one.scalar;
  EXPECT_EQ(state.camera.position, before.camera.position);
  EXPECT_EQ(state.slices.size(), 1u);
}

TEST(ViewState, AnAutomaticFunctionComesBackWithItsScale) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  const FunctionParts parts{"inferno", {0.5, 3}, AsinhScale{1, 0.25}, {{0, 0.5}, {0.25, 0}, {1, 0.75}}, 0.5};
  state.function = EditedFunction::automatic(parts);
  const ViewState again = viewStateFromJson(toJson(state), "a.json", manifest());
  EXPECT_TRUE(again.function.isAutomatic());
  ASSERT_TRUE(again.function.parts());
  EXPECT_EQ(again.function.parts()->asinh->width, 0.25);
  EXPECT_EQ(again.function.points().size(), 3u);
  // It is the function that the parts state, and edits keep its scale.
  for (const double scalar : {0.5, 0.8, 1.0, 1.7, 3.0}) {
    EXPECT_NEAR(again.function.function().at(scalar).extinction, parts.function().at(scalar).extinction,
                1e-9);
    EXPECT_NEAR(again.function.scalarAt(again.function.coordinateOf(scalar)), scalar, 1e-12);
  }
}

/// The page edits the few points of an asinh function, and sends its curve in short lines that pass by the points' corners.
TEST(ViewState, APointOfAnAsinhFunctionIsEditedAsOne) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  FunctionParts parts{"inferno", {0.5, 3}, AsinhScale{1, 0.25}, {{0, 0.5}, {0.25, 0}, {1, 0.75}}, 0.5};
  state.function = EditedFunction::automatic(parts);
  auto json = nlohmann::ordered_json::parse(toJson(state));
  parts.opacities = {{0, 0.5}, {0.3337, 0.2}, {1, 0.75}};
  const EditedFunction edited(parts);
  json["parts"] = jsonOf(parts);
  json["function"] = nlohmann::ordered_json::parse(toParaViewPreset(edited.definition())).front();
  for (auto& number : json["function"]["Points"]) number = static_cast<double>(static_cast<float>(number));
  json["preset"] = "";
  const ViewState read = viewStateFromJson(json.dump(), "test", manifest());
  ASSERT_TRUE(read.function.parts());
  EXPECT_EQ(textOf(read.function.parts()->opacities), textOf(parts.opacities));
  // Whoever changes the curve alone need not know of the parts.
  json["parts"]["opacities"] = "0:0,1:1";
  const ViewState other = viewStateFromJson(json.dump(), "test", manifest());
  EXPECT_NEAR(other.function.function().at(2).extinction, edited.function().at(2).extinction, 1e-3);
}

TEST(ViewState, ATitleComesBackAndALongOneIsCutBetweenLetters) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  EXPECT_FALSE(state.annotations.texts);
  state.setTitle("wake {1}");
  const ViewState again = viewStateFromJson(toJson(state), "a.json", manifest());
  EXPECT_EQ(again.title, "wake {1}");
  EXPECT_TRUE(again.annotations.texts);
  state.setTitle("a" + std::string(198, 'b') + "\u00e4");  // 201 bytes
  EXPECT_EQ(state.title, "a" + std::string(198, 'b'));
  state.setTitle("");
  EXPECT_FALSE(viewStateFromJson(toJson(state), "a.json", manifest()).annotations.texts);
}

TEST(ViewState, MarkersAndTheOpacityScalarComeBack) {
  const ViewState again = viewStateFromJson(toJson(changedState()), "a.json", manifest());
  ASSERT_TRUE(again.opacity_by);
  EXPECT_EQ(again.opacity_by->variable, "density");
  EXPECT_EQ(again.opacity_by->function.range(), std::pair(0.5, 2.0));
  ASSERT_EQ(again.markers.size(), 1u);
  EXPECT_EQ(again.markers[0].name, "nose");
  EXPECT_EQ(again.markers[0].point, glm::dvec3(0.5, 0.25, 0.125));
  EXPECT_EQ(again.markers[0].k, 5u);
  auto json = nlohmann::json::parse(toJson(changedState()));
  json["opacity_by"]["variable"] = "pressure";
  EXPECT_THROW(viewStateFromJson(json.dump(), "a.json", manifest()), Error);
}

std::string commandText(const ViewState& state, const std::string& cache = "a.splats") {
  return renderCommand(state, {cache, {300, 200}, "f.json", "o.json"});
}

void expectParts(const std::string& command, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) expectSays(command, part);
}

TEST(ViewState, HeightsAreScaledAroundThePlaceInFocus) {
  Globe flat{Globe::Shape::kFlat, 6371, 20, 0};
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.scale = {1, 1, 2};
  state.camera.focal_point = {1, 2, 6};
  state.camera.position = {1, -5, 9};
  EXPECT_EQ(state.verticalScale(flat), 40);
  EXPECT_EQ(state.verticalScale(std::nullopt), 2);
  state.setVerticalScale(100, flat);
  EXPECT_EQ(state.scale, glm::dvec3(1, 1, 5));
  EXPECT_EQ(state.camera.focal_point / state.scale, glm::dvec3(1, 2, 3));
  EXPECT_EQ(state.camera.position - state.camera.focal_point, glm::dvec3(0, -7, 3));
  flat.vertical_scale = -20;  // heights that point down
  EXPECT_EQ(state.verticalScale(flat), 100);
}

TEST(PlaceText, HasDegreesOnAGlobeAndCoordinatesElsewhere) {
  EXPECT_EQ(placeText({0.5, -2.25, 1e6}, std::nullopt), "x 0.5, y -2.25, z 1e+06");
  const Globe lengths{Globe::Shape::kLengths, 6371, 20, 0};
  EXPECT_EQ(placeText({0.5, -2.25, 10}, lengths), "x 0.5, y -2.25, z 10");
  // A kilometre down, 50 times exaggerated, at 30° W, 60° N.
  const double r = 6371 - 50, half = 0.5 * r;
  const Globe sphere{Globe::Shape::kSphere, 6371, 50, 0};
  EXPECT_EQ(placeText({half * std::sqrt(0.75), -half * 0.5, r * std::sqrt(0.75)}, sphere),
            "30.000°W, 60.000°N, depth 1000 m");
  const double degree = 6371 * std::numbers::pi / 180;
  const Globe flat{Globe::Shape::kFlat, 6371, 2, 190};
  EXPECT_EQ(placeText({181.5 * degree, -12.25 * degree, 0.5}, flat), "178.500°W, 12.250°S, height 250 m");
}

TEST(RenderCommand, LeavesDefaultsOut) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.annotations = {};
  state.camera = {{3, 1.0 / 3, 2}, {1, 0.5, 0.5}, {0, 0, 1}, Projection::kOrthographic, 0.7, 30};
  EXPECT_EQ(commandText(state, "a b.splats"),
            "curvisplat render 'a b.splats' -o picture.png --size 300x200 --scalar density --tf glow "
            "--range 0.5,3 --opacity-unit 0.0244949 --position 3,0.333333,2 --focal-point 1,0.5,0.5 "
            "--parallel-scale 0.7");
}

/// Isosurfaces of the opacities' scalar come first, and the command names the others' scalars.
TEST(ViewState, DrawsIsosurfacesOfAllScalars) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  chooseVariable(state, manifest(), "u v");
  state.isosurfaces = {
      {"density", 1}, {"u v", 0.25}, {"u v", 0.5, false}, {"density", 2, true, glm::vec3(1, 0, 0)}};
  using Values = std::vector<double>;
  const auto expectDrawn = [&](const Values& own, const std::string& scalar, const Values& further) {
    const auto scene = state.frameOptions({3, 2}, manifest()).scene;
    EXPECT_EQ(scene->isovalues, own);
    ASSERT_EQ(scene->further_isosurfaces.size(), 1u);
    EXPECT_EQ(manifest().variables[scene->further_isosurfaces[0].variable].name, scalar);
    EXPECT_EQ(scene->further_isosurfaces[0].values, further);
  };
  expectDrawn({0.25}, "density", {1, 2});
  expectParts(commandText(state, "a.splats"),
              {"--iso 0.25", "--iso density=1,2", "--iso-colour 'function,function,#ff0000'"});
  state.opacity_by = OpacityScalar{"density", EditedFunction("inferno", 0.5, 2, 0.1)};
  expectDrawn({1, 2}, "u v", {0.25});
  expectParts(commandText(state, "a.splats"), {"--opacity-by density", "--iso 1,2", "--iso 'u v=0.25'",
                                               "--iso-colour 'function,#ff0000,function'"});
  state.opacity_by.reset();
  state.isosurfaces = {{"density", 1}};
  state.volume = false;
  expectDrawn({}, "density", {1});
  expectParts(commandText(state, "a.splats"), {"--iso density=1", "--volume off"});
}

/// Faces are tinted where they stand in the list, also where a scalar gives all of them their colours; the view stays.
TEST(ViewState, TintsFacesInACopy) {
  const ViewState state = changedState();
  const std::string before = toJson(state);
  ViewState shown = state.withTinted("walls");
  EXPECT_EQ(toJson(state), before);
  ASSERT_EQ(shown.faces.size(), 2u);
  EXPECT_TRUE(shown.faces[1].visible && shown.faces[1].tinted);
  EXPECT_FALSE(shown.faces[1].opacity.by_function);
  const auto scene = shown.frameOptions({3, 2}, manifest()).scene;
  ASSERT_EQ(scene->grid_surfaces.size(), 2u);
  EXPECT_FALSE(scene->grid_surfaces[0].own_colour);
  EXPECT_TRUE(scene->grid_surfaces[1].own_colour);
  shown = state.withTinted("kmin");
  ASSERT_EQ(shown.faces.size(), 3u);
  EXPECT_EQ(shown.faces[2].name, "kmin");
  EXPECT_EQ(shown.faceNames().faces.size(), 2u);  // with the first, and without the hidden one
}

TEST(ViewState, AnIsosurfaceHasAColourOfItsOwn) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.isosurfaces = {{"density", 1}, {"density", 2, false, glm::vec3(1, 0, 0)}};
  EXPECT_EQ(commandText(state).find("--iso-colour"), std::string::npos);
  state.isosurfaces.push_back({"density", 2.5, true, glm::vec3(0, 0.5f, 1)});
  expectParts(commandText(state), {"--iso 1,2.5", "--iso-colour 'function,#0080ff'"});
  const auto scene = state.frameOptions({3, 2}, manifest()).scene;
  EXPECT_EQ(scene->iso_colours.at(0), std::nullopt);
  EXPECT_EQ(scene->iso_colours.at(1), glm::vec3(0, 0.5f, 1));
}

/// Lines of the drawn scalar are drawn as by the command that is copied: in the picture's colours, without a bar of their own.
TEST(ViewState, LinesOfTheScalarThatIsDrawnHaveItsFunction) {
  GivenSheets given;
  Curves& curves = given.curves.emplace_back();
  curves.function = std::make_shared<TransferFunction>(TransferFunction::preset("plasma", 0, 1, 1));
  curves.colours = std::make_shared<ColourTable>(*curves.function);
  curves.title = "density";
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.given = std::make_shared<GivenSheets>(given);
  for (const auto& [variable, bars] : {std::pair("density", 1), {"u v", 2}}) {
    chooseVariable(state, manifest(), variable);
    const bool has_own = bars == 2;
    const Curves drawn = state.frameOptions({30, 20}, manifest()).scene->curves.at(0);
    EXPECT_EQ(drawn.colours != nullptr, has_own);
    EXPECT_EQ(drawn.function != nullptr, has_own);
    const ShownFunctions functions(state, manifest());
    ASSERT_EQ(functions.bars().size(), static_cast<size_t>(bars));
    EXPECT_EQ(functions.bars().back().title, has_own ? "density" : scalarTitle("density", "kg/m3"));
  }
}

TEST(ViewState, AScalarBarIsOfColoursThatSomethingHas) {
  ViewState state = firstViewOf(manifest(), {300, 200});  // of density
  const auto titles = [&] {
    const ShownFunctions functions(state, manifest());
    std::vector<std::string> all;
    for (const ShownFunction& shown : functions.bars()) all.push_back(shown.title);
    return all;
  };
  using Titles = std::vector<std::string>;
  const std::string density = scalarTitle("density", "kg/m3");
  state.faces = {{"kmin"}};
  EXPECT_EQ(titles(), Titles{density});
  state.volume = false;
  EXPECT_EQ(titles(), Titles{});
  state.faces_by = FacesScalar{"density", state.function};
  EXPECT_EQ(titles(), Titles{density});
  state.faces_by->variable = "u v";
  ASSERT_EQ(titles().size(), 1u);
  EXPECT_TRUE(titles()[0].starts_with("u v"));
  state.faces_by.reset();
  for (const char* scalar : {"density", "u v"}) {
    state.isosurfaces = {{scalar, 0.5}};
    EXPECT_EQ(titles(), Titles{density}) << scalar;
    state.isosurfaces[0].colour = glm::vec3(1, 0, 0);
    EXPECT_EQ(titles(), Titles{}) << scalar;
  }
  state.slices = {{{{0, 0, 0}, {0, 0, 1}}}};
  EXPECT_EQ(titles(), Titles{density});
  // The picture stays in its place when the volume comes or goes.
  const int width = dataSizeOf(state, manifest(), {300, 200}).width;
  state.volume = true;
  EXPECT_EQ(dataSizeOf(state, manifest(), {300, 200}).width, width);
}

TEST(ViewState, OfAnEarlierVersionHasIsosurfacesOfItsOpacities) {
  auto json = nlohmann::json::parse(toJson(changedState()));
  json.erase("isosurfaces");
  json["isovalues"] = {0.75, "high"};
  expectError([&] { viewStateFromJson(json.dump(), "a.json", manifest()); }, {"a.json", "isovalues[1]"});
  json["isovalues"] = {0.75, 1};
  const ViewState state = viewStateFromJson(json.dump(), "a.json", manifest());
  ASSERT_EQ(state.isosurfaces.size(), 2u);
  EXPECT_EQ(state.isosurfaces[1].scalar, "density");
  EXPECT_EQ(state.isosurfaces[1].value, 1);
}

/// Programs that drew the isosurfaces of one scalar listed the others as visible, too.
TEST(ViewState, OfAnEarlierVersionShowsTheIsosurfacesItDrew) {
  ViewState state = firstViewOf(manifest(), {300, 200});  // of density
  state.isosurfaces = {{"density", 0.75}, {"u v", 0.5}, {"density", 1, false}};
  const auto shown = [](const nlohmann::json& json) {
    std::vector<bool> visible;
    for (const Isosurface& one : viewStateFromJson(json.dump(), "a.json", manifest()).isosurfaces)
      visible.push_back(one.visible);
    return visible;
  };
  auto json = nlohmann::json::parse(toJson(state));
  EXPECT_EQ(shown(json), (std::vector<bool>{true, true, false}));
  json.erase("isosurfaces_of_all_scalars");
  json["isovalues"] = {0.75};
  EXPECT_EQ(shown(json), (std::vector<bool>{true, false, false}));
  json["isovalues"] = {0.5};  // without the volume, and density's own hidden, it drew the other scalar's
  json["isosurfaces"][0]["visible"] = false;
  EXPECT_EQ(shown(json), (std::vector<bool>{false, true, false}));
}

/// The shell that the command is pasted into finds this program.
TEST(RenderCommand, BeginsWithTheProgramThatIsRunning) {
  const TemporaryFolder folder;
  const std::string path = std::getenv("PATH"), own = shellWord(os::programFile().string());
  const auto wordWith = [&](const std::string& first) {
    setenv("PATH", ((folder / first).string() + ":" + path).c_str(), 1);
    const std::string word = programWord();
    setenv("PATH", path.c_str(), 1);
    return word;
  };
  for (const char* name : {"none", "same", "other"}) std::filesystem::create_directory(folder / name);
  std::filesystem::create_symlink(os::programFile(), folder / "same" / "curvisplat");
  std::ofstream(folder / "other" / "curvisplat") << "another program";
  EXPECT_EQ(wordWith("none"), own);
  EXPECT_EQ(wordWith("same"), "curvisplat");
  EXPECT_EQ(wordWith("other"), own);
}

TEST(RenderCommand, HasEveryOption) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  chooseVariable(state, manifest(), "u v");
  state.camera.position = {0.1, -3, 2.0 / 3};
  state.function.addPoint(0.3, 0.7);
  state.lod_pixels = 2.5;
  state.scale = {1, 1, 50};
  state.clip_box = WorldBox{{0, -0.5, 0.25}, {1, 1, 1}};
  state.clip_planes = {{ClipPlane{{0, 0.5, 0}, {1, 0, -2}}}, {ClipPlane{{0.25, 0, 0}, {0, 1, 0}}}};
  state.surfaces = {{"/a/wing.stl", {1, 0.5f, 0}, nullptr, 0.25}};
  state.faces = {{"block 3:k=min", {0, 1, 0.5f}, {0.5, true}}};
  state.faces_by = FacesScalar{"density", EditedFunction("magma", 0.5, 2, 0.1)};
  state.isosurfaces = {{"u v", 0.25}, {"u v", -0.5}};
  state.iso_opacity = {0.75, false};
  state.slices = {{ClipPlane{{0, 0.25, 0}, {0, -1, 2}}}};
  state.slice_opacity = {0.5, true};
  state.volume = false;
  state.lit = true;
  state.shadow = 0.5;
  state.ambient_occlusion = 0.25;
  state.light_strength = 0.5;
  state.light_direction = {1, -0.5, 2};
  state.dark = false;
  state.gradient_opacity = {{0, 0.25}, {0.5, 1}, {1, 0}};
  state.annotations = {.scalar_bar = true, .outline = true};
  state.markers = {{"nose", {0.5, 0.25, 0.125}, "density", "kg/m3", 1.5}, {"2", {-1, 0, 0}, "u v", "", 0.25}};
  state.classification = Classification::kFlat;
  expectParts(commandText(state, "it's\x1b[2J \\\u009b.splats"), {R"($'it\'s\033[2J \\\302\233.splats')"});
  expectParts(commandText(state, "it's.splats"), {"'it'\\''s.splats'",
                                                  "--scalar 'u v'",
                                                  "--tf glow",
                                                  "--range=-1,1",
                                                  "--opacity 0:",
                                                  "0.3:0.7",
                                                  "--scale 1,1,50",
                                                  "--clip-box 0,1,-0.5,1,0.25,1",
                                                  "--clip-plane 0,0.5,0,1,0,-2",
                                                  "--clip-plane 0.25,0,0,0,1,0",
                                                  "--shade --light 0.5,0.5,0.25 --light-direction 1,-0.5,2",
                                                  "--shadow 0.5 --ambient-occlusion 0.25",
                                                  "--gradient-opacity 0:0.25,0.5:1,1:0",
                                                  "--background white",
                                                  "--classify flat",
                                                  "--lod-pixels 2.5",
                                                  "--scalar-bar --outline",
                                                  "--marker '0.5,0.25,0.125:nose: density 1.5 kg/m3'",
                                                  "--marker='-1,0,0:2: 0.25'",
                                                  "--position 0.1,-3,0.66667",
                                                  "--surface /a/wing.stl",
                                                  "--surface-colour '#ff8000'",
                                                  "--slice 0,0.25,0,0,-1,2",
                                                  "--surface-opacity 0.25",
                                                  "--surface 'block 3:k=min'",
                                                  "--surface-colour '#00ff80'",
                                                  "--surface-opacity 'function*0.5'",
                                                  "--surface-by density",
                                                  "--iso 0.25,-0.5",
                                                  "--iso-opacity 0.75",
                                                  "--slice-opacity 'function*0.5'",
                                                  "--volume off"});
}

/// A colour has an effect on files, and on faces that show no scalar. The option is given once, or once for each surface.
TEST(RenderCommand, HasColoursOfSurfacesThatShowNoScalar) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.faces = {{"walls", {0, 1, 0.5f}, {}}};
  EXPECT_NE(commandText(state).find("--surface-colour"), std::string::npos);
  state.faces_by = FacesScalar{"density", EditedFunction("magma", 0.5, 2, 0.1)};
  state.surfaces = {{"/a/wing.stl", {1, 0.5f, 0}, nullptr, 0.25, false}};
  EXPECT_EQ(commandText(state).find("--surface-colour"), std::string::npos) << commandText(state);
  state.surfaces[0].visible = true;
  EXPECT_NE(commandText(state).find("--surface-colour '#ff8000' --surface-colour '#00ff80'"),
            std::string::npos);
  state.surfaces.clear();
  state.faces.push_back({"blanks", {1, 0.5f, 0}, {}});  // which have no values
  EXPECT_NE(commandText(state).find("--surface-colour '#00ff80' --surface-colour '#ff8000'"),
            std::string::npos)
      << commandText(state);
}

TEST(RenderCommand, HasMoreMemoryWhereTheViewHas) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.memory_bytes = 100 << 20;
  EXPECT_EQ(commandText(state).find("--memory"), std::string::npos);
  state.memory_bytes = (700 << 20) + 1;
  expectParts(commandText(state), {"--memory 701M"});
}

TEST(RenderCommand, OfTwoScalarsHasBothFunctions) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.opacity_by = OpacityScalar{"u v", EditedFunction("grey", -1, 0.5, 0.25)};
  state.opacity_by->function.addPoint(0.5, 0.25);
  expectParts(commandText(state), {"--tf glow", "--range 0.5,3", "--opacity-by 'u v'",
                                   "--opacity-range=-1,0.5", "0.5:0.25", "--opacity-unit 0.25"});
}

TEST(RenderCommand, OfAnAutomaticFunctionHasItsScale) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.function = EditedFunction::automatic(
      {"inferno", {0.5, 3}, AsinhScale{1, 0.25}, {{0, 0.5}, {0.25, 0}, {1, 0.75}}, 0.5});
  EXPECT_FALSE(needsFile(state.function));
  expectParts(commandText(state), {"--tf inferno", "--asinh 1,0.25", "--opacity 0:0.5,0.25:0,1:0.75"});
}

TEST(RenderCommand, OnlySettingsWithoutAnOptionNeedAFile) {
  EditedFunction function("viridis", 1, 2, 1);
  function.addPoint(0.5, 0.5);
  EXPECT_FALSE(needsFile(function));
  function.thinColours();
  EXPECT_TRUE(needsFile(function));
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.function = function;
  expectParts(commandText(state), {"--tf f.json"});
  EXPECT_EQ(commandText(state).find("--range"), std::string::npos);
  EditedFunction logarithmic("viridis", 1, 2, 1);
  ASSERT_TRUE(logarithmic.setLogScale(true));
  EXPECT_TRUE(needsFile(logarithmic));
}

TEST(RenderCommand, OfAMovieTurns) {
  const ViewState state = firstViewOf(manifest(), {300, 200});
  CommandOptions turn{"a.splats", {300, 200}, {}, {}, kTurnFrames};
  expectParts(renderCommand(state, turn), {"-o movie.mp4", "--orbit 360"});
  EXPECT_EQ(renderCommand(state, turn).find("--frame"), std::string::npos);
  turn.turn_frames = 12;
  turn.frames_per_s = 10;
  expectParts(renderCommand(state, turn), {"--orbit 360 --frames 12 --frame-rate 10"});
  // Without an even size render refuses to write an .mp4.
  turn.size = {301, 201};
  expectParts(renderCommand(state, turn), {"--size 300x200"});
  expectParts(renderCommand(state, {"a.splats", {301, 201}, {}, {}}), {"--size 301x201"});
  CommandOptions fine{"a.xyz", {300, 200}, {}, {}};
  fine.precision = ValuePrecision::kFine;
  expectParts(renderCommand(state, fine), {"--value-precision fine"});
}

TEST(RenderCommand, PathsInTheFolderAreShort) {
  EXPECT_EQ(shortPath(std::filesystem::current_path() / "sub" / "a.splats"), "sub/a.splats");
  EXPECT_TRUE(shortPath("/nowhere/a.splats").is_absolute());
}

}  // namespace
}  // namespace curvisplat
