// Bad input to the real program: exit status 1 (2 for wrong usage), exactly one line on stderr that names the
// file, what was expected and what was found, and nothing left behind that opens as if whole.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class BadInput : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    writeScene("scene", {12, 10, 8});
    writeScene("other", {12, 10, 9});
    writeFileAtomically(*shared_ / "text.xyz", std::string("Dear reader,\nthis is a letter and no grid.\n"));
    writeFileAtomically(*shared_ / "empty.xyz", std::string());
    const ProgramResult result =
        runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("whole.splats")});
    ASSERT_EQ(result.status, 0) << result.err;
  }
  static void TearDownTestSuite() { shared_.reset(); }

  static std::string file(const std::string& name) { return (*shared_ / name).string(); }

  static void writeScene(const std::string& name, SceneGridSize size) {
    Progress progress;
    writePlot3d(SceneGridSource(makeScene("half-annulus"), size), *shared_ / name, progress);
  }

  /// The first `bytes` bytes of a file of the folder.
  static std::string truncated(const std::string& name, size_t bytes) {
    const std::string path = file(fmt::format("first_{}_bytes_of_{}", bytes, name));
    writeFileAtomically(path, readTextFile(file(name)).substr(0, bytes));
    return path;
  }

  static void expectOneLine(const ProgramResult& result, int status, const std::vector<std::string>& words) {
    EXPECT_EQ(result.status, status) << result.err;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    for (const std::string& word : words)
      EXPECT_NE(result.err.find(word), std::string::npos) << "'" << word << "' is not in: " << result.err;
  }

  /// Converts into a folder of its own, expects to be refused, and that nothing is left there.
  static void expectNotConverted(std::vector<std::string> inputs, const std::vector<std::string>& words,
                                 int status = 1) {
    const TemporaryFolder output;
    std::vector<std::string> arguments{"convert", "-o", (output / "out.splats").string()};
    arguments.insert(arguments.begin() + 1, inputs.begin(), inputs.end());
    expectOneLine(runProgram(arguments), status, words);
    for (const auto& left : std::filesystem::directory_iterator(output.path()))
      ADD_FAILURE() << "left behind: " << left.path();
  }

  static void expectNotRendered(const std::string& cache, const std::vector<std::string>& more,
                                const std::vector<std::string>& words, int status = 1) {
    const TemporaryFolder output;
    std::vector<std::string> arguments{"render", cache,  "-o", (output / "out.png").string(),
                                       "--size", "16x16"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expectOneLine(runProgram(arguments), status, words);
    EXPECT_TRUE(std::filesystem::is_empty(output.path()));
  }

  static std::unique_ptr<TemporaryFolder> shared_;
};

std::unique_ptr<TemporaryFolder> BadInput::shared_;

TEST_F(BadInput, MissingGrid) {
  expectNotConverted({file("missing.xyz"), file("scene.fun")}, {"missing.xyz"});
}

TEST_F(BadInput, MissingSolution) {
  expectNotConverted({file("scene.xyz"), file("missing.fun")}, {"missing.fun"});
}

TEST_F(BadInput, FolderInsteadOfAFile) {
  expectNotConverted({shared_->path().string(), file("scene.fun")}, {shared_->path().filename().string()});
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
  const ProgramResult result =
      runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("nowhere/out.splats")});
  expectOneLine(result, 1, {"nowhere"});
}

TEST_F(BadInput, ExistingCacheIsNotOverwritten) {
  const std::string before = readTextFile(file("whole.splats/manifest.json"));
  const ProgramResult result =
      runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("whole.splats")});
  expectOneLine(result, result.status, {"whole.splats", "--overwrite"});
  EXPECT_NE(result.status, 0);
  EXPECT_EQ(readTextFile(file("whole.splats/manifest.json")), before);
}

TEST_F(BadInput, OrdinaryFileIsNotOverwritten) {
  writeFileAtomically(file("letter"), std::string("precious"));
  const ProgramResult result =
      runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("letter"), "--overwrite"});
  expectOneLine(result, result.status, {"letter"});
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
  const ProgramResult result = runProgram({"render", file("whole.splats"), "-o", file("out.jpg")});
  expectOneLine(result, 2, {"out.jpg", ".png", ".exr", ".pfm"});
  EXPECT_FALSE(std::filesystem::exists(file("out.jpg")));
}

