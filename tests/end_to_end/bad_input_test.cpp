// Bad input to the real program: exit status 1 (2 for wrong usage), exactly one line on stderr that names
// the file, what was expected and what was found, and nothing left behind that opens as if whole. What
// people mistype: the line names the word and what was probably meant.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class BadInput : public ProgramSuite<BadInput> {
 protected:
  static void prepare() {
    writeScene("scene", {12, 10, 8});
    writeScene("other", {12, 10, 9});
    writeFileAtomically(*folder_ / "text.xyz", std::string("Dear reader,\nthis is a letter and no grid.\n"));
    writeFileAtomically(*folder_ / "empty.xyz", std::string());
    run({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("whole.splats")});
  }

  static void writeScene(const std::string& name, SceneGridSize size) {
    Progress progress;
    writePlot3d(SceneGridSource(makeScene("half-annulus"), size), *folder_ / name, progress);
  }

  /// The first `bytes` bytes of a file of the folder.
  static std::string truncated(const std::string& name, size_t bytes) {
    const std::string path = file(fmt::format("first_{}_bytes_of_{}", bytes, name));
    writeFileAtomically(path, readTextFile(file(name)).substr(0, bytes));
    return path;
  }

  /// Converts into a folder of its own, expects to be refused, and that nothing is left there.
  static void expectNotConverted(const Words& inputs, const Words& says, int status = 1) {
    const TemporaryFolder output;
    expectRefused(Words{"convert"} + inputs + Words{"-o", (output / "out.splats").string()}, status, says);
    for (const auto& left : std::filesystem::directory_iterator(output.path()))
      ADD_FAILURE() << "left behind: " << left.path();
  }

  static void expectNotRendered(const std::string& cache, const Words& more, const Words& says,
                                int status = 1) {
    const TemporaryFolder output;
    expectRefused(Words{"render", cache, "-o", (output / "out.png").string(), "--size", "16x16"} + more,
                  status, says);
    EXPECT_TRUE(std::filesystem::is_empty(output.path()));
  }
};

TEST_F(BadInput, MissingGrid) {
  expectNotConverted({file("missing.xyz"), file("scene.fun")}, {"missing.xyz"});
}

TEST_F(BadInput, MissingSolution) {
  expectNotConverted({file("scene.xyz"), file("missing.fun")}, {"missing.fun"});
}

TEST_F(BadInput, FolderInsteadOfAFile) {
  expectNotConverted({folder_->path().string(), file("scene.fun")}, {folder_->path().filename().string()});
}

TEST_F(BadInput, EmptyGrid) {
  expectNotConverted({file("empty.xyz"), file("scene.fun")}, {"empty.xyz"});
}

TEST_F(BadInput, TruncatedGrid) {
  const size_t size = std::filesystem::file_size(file("scene.xyz"));
  for (const size_t bytes : {size_t{2}, size_t{12}, size_t{100}, size / 2, size - 4, size - 1}) {
    const std::string path = truncated("scene.xyz", bytes);
    expectNotConverted({path, file("scene.fun")}, {path});
  }
}

TEST_F(BadInput, TruncatedSolution) {
  const size_t size = std::filesystem::file_size(file("scene.fun"));
  for (const size_t bytes : {size_t{0}, size_t{3}, size_t{16}, size / 2, size - 1}) {
    const std::string path = truncated("scene.fun", bytes);
    expectNotConverted({file("scene.xyz"), path}, {path});
  }
}

TEST_F(BadInput, SolutionOfOtherDimensions) {
  expectNotConverted({file("scene.xyz"), file("other.fun")}, {"other.fun", "12", "10", "8", "9"});
}

TEST_F(BadInput, TextInsteadOfAGrid) {
  expectNotConverted({file("text.xyz"), file("scene.fun")}, {"text.xyz"});
}

TEST_F(BadInput, PictureInsteadOfASolution) {
  expectNotConverted({file("scene.xyz"), file("text.xyz")}, {"text.xyz"});
}

