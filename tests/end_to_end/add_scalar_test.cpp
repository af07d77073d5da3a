// `curvisplat convert --add-scalar`, as a person runs it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "stream/base/file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

std::string bytesOfFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class AddScalarCommand : public testing::Test {
 protected:
  AddScalarCommand() {
    run({"generate", "wake", "--size", "60x40x20", "-o", file("scene")});
    // A function file of a second scalar: four integers, then a number a node.
    std::string bytes = bytesOfFile(file("scene.fun"));
    for (size_t at = 16; at + sizeof(float) <= bytes.size(); at += sizeof(float)) {
      float value;
      std::memcpy(&value, &bytes[at], sizeof value);
      value = std::sin(10 * value);
      std::memcpy(&bytes[at], &value, sizeof value);
    }
    std::ofstream(file("more.fun"), std::ios::binary) << bytes;
    std::ofstream(file("more.nam")) << "wave\n";
    run({"convert", file("scene.xyz"), file("scene.fun"), "-o", cache});
  }

  ProgramResult run(const std::vector<std::string>& arguments) {
    const ProgramResult result = runProgram(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return result;
  }
  std::string file(const std::string& name) const { return (folder / name).string(); }

  const TemporaryFolder folder;
  const std::string cache = file("a.splats");
};

TEST_F(AddScalarCommand, AddsAScalarThatCanBeDrawn) {
  const std::string geometry = bytesOfFile(file("a.splats/geometry.bin"));
  const ProgramResult added = run({"convert", file("scene.xyz"), file("more.fun"), "--add-scalar", "wave",
                                   "--to", cache + "/", "--memory", "256M", "--stats", file("stats.json")});
  EXPECT_NE(added.out.find("added wave"), std::string::npos) << added.out;
  EXPECT_EQ(lineCount(added.out), 2) << added.out;
  EXPECT_TRUE(bytesOfFile(file("a.splats/geometry.bin")) == geometry);

  const auto stats = nlohmann::json::parse(readTextFile(file("stats.json")));
  EXPECT_EQ(stats["samples"], 60 * 40 * 20);
  EXPECT_EQ(stats["phases"].size(), 6u);
  EXPECT_EQ(stats["files"].size(), 2u);  // of the scalar, and of its values on faces

  run({"info", cache, "--verify"});
  const auto info = nlohmann::json::parse(run({"info", cache, "--json"}).out);
  ASSERT_EQ(info["variables"].size(), 2u);
  EXPECT_EQ(info["variables"][1]["name"], "wave");
  EXPECT_EQ(info["variables"][1]["number"], 1);

  // Drawn from the added scalar as from a cache that never had another.
  run({"convert", file("scene.xyz"), file("more.fun"), "-o", file("b.splats")});
  run({"render", cache, "--scalar", "wave", "-o", file("a.png"), "--size", "64x64"});
  run({"render", file("b.splats"), "-o", file("b.png"), "--size", "64x64"});
  EXPECT_TRUE(bytesOfFile(file("a.png")) == bytesOfFile(file("b.png")));
  run({"render", cache, "-o", file("first.png"), "--size", "64x64"});
  EXPECT_FALSE(bytesOfFile(file("a.png")) == bytesOfFile(file("first.png")));
}

TEST_F(AddScalarCommand, RefusesInOneLine) {
  const auto refused = [&](std::vector<std::string> more, int status, const std::string& words) {
    std::vector<std::string> arguments{"convert", file("scene.xyz"), file("more.fun")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult result = runProgram(arguments);
    EXPECT_EQ(result.status, status) << result.err;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find(words), std::string::npos) << result.err;
  };
  refused({"--add-scalar", "wave"}, 2, "--to");
  refused({"--to", cache}, 2, "--add-scalar");
  refused({"--add-scalar", "wave", "--to", cache, "-o", file("b.splats")}, 2, "--output");
  refused({"--add-scalar", "wave", "--to", cache, "--scalar", "wave"}, 2, "--scalar");
  refused({"--add-scalar", "wave", "--to", cache, "--overwrite"}, 2, "--overwrite");
  refused({}, 2, "--output is required");
  refused({"--add-scalar", "missing", "--to", cache}, 1, "missing");
  refused({"--add-scalar", "wave", "--to", file("none.splats")}, 1, "none.splats");
  refused({"--add-scalar", "wave", "--to", file("scene.fun")}, 1, "scene.fun");
  refused({"--add-scalar", "wave", "--to", cache, "--memory", "1M"}, 1, "--memory");
  run({"convert", file("scene.xyz"), file("more.fun"), "--add-scalar", "wave", "--to", cache});
  refused({"--add-scalar", "wave", "--to", cache}, 2, "already");
}

}  // namespace
}  // namespace curvisplat