TEST_F(BadInput, UnwritablePicture) {
  const ProgramResult result =
      runProgram({"render", file("whole.splats"), "-o", file("nowhere/out.png"), "--size", "16x16"});
  expectOneLine(result, 1, {"nowhere"});
}

TEST_F(BadInput, WrongUsage) {
  expectOneLine(runProgram({}), 2, {"subcommand", "see curvisplat --help"});
  expectOneLine(runProgram({"frobnicate"}), 2, {"frobnicate"});
  expectOneLine(runProgram({"convert"}), 2, {"see curvisplat convert --help"});
  expectOneLine(runProgram({"render"}), 2, {"CACHE is required", "see curvisplat render --help"});
  expectOneLine(runProgram({"compare", file("scene.xyz")}), 2, {"see curvisplat compare --help"});
  expectOneLine(runProgram({"render", file("whole.splats"), "-o", file("a.png"), "--sise", "4x4"}), 2,
                {"--sise"});
}

TEST_F(BadInput, InvalidOptionValues) {
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& text) {
    expectOneLine(runProgram(arguments), 2, {text});
  };
  // The unknown option comes first, whatever else is missing.
  refused({"render", "--sise"}, "unknown option --sise (did you mean --size?)");
  refused({"convert", file("scene.xyz"), "--time-step", "99999999999"},
          "--time-step '99999999999': is not a whole number from 0 on, or is too large");
  refused({"convert", file("scene.xyz"), "--blank", "none"},
          "--blank 'none': is not a number, or is too large");
  refused({"convert", file("scene.xyz"), "--threads", "1025"},
          "--threads '1025': expected a number from 0 to 1024");
  refused({"convert", file("scene.xyz"), "--threads", ""}, "--threads ''");
  refused({"convert", file("scene.xyz"), "-o"}, "--output needs a value");
  expectOneLine(runProgram({"convert", file("scene.xyz"), file("scene.fun"), "-o", file("little.splats"),
                            "--memory", "1K"}),
                1, {"--memory 1 KiB: conversion of 1 scalar takes at least 160 MiB"});
  expectOneLine(runProgram({"render", file("whole.splats"), "-o", file("a.png"), "--memory", "1K"}), 2,
                {"--memory 1 KiB: too little"});
}

TEST_F(BadInput, MisspeltSubcommandGetsTheListOfThem) {
  expectOneLine(runProgram({"rendr", file("whole.splats")}), 2,
                {"rendr", "did you mean render?", "convert", "info"});
  expectOneLine(runProgram({"render", file("whole.splats"), "-o", file("a.png"), "--sise", "9x9"}), 2,
                {"unknown option --sise (did you mean --size?); see"});
  expectOneLine(runProgram({"render", file("whole.splats"), "-o", file("a.png"), "--zzzzzz=3"}), 2,
                {"unknown option --zzzzzz; see curvisplat render --help"});
}

TEST_F(BadInput, UnknownScene) {
  const ProgramResult result = runProgram({"generate", "pipe", "--size", "4x4x4", "-o", file("pipe")});
  expectOneLine(result, 2, {"pipe", "half-annulus", "wake"});
}

TEST_F(BadInput, InvalidSizeOfAScene) {
  for (const char* size :
       {"", "4", "4x4", "4x4x4x4", "4x4x1", "ax4x4", "-4x4x4", "4x4x4 ", "99999999999999999999x4x4"})
    expectOneLine(runProgram({"generate", "wake", "--size", size, "-o", file("sized")}), 2, {"NIxNJxNK"});
}

TEST_F(BadInput, ComparingAFileThatIsNotAPicture) {
  expectOneLine(runProgram({"compare", file("text.xyz"), file("text.xyz")}), 1, {"text.xyz", "PNG"});
}

TEST_F(BadInput, InfoWithoutAnArgument) {
  expectOneLine(runProgram({"info", file("missing.splats")}), 1, {"missing.splats"});
  expectOneLine(runProgram({"info", file("text.xyz")}), 1, {"text.xyz"});
}

}  // namespace
}  // namespace curvisplat