TEST_F(BadInput, UnknownScalar) {
  expectNotConverted({file("scene.xyz"), file("scene.fun"), "--scalar", "swirl"}, {"swirl", "f"});
}

TEST_F(BadInput, UnwritableCache) {
  expectRefused({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("nowhere/out.splats")}, 1,
                {"nowhere"});
}

TEST_F(BadInput, ExistingCacheIsNotOverwritten) {
  const std::string before = readTextFile(file("whole.splats/manifest.json"));
  const ProgramResult result =
      runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("whole.splats")});
  expectRefused(result, result.status, {"whole.splats", "--overwrite"});
  EXPECT_NE(result.status, 0);
  EXPECT_EQ(readTextFile(file("whole.splats/manifest.json")), before);
}

TEST_F(BadInput, OrdinaryFileIsNotOverwritten) {
  writeFileAtomically(file("letter"), std::string("precious"));
  const ProgramResult result =
      runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("letter"), "--overwrite"});
  expectRefused(result, result.status, {"letter"});
  EXPECT_NE(result.status, 0);
  EXPECT_EQ(readTextFile(file("letter")), "precious");
}

TEST_F(BadInput, MissingCache) {
  expectNotRendered(file("missing.splats"), {}, {"missing.splats"});
}

TEST_F(BadInput, GridInsteadOfACache) {
  expectNotRendered(file("scene.xyz"), {}, {"scene.xyz"});
}

// The manifest is what is written last.
TEST_F(BadInput, UnfinishedCache) {
  std::filesystem::copy(file("whole.splats"), file("unfinished.splats"));
  std::filesystem::remove(file("unfinished.splats/manifest.json"));
  expectNotRendered(file("unfinished.splats"), {}, {"unfinished.splats", "unfinished"});
}

TEST_F(BadInput, CacheWithATruncatedFile) {
  for (const char* name : {"manifest.json", "bricks.bin", "geometry.bin", "var.0.bin"}) {
    const std::string cache = file(fmt::format("cut_{}.splats", name));
    std::filesystem::copy(file("whole.splats"), cache);
    ASSERT_TRUE(std::filesystem::exists(cache + "/" + name)) << name;
    std::filesystem::resize_file(cache + "/" + name, std::filesystem::file_size(cache + "/" + name) / 2);
    expectNotRendered(cache, {}, {name});
  }
}

TEST_F(BadInput, UnknownScalarInACache) {
  expectNotRendered(file("whole.splats"), {"--scalar", "swirl"}, {"swirl", "f"});
}

TEST_F(BadInput, MissingTransferFunction) {
  expectNotRendered(file("whole.splats"), {"--tf", file("missing.json")}, {"missing.json"});
}

TEST_F(BadInput, BrokenTransferFunction) {
  writeFileAtomically(file("broken.json"), std::string("[{\"RGBPoints\": [0, 1"));
  expectNotRendered(file("whole.splats"), {"--tf", file("broken.json")},
                    {"broken.json", "a syntax error at line 1, column 21"});
}

TEST_F(BadInput, PictureNameWithAnotherEnding) {
  expectRefused({"render", file("whole.splats"), "-o", file("out.jpg")}, 2,
                {"out.jpg", ".png", ".exr", ".pfm"});
  EXPECT_FALSE(std::filesystem::exists(file("out.jpg")));
}

TEST_F(BadInput, UnwritablePicture) {
  expectRefused({"render", file("whole.splats"), "-o", file("nowhere/out.png"), "--size", "16x16"}, 1,
                {"nowhere"});
}

TEST_F(BadInput, WrongUsage) {
  expectRefused(runProgram({}), 2, {"subcommand", "see curvisplat --help"});
  expectRefused({"frobnicate"}, 2, {"frobnicate"});
  expectRefused({"convert"}, 2, {"see curvisplat convert --help"});
  expectRefused({"render"}, 2, {"CACHE is required", "see curvisplat render --help"});
  expectRefused({"compare", file("scene.xyz")}, 2, {"see curvisplat compare --help"});
  expectRefused({"render", file("whole.splats"), "-o", file("a.png"), "--sise", "4x4"}, 2, {"--sise"});
}

