// Files, folders and scalars with any name; folders that may be looked into and not changed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "render/image/image_file.h"
#include "tests/support/cube_files.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

void alongI(const GridNode& node, NodeValues& values) {
  values.scalars[0] = static_cast<float>(node.i);
}

TEST(OddPaths, WorkEverywhere) {
  const TemporaryFolder folder;
  const fs::path inside = folder / "Größe ρ/two  words 'n\" %d";
  fs::create_directories(inside);
  const std::string cache = inside / "ο cube.splats", picture = inside / "π %.png",
                    stats = inside / "s tats ü.json";
  const std::string scalar = "rho*u/ρ", added = "../../a \"b\"\\ü";
  writeCube(inside / "ο cube", 8, alongI, scalar);
  writeCube(inside / "other ö", 8, alongI, added);
  run(cubeArguments(inside / "ο cube", {"--scalar", scalar, "--stats", stats}));
  EXPECT_TRUE(jsonOf(stats)["files"].contains("var.0.bin"));

  run(cubeAdditionWords(inside / "other ö", added, cache));

  const ProgramResult info = run({"info", cache, "--json", "--verify", "--probe", "3,3,3"});
  const auto json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["variables"][0]["name"], scalar);
  EXPECT_EQ(json["variables"][1]["name"], added);
  EXPECT_EQ(json["probe"]["values"][1]["name"], added);
  expectSays(runProgram({"info", cache}).out, scalar);

  for (const std::string& name : {scalar, added}) {
    run({"render", cache, "-o", picture, "--scalar", name, "--scalar-bar", "--size", "64x64", "--stats",
         stats});
    EXPECT_EQ(readImage(picture).size.width, 64);
    EXPECT_EQ(jsonOf(stats)["scalar"]["name"], name);
  }
  run({"render", cache, "-o", inside / "f ü_%02d.png", "--orbit", "90", "--frames", "2", "--size", "9x9"});
  EXPECT_TRUE(fs::exists(inside / "f ü_01.png"));
  run({"compare", picture, picture});
  run({"generate", "wake", "--size", "4x4x4", "-o", inside / "w ö"});

  // Names stay names: nothing was written beside the folder.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "Größe ρ"), {}), 1);
}

TEST(OddPaths, WorkWithoutAValidEncoding) {
  const TemporaryFolder folder;
  const fs::path prefix = folder / "lat\xfcn";
  writeCube(prefix, 8, alongI, "r\xfc");
  const std::string cache = prefix.string() + ".splats", stats = prefix.string() + ".json";
  run(cubeArguments(prefix, {"--stats", stats}));
  run({"render", cache, "-o", prefix.string() + ".png", "--size", "9x9", "--scalar-bar", "--stats", stats});
  const ProgramResult info = run({"info", cache, "--json"});
  EXPECT_EQ(nlohmann::json::parse(info.out)["variables"].size(), 1u);
}

