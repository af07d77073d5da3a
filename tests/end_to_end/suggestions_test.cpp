// What people mistype, and what they are told: one line that names the word and what was probably meant.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class Suggestions : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    run({"generate", "half-annulus", "--size", "16x10x8", "-o", file("a")});
    run({"convert", file("a.xyz"), file("a.fun"), "-o", file("flow.splats"), "--scalar", "f,volume"});
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string file(const std::string& name) { return (*folder_ / name).string(); }
  static void run(const std::vector<std::string>& arguments) {
    const ProgramResult result = runProgram(arguments);
    ASSERT_EQ(result.status, 0) << result.err;
  }
  static void expectMeant(const std::vector<std::string>& arguments, const std::string& meant) {
    const ProgramResult result = runProgram(arguments);
    EXPECT_NE(result.status, 0) << testing::PrintToString(arguments);
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find(meant), std::string::npos)
        << testing::PrintToString(arguments) << ": " << result.err;
  }
  /// `render` of the cache with these options.
  static void expectMeantByRender(std::vector<std::string> options, const std::string& meant) {
    options.insert(options.begin(), {"render", file("flow.splats"), "-o", file("a.png")});
    expectMeant(options, meant);
  }

 private:
  static inline std::unique_ptr<TemporaryFolder> folder_;
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
      {{"--orbit", "360"}, "use a name such as frame_%04d.png, or a movie"}};
  for (const auto& [options, meant] : cases) expectMeantByRender(options, meant);
  expectMeant({"render", file("flow.splats"), "-o", file("a.pgn")}, "did you mean .png?");
  expectMeant({"render", file("flow.splats"), "-o", file("a.exr"), "--channels", "dept"},
              "did you mean depth?");
  expectMeant({"render", file("flwo.splats"), "-o", file("a.png")},
              fmt::format("did you mean {}?", file("flow.splats")));
  expectMeant({"generate", "half-anulus", "-o", file("x")}, "did you mean half-annulus?");
  expectMeant({"generate", "wake", "-o", file("x")}, "--size NIxNJxNK is required");
  expectMeant({"info", file("flow.splats"), "--probe", "1,2"}, "--probe needs 3 values, found 2");
  const auto convert = [](std::vector<std::string> options, const std::string& meant) {
    options.insert(options.begin(), {"convert", file("a.xyz"), file("a.fun"), "-o", file("b.splats")});
    expectMeant(options, meant);
  };
  convert({"--scalar", "volum"}, "did you mean volume?");
  convert({"--byte-order", "litle"},
          "--byte-order 'litle': expected one of big, little (did you mean little?)");
  convert({"--overlap", "ownr"}, "did you mean owner?");
  convert({"--time-step", "4"}, "--time-step 4 is out of range");
}

}  // namespace
}  // namespace curvisplat