TEST_F(BadInput, InvalidOptionValues) {
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& text) {
    expectRefused(arguments, 2, {text});
  };
  // The unknown option comes first, whatever else is missing.
  refused({"render", "--sise"}, "unknown option --sise (did you mean --size?)");
  refused({"convert", file("scene.xyz"), "--time-step", "99999999999"},
          "--time-step '99999999999': is not a whole number from 0 on, or is too large");
  refused({"convert", file("scene.xyz"), "--blank", "none"},
          "--blank 'none': is not a number, or is too large");
  refused({"convert", file("scene.xyz"), "--threads", "1025"},
          "--threads '1025': expected a number from 0 to 1024");
  refused({"convert", file("scene.xyz"), "--threads", ""}, "found an empty word behind --threads, as of");
  refused({"convert", file("scene.xyz"), "--scalar", "", "-o", file("a.splats")},
          "found an empty word behind --scalar, as of");
  refused({"render", "", "-o", file("a.png")}, "found an empty word, as of");
  refused({"render", file("whole.splats"), "--tf", "viridis", "--tf", "magma"},
          "--tf takes one value, found 2");
  refused({"convert", file("scene.xyz"), "-o"}, "--output needs a value");
  expectRefused(
      {"convert", file("scene.xyz"), file("scene.fun"), "-o", file("little.splats"), "--memory", "1K"}, 1,
      {"--memory 1 KiB: conversion of 1 scalar takes at least 160 MiB"});
  expectRefused({"render", file("whole.splats"), "-o", file("a.png"), "--memory", "1K"}, 2,
                {"--memory 1 KiB: too little"});
}

TEST_F(BadInput, MessagesSayWhatToDo) {
  const std::string cache = file("whole.splats"), picture = file("a.png"), grid = file("scene.xyz");
  for (const char* name : {"hello.vts", "hello.nc", "hello.case"})
    writeFileAtomically(file(name), std::string("hello\n"));
  std::filesystem::create_directory(file("case"));
  writeFileAtomically(file("case/a.foam"), std::string());
  const std::pair<Words, const char*> wrong_usage[] = {
      {{"serve", cache, "--port", "99999"}, "--port '99999': expected a number from 0 to 65535"},
      {{"serve", cache, "--viewer-memory", "1M"},
       "--viewer-memory 1M: no picture fits into this; give 32M or more"},
      {{"info", cache, "--source"}, "--source: is read at points; add --probe X,Y,Z or --probe-line"},
      {{"info", cache, "--probe", "no.csv"},
       "--probe no.csv: there is no such file; expected a point x,y,z, or a file"},
      {{"render", cache, "-o", picture, "--position", "1,0,0", "--focal-point", "1,0,0"},
       "position and its focal point are one place, 1,0,0; move one of them"},
      {{"convert", grid, "--steps", "5", "-o", file("b.splats")},
       "step 5 is out of range; there is one, step 0"}};
  for (const auto& [words, text] : wrong_usage) expectRefused(words, 2, {text});
  const std::pair<Words, const char*> wrong_files[] = {
      {{"render", file("no.vtk"), "-o", picture},
       "convert the grid first: curvisplat convert GRID -o NAME.splats"},
      {{"render", file("case"), "-o", picture}, "contains no manifest.json; expected a splat cache (convert"},
      {{"render", cache, "-o", cache + "/a.png"}, "which is read; choose another folder"},
      {{"convert", file("hello.vts"), "-o", file("b.splats")},
       "hello.vts: does not begin as a VTK XML file does"},
      {{"convert", file("hello.nc"), "-o", file("b.splats")},
       "hello.nc: does not begin as a NetCDF file does"},
      {{"convert", file("hello.case"), "-o", file("b.splats")},
       "hello.case: does not begin as an EnSight case does"},
      {{"convert", file("case/a.foam"), "-o", file("b.splats")},
       "its folder has none (expected constant/polyMesh there)"},
      {{"convert", grid, file("scene.fun"), "-o", file("b.splats"), "--tmp", file("none")},
       "none: does not exist; name another folder with --tmp"}};
  for (const auto& [words, text] : wrong_files) expectRefused(words, 1, {text});
}