/// Root may write everywhere: unless that right is taken away.
class ReadOnlyTest : public ProgramTest {
 protected:
  void SetUp() override {
    fs::create_directory(readOnly());
    fs::create_directory(folder_ / "rw");
    writeCube(readOnly() / "cube", 8, alongI);
    run(cubeArguments(readOnly() / "cube"));
    setWritable(false);
    const ProgramResult touched = runBound({"touch", readOnly() / "x"});
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

  /// Runs a program whom permissions bind; its name is the first word.
  static ProgramResult runBound(const Words& words) {
    const Words rights = {"setpriv", "--bounding-set=-dac_override,-dac_read_search",
                          "--inh-caps=-dac_override,-dac_read_search"};
    return RunningProgram(geteuid() == 0 ? rights + words : words, "/usr/bin/env").wait();
  }
  static ProgramResult runProgramBound(const Words& arguments) {
    return runBound(Words{CURVISPLAT_PROGRAM} + arguments);
  }
  /// One line, which names `word`, before any work.
  void expectDenied(const Words& arguments, const std::string& word) const {
    const ProgramResult result = runProgramBound(arguments);
    expectRefused(result, 1, {word, "Permission denied"});
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(fs::is_empty(folder_ / "rw"));
    EXPECT_EQ(std::distance(fs::directory_iterator(readOnly()), {}), 4);
  }

  const std::string cache_ = readOnly() / "cube.splats";
};

TEST_F(ReadOnlyTest, ItIsReadAsAnyOther) {
  const ProgramResult converted =
      runProgramBound(cubeArguments(readOnly() / "cube", {}, folder_ / "rw/b.splats"));
  EXPECT_EQ(converted.status, 0) << converted.err;
  const ProgramResult drawn =
      runProgramBound({"render", cache_, "-o", folder_ / "rw/a.png", "--size", "9x9"});
  EXPECT_EQ(drawn.status, 0) << drawn.err;
  const ProgramResult told = runProgramBound({"info", cache_, "--verify"});
  EXPECT_EQ(told.status, 0) << told.err;
}

TEST_F(ReadOnlyTest, ItIsNotWrittenTo) {
  const fs::path ro = readOnly(), rw = folder_ / "rw";
  expectDenied(cubeArguments(ro / "cube", {}, ro / "b.splats"), ro);
  expectDenied(cubeArguments(ro / "cube", {"--overwrite"}), ro);
  expectDenied(cubeArguments(ro / "cube", {"--tmp", ro}, rw / "b.splats"), "--tmp");
  expectDenied(cubeArguments(ro / "cube", {"--stats", ro / "s.json"}, rw / "b.splats"), "--stats");
  expectDenied({"convert", ro / "cube.xyz", "--add-scalar", "j", "--to", cache_}, cache_);
  expectDenied({"render", cache_, "-o", ro / "a.png"}, ro);
  expectDenied({"render", cache_, "-o", ro / "a_%d.png", "--orbit", "9", "--frames", "2"}, ro);
  expectDenied({"render", cache_, "-o", rw / "a.png", "--first-image", ro / "b.png"}, "--first-image");
  expectDenied({"render", cache_, "-o", rw / "a.png", "--stats", ro / "s.json"}, "--stats");
  expectDenied({"generate", "wake", "--size", "4x4x4", "-o", ro / "w"}, ro);
}

TEST_F(ReadOnlyTest, AnothersCacheIsNotOverwritten) {
  const fs::path cache = folder_ / "rw/c.splats";
  fs::copy(cache_, cache, fs::copy_options::recursive);
  fs::permissions(cache, fs::perms::owner_write, fs::perm_options::remove);
  const ProgramResult result = runProgramBound(cubeArguments(readOnly() / "cube", {"--overwrite"}, cache));
  fs::permissions(cache, fs::perms::owner_write, fs::perm_options::add);
  expectRefused(result, 1, {"c.splats: cannot be overwritten: Permission denied"});
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "rw"), {}), 1);  // no c.splats.partial
}

TEST_F(ReadOnlyTest, WhatCannotBeReadIsNamed) {
  const fs::path rw = folder_ / "rw";
  fs::permissions(readOnly() / "cube.xyz", fs::perms::none);
  expectDenied(cubeArguments(readOnly() / "cube", {}, rw / "b.splats"), "cube.xyz");
  expectDenied({"info", readOnly() / "cube.xyz"}, "cube.xyz");
  fs::permissions(cache_ + "/geometry.bin", fs::perms::none);
  expectDenied({"render", cache_, "-o", rw / "a.png"}, "geometry.bin");
  fs::permissions(cache_, fs::perms::none);
  expectDenied({"render", cache_, "-o", rw / "a.png"}, cache_);
  expectDenied({"info", cache_}, cache_);
  fs::permissions(cache_, fs::perms::owner_all);
}

}  // namespace
}  // namespace curvisplat
