#include "tools/viewer/render_command.h"

#include <gtest/gtest.h>

namespace curvisplat {
namespace {

Manifest manifest() {
  Manifest made;
  made.lower = {0, 0, 0};
  made.upper = {2, 1, 1};
  made.variables = {{0, "density", "kg/m3", 0.5, 3}, {1, "u v", "", -1, 1}};
  return made;
}

std::string commandText(const ViewState& state, const std::string& cache = "a.splats") {
  return renderCommand(state, {cache, {300, 200}, "f.json", "o.json"});
}

void expectParts(const std::string& command, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(command.find(part), std::string::npos) << command << " lacks " << part;
}

TEST(RenderCommand, LeavesDefaultsOut) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.annotations = {};
  state.camera = {{3, 1.0 / 3, 2}, {1, 0.5, 0.5}, {0, 0, 1}, Projection::kOrthographic, 0.7, 30};
  EXPECT_EQ(commandText(state, "a b.splats"),
            "curvisplat render 'a b.splats' -o picture.png --size 300x200 --scalar density --tf viridis "
            "--range 0.5,3 --opacity-unit 0.0244949 --position 3,0.333333,2 --focal-point 1,0.5,0.5 "
            "--parallel-scale 0.7");
}

TEST(RenderCommand, HasEveryOption) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  chooseVariable(state, manifest(), "u v");
  state.camera.position = {0.1, -3, 2.0 / 3};
  state.function.addPoint(0.3, 0.7);
  state.lod_pixels = 2.5;
  state.scale = {1, 1, 50};
  state.clip_box = WorldBox{{0, -0.5, 0.25}, {1, 1, 1}};
  state.clip_planes = {{{0, 0.5, 0}, {1, 0, -2}}, {{0.25, 0, 0}, {0, 1, 0}}};
  state.surfaces = {{"/a/wing.stl", {1, 0.5f, 0}, nullptr, 0.25}};
  state.faces = {{"block 3:k=min", {0, 1, 0.5f}, {0.5, true}}};
  state.faces_by = FacesScalar{"density", EditedFunction("magma", 0.5, 2, 0.1)};
  state.isovalues = {0.25, -0.5};
  state.iso_opacity = {0.75, false};
  state.slices = {{{0, 0.25, 0}, {0, -1, 2}}};
  state.slice_opacity = {0.5, true};
  state.volume = false;
  state.lit = state.dark = true;
  state.annotations.axes = false;
  state.classification = Classification::kFlat;
  expectParts(commandText(state, "it's\x1b[2J \\\u009b.splats"), {R"($'it\'s\033[2J \\\302\233.splats')"});
  expectParts(commandText(state, "it's.splats"), {"'it'\\''s.splats'",
                                                  "--scalar 'u v'",
                                                  "--tf viridis",
                                                  "--range=-1,1",
                                                  "--opacity 0:",
                                                  "0.3:0.7",
                                                  "--scale 1,1,50",
                                                  "--clip-box 0,1,-0.5,1,0.25,1",
                                                  "--clip-plane 0,0.5,0,1,0,-2",
                                                  "--clip-plane 0.25,0,0,0,1,0",
                                                  "--shade",
                                                  "--background black",
                                                  "--classify flat",
                                                  "--lod-pixels 2.5",
                                                  "--scalar-bar --outline",
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

TEST(RenderCommand, OfTwoScalarsHasBothFunctions) {
  ViewState state = firstViewOf(manifest(), {300, 200});
  state.opacity_by = OpacityScalar{"u v", EditedFunction("grey", -1, 0.5, 0.25)};
  state.opacity_by->function.addPoint(0.5, 0.25);
  expectParts(commandText(state), {"--tf viridis", "--range 0.5,3", "--opacity-by 'u v'",
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
  expectParts(renderCommand(state, {"a.splats", {300, 200}, {}, {}, true}), {"-o movie.mp4", "--orbit 360"});
  // Without an even size render refuses to write an .mp4.
  expectParts(renderCommand(state, {"a.splats", {301, 201}, {}, {}, true}), {"--size 300x200"});
  expectParts(renderCommand(state, {"a.splats", {301, 201}, {}, {}}), {"--size 301x201"});
  CommandOptions fine{"a.xyz", {300, 200}, {}, {}};
  fine.fine_values = true;
  expectParts(renderCommand(state, fine), {"--value-precision fine"});
}

TEST(RenderCommand, PathsInTheFolderAreShort) {
  EXPECT_EQ(shortPath(std::filesystem::current_path() / "sub" / "a.splats"), "sub/a.splats");
  EXPECT_TRUE(shortPath("/nowhere/a.splats").is_absolute());
}

}  // namespace
}  // namespace curvisplat