TEST_F(BadInput, MisspeltSubcommandGetsTheListOfThem) {
  expectRefused({"rendr", file("whole.splats")}, 2, {"rendr", "did you mean render?", "convert", "info"});
  expectRefused({"render", file("whole.splats"), "-o", file("a.png"), "--sise", "9x9"}, 2,
                {"unknown option --sise (did you mean --size?); see"});
  expectRefused({"render", file("whole.splats"), "-o", file("a.png"), "--zzzzzz=3"}, 2,
                {"unknown option --zzzzzz; see curvisplat render --help"});
}

TEST_F(BadInput, UnknownScene) {
  expectRefused({"generate", "pipe", "--size", "4x4x4", "-o", file("pipe")}, 2,
                {"pipe", "half-annulus", "wake"});
}

TEST_F(BadInput, InvalidSizeOfAScene) {
  for (const char* size :
       {"4", "4x4", "4x4x4x4", "4x4x1", "ax4x4", "-4x4x4", "4x4x4 ", "99999999999999999999x4x4"})
    expectRefused({"generate", "wake", "--size", size, "-o", file("sized")}, 2, {"NIxNJxNK"});
}

TEST_F(BadInput, ComparingAFileThatIsNotAPicture) {
  expectRefused({"compare", file("text.xyz"), file("text.xyz")}, 1, {"text.xyz", "PNG"});
}

TEST_F(BadInput, InfoWithoutAnArgument) {
  expectRefused({"info", file("missing.splats")}, 1, {"missing.splats"});
  expectRefused({"info", file("text.xyz")}, 1, {"text.xyz"});
}

class Suggestions : public ProgramSuite<Suggestions> {
 protected:
  static void prepare() {
    run({"generate", "half-annulus", "--size", "16x10x8", "-o", file("a")});
    run({"convert", file("a.xyz"), file("a.fun"), "-o", file("flow.splats"), "--scalar", "f,volume"});
  }
  static void expectMeant(const Words& words, const std::string& meant) {
    const ProgramResult result = runProgram(words);
    EXPECT_NE(result.status, 0) << testing::PrintToString(words);
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find(meant), std::string::npos)
        << testing::PrintToString(words) << ": " << result.err;
  }
  /// `render` of the cache with these options.
  static void expectMeantByRender(const Words& options, const std::string& meant) {
    expectMeant(Words{"render", file("flow.splats"), "-o", file("a.png")} + options, meant);
  }
};

TEST_F(Suggestions, Subcommands) {
  for (const auto& [wrong, right] :
       std::vector<std::pair<std::string, std::string>>{{"rendr", "render"},
                                                        {"veiw", "view"},
                                                        {"convret", "convert"},
                                                        {"inof", "info"},
                                                        {"colourmaps", "colormaps"}})
    expectMeant({wrong}, fmt::format("unknown subcommand '{}' (did you mean {}?)", wrong, right));
  expectMeant({"--versoin"}, "unknown option --versoin (did you mean --version?)");
}

TEST_F(Suggestions, Options) {
  for (const auto& [wrong, right] :
       std::vector<std::pair<std::string, std::string>>{{"--sise", "--size"},
                                                        {"--opcity", "--opacity"},
                                                        {"--colormap", "--tf"},
                                                        {"--cmap", "--tf"},
                                                        {"--time-step", "--step"},
                                                        {"--fps", "--frame-rate"},
                                                        {"--contour", "--iso"}})
    expectMeantByRender({wrong, "1"}, fmt::format("unknown option {} (did you mean {}?)", wrong, right));
}

