// Files, folders and scalars with any name; folders that may be looked into and not changed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/file.h"
#include "tests/support/cube_files.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

void along(const GridNode& node, NodeValues& values) {
  values.scalars[0] = static_cast<float>(node.i);
}

void expectDone(const std::vector<std::string>& arguments) {
  const ProgramResult result = runProgram(arguments);
  EXPECT_EQ(result.status, 0) << arguments[0] << ": " << result.err;
}

TEST(OddNames, WorkEverywhere) {
  const TemporaryFolder folder;
  const fs::path inside = folder / "Größe ρ/two  words 'n\" %d";
  fs::create_directories(inside);
  const std::string cache = inside / "ο cube.splats", picture = inside / "π %.png",
                    stats = inside / "s tats ü.json";
  const std::string scalar = "rho*u/ρ", added = "../../a \"b\"\\ü";
  writeCube(inside / "ο cube", 8, along, scalar);
  writeCube(inside / "other ö", 8, along, added);
  expectDone(cubeArguments(inside / "ο cube", {"--scalar", scalar, "--stats", stats}));
  EXPECT_TRUE(nlohmann::json::parse(readTextFile(stats))["files"].contains("var.0.bin"));

  expectDone(cubeAdditionWords(inside / "other ö", added, cache));

  const ProgramResult info = runProgram({"info", cache, "--json", "--verify", "--probe", "3,3,3"});
  ASSERT_EQ(info.status, 0) << info.err;
  const auto json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["variables"][0]["name"], scalar);
  EXPECT_EQ(json["variables"][1]["name"], added);
  EXPECT_EQ(json["probe"]["values"][1]["name"], added);
  EXPECT_NE(runProgram({"info", cache}).out.find(scalar), std::string::npos);

  for (const std::string& name : {scalar, added}) {
    expectDone({"render", cache, "-o", picture, "--scalar", name, "--scalar-bar", "--size", "64x64",
                "--stats", stats});
    EXPECT_EQ(readImage(picture).size.width, 64);
    EXPECT_EQ(nlohmann::json::parse(readTextFile(stats))["scalar"]["name"], name);
  }
  expectDone(
      {"render", cache, "-o", inside / "f ü_%02d.png", "--orbit", "90", "--frames", "2", "--size", "9x9"});
  EXPECT_TRUE(fs::exists(inside / "f ü_01.png"));
  expectDone({"compare", picture, picture});
  expectDone({"generate", "wake", "--size", "4x4x4", "-o", inside / "w ö"});

  // Names stay names: nothing was written beside the folder.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "Größe ρ"), {}), 1);
}

TEST(OddNames, WorkWithoutAValidEncoding) {
  const TemporaryFolder folder;
  const fs::path prefix = folder / "lat\xfcn";
  writeCube(prefix, 8, along, "r\xfc");
  const std::string cache = prefix.string() + ".splats", stats = prefix.string() + ".json";
  expectDone(cubeArguments(prefix, {"--stats", stats}));
  expectDone(
      {"render", cache, "-o", prefix.string() + ".png", "--size", "9x9", "--scalar-bar", "--stats", stats});
  const ProgramResult info = runProgram({"info", cache, "--json"});
  EXPECT_EQ(info.status, 0) << info.err;
  EXPECT_EQ(nlohmann::json::parse(info.out)["variables"].size(), 1u);
}