TEST_F(Suggestions, OptionsWithoutTheirValues) {
  expectMeantByRender({"--orbit", "--size", "9x9"}, "--orbit: needs a value (found the option --size)");
  expectMeantByRender({"--scalar", "--size", "9x9"}, "--scalar: needs a value (found the option --size)");
  expectMeantByRender({"--asinh=", "--size=9x9"}, "--asinh: needs a value (found nothing behind '=')");
}

TEST_F(Suggestions, Values) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"--scalar", "volum"}, "(did you mean volume?); it has f, volume"},
      {{"--scalar", "vol"}, "did you mean volume?"},
      {{"--scalar", "f,volume"}, "a picture shows one scalar"},
      {{"--scalar", "all"}, "a picture shows one scalar"},
      {{"--opacity-by", "volme"}, "did you mean volume?"},
      {{"--surface-by", "volme", "--surface", "kmin"}, "did you mean volume?"},
      {{"--tf", "virdis"}, "did you mean viridis?"},
      {{"--tf", "cool warm"}, "did you mean cool-warm?"},
      {{"--view", "isometric"}, "did you mean iso?"},
      {{"--view", "top"}, "did you mean +z?"},
      {{"--view", "x"}, "did you mean +x?"},
      {{"--surface", "kmn"}, "did you mean kmin?"},
      {{"--surface", "wals"}, "did you mean walls?"},
      {{"--surface", "block 0:kmin"}, "the grid has one block, block 1"},
      {{"--surface", "block 2:kmin"}, "the grid has one block, block 1"},
      {{"--backend", "osmsa"}, "did you mean osmesa?"},
      {{"--background", "wite"}, "did you mean white?"},
      {{"--classify", "flt"}, "did you mean flat?"},
      {{"--volume", "of", "--surface", "kmin"}, "did you mean off?"},
      {{"--size", "100*80"}, "did you mean 100x80?"},
      {{"--size", "100,80"}, "did you mean 100x80?"},
      {{"--size", "100"}, "expected WIDTHxHEIGHT, found 1 number"},
      {{"--step", "3"}, "--step 3: is out of range"},
      {{"--azimuth", "2e6"}, "--azimuth 2e6: expected degrees from -1e+06 to 1e+06"},
      {{"--orbit", "360"}, "use a name such as frame_%04d.png, or a movie"}};
  for (const auto& [options, meant] : cases) expectMeantByRender(options, meant);
  expectMeant({"render", file("flow.splats"), "-o", file("a.pgn")}, "did you mean .png?");
  expectMeant({"render", file("flow.splats"), "-o", file("a.exr"), "--channels", "dept"},
              "did you mean depth?");
  expectMeant({"render", file("flwo.splats"), "-o", file("a.png")},
              fmt::format("did you mean {}?", file("flow.splats")));
  expectMeant({"generate", "half-anulus", "-o", file("x")}, "did you mean half-annulus?");
  expectMeant({"generate", "wake", "-o", file("x")}, "--size NIxNJxNK is required");
  expectMeant({"info", file("flow.splats"), "--probe", "1,2"},
              "--probe 1,2: expected x,y,z, found 2 numbers");
  const auto convert = [](const Words& options, const std::string& meant) {
    expectMeant(Words{"convert", file("a.xyz"), file("a.fun"), "-o", file("b.splats")} + options, meant);
  };
  convert({"--scalar", "volum"}, "did you mean volume?");
  convert({"--byte-order", "litle"},
          "--byte-order 'litle': expected one of big, little (did you mean little?)");
  convert({"--overlap", "ownr"}, "did you mean owner?");
  convert({"--time-step", "4"}, "--time-step 4 is out of range");
}

}  // namespace
}  // namespace curvisplat