/// Root may write everywhere: unless that right is taken away.
class ReadOnlyTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(readOnly());
    fs::create_directory(folder_ / "rw");
    writeCube(readOnly() / "cube", 8, along);
    expectDone(cubeArguments(readOnly() / "cube"));
    setWritable(false);
    const ProgramResult touched = run({"touch", readOnly() / "x"});
    if (touched.status == 0 || touched.err.find("setpriv") != std::string::npos)
      GTEST_SKIP() << "root's rights cannot be taken away here: " << touched.err;
  }
  void TearDown() override { setWritable(true); }

  fs::path readOnly() const { return folder_ / "ro"; }
  void setWritable(bool writable) const {
    for (const fs::path& path : {readOnly(), readOnly() / "cube.splats"})
      fs::permissions(path, fs::perms::owner_write,
                      writable ? fs::perm_options::add : fs::perm_options::remove);
  }

  /// Runs a program whom permissions bind.
  static ProgramResult run(std::vector<std::string> words) {
    if (geteuid() == 0)
      words.insert(words.begin(), {"setpriv", "--bounding-set=-dac_override,-dac_read_search",
                                   "--inh-caps=-dac_override,-dac_read_search"});
    return RunningProgram(words, "/usr/bin/env").wait();
  }
  static ProgramResult runBound(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), CURVISPLAT_PROGRAM);
    return run(arguments);
  }
  /// One line, which names `word`, before any work.
  void expectRefused(const std::vector<std::string>& arguments, const std::string& word) const {
    const ProgramResult result = runBound(arguments);
    EXPECT_EQ(result.status, 1) << result.out;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find(word), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("Permission denied"), std::string::npos) << result.err;
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(fs::is_empty(folder_ / "rw"));
    EXPECT_EQ(std::distance(fs::directory_iterator(readOnly()), {}), 4);
  }

  const TemporaryFolder folder_;
  const std::string cache_ = readOnly() / "cube.splats";
};

TEST_F(ReadOnlyTest, ItIsReadAsAnyOther) {
  const ProgramResult converted = runBound(cubeArguments(readOnly() / "cube", {}, folder_ / "rw/b.splats"));
  EXPECT_EQ(converted.status, 0) << converted.err;
  const ProgramResult drawn = runBound({"render", cache_, "-o", folder_ / "rw/a.png", "--size", "9x9"});
  EXPECT_EQ(drawn.status, 0) << drawn.err;
  const ProgramResult told = runBound({"info", cache_, "--verify"});
  EXPECT_EQ(told.status, 0) << told.err;
}

TEST_F(ReadOnlyTest, ItIsNotWrittenTo) {
  const fs::path ro = readOnly(), rw = folder_ / "rw";
  expectRefused(cubeArguments(ro / "cube", {}, ro / "b.splats"), ro);
  expectRefused(cubeArguments(ro / "cube", {"--overwrite"}), ro);
  expectRefused(cubeArguments(ro / "cube", {"--tmp", ro}, rw / "b.splats"), "--tmp");
  expectRefused(cubeArguments(ro / "cube", {"--stats", ro / "s.json"}, rw / "b.splats"), "--stats");
  expectRefused({"convert", ro / "cube.xyz", "--add-scalar", "j", "--to", cache_}, cache_);
  expectRefused({"render", cache_, "-o", ro / "a.png"}, ro);
  expectRefused({"render", cache_, "-o", ro / "a_%d.png", "--orbit", "9", "--frames", "2"}, ro);
  expectRefused({"render", cache_, "-o", rw / "a.png", "--first-image", ro / "b.png"}, "--first-image");
  expectRefused({"render", cache_, "-o", rw / "a.png", "--stats", ro / "s.json"}, "--stats");
  expectRefused({"generate", "wake", "--size", "4x4x4", "-o", ro / "w"}, ro);
}

TEST_F(ReadOnlyTest, WhatCannotBeReadIsNamed) {
  const fs::path rw = folder_ / "rw";
  fs::permissions(readOnly() / "cube.xyz", fs::perms::none);
  expectRefused(cubeArguments(readOnly() / "cube", {}, rw / "b.splats"), "cube.xyz");
  expectRefused({"info", readOnly() / "cube.xyz"}, "cube.xyz");
  fs::permissions(cache_ + "/geometry.bin", fs::perms::none);
  expectRefused({"render", cache_, "-o", rw / "a.png"}, "geometry.bin");
  fs::permissions(cache_, fs::perms::none);
  expectRefused({"render", cache_, "-o", rw / "a.png"}, cache_);
  expectRefused({"info", cache_}, cache_);
  fs::permissions(cache_, fs::perms::owner_all);
}

}  // namespace
}  // namespace curvisplat
