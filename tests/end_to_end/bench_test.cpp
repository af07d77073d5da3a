// `curvisplat bench`, as a person runs it: every row is there or has its reason. Nothing is said of how fast.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <set>

#include "render/image/image_file.h"
#include "tests/support/program_test.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class Bench : public ProgramTest {
 protected:
  void writeCache() { writeLatticeCache(folder_ / "a.splats", 0.2, {0.01, 0.01, 0.01}); }
};

/// Reads a report, and checks the fields that compare.py relies on.
nlohmann::json readReport(const std::string& path) {
  const auto json = jsonOf(path);
  EXPECT_EQ(json["schema"], 1);
  EXPECT_EQ(json["program"], "curvisplat");
  EXPECT_TRUE(json["version"].is_string());
  EXPECT_GE(json["machine"]["cores"], 1);
  EXPECT_FALSE(json["measurements"].empty());
  for (const auto& one : json["measurements"]) {
    EXPECT_TRUE(one["name"].is_string() && one["unit"].is_string());
    EXPECT_FALSE(one["samples"].empty()) << one["name"];
    EXPECT_GT(one["median"], 0) << one["name"];
  }
  for (const auto& one : json["left_out"]) EXPECT_FALSE(one["reason"].get<std::string>().empty());
  return json;
}

std::set<std::string> namesIn(const nlohmann::json& report) {
  std::set<std::string> names;
  for (const char* list : {"measurements", "left_out"})
    for (const auto& one : report[list]) names.insert(one["name"]);
  return names;
}

TEST_F(Bench, MeasuresEveryRowOfACache) {
  writeCache();
  const ProgramResult result = run({"bench", file("a.splats"), "--quick", "--json", file("b.json"), "--plot",
                                    file("plots"), "--threads", "2", "--size", "100x80"});
  const auto report = readReport(file("b.json"));
  const std::set<std::string> names = namesIn(report);
  for (const char* way : {"direct", "direct-pread", "buffered-cold", "buffered-warm"}) {
    for (const char* block : {"4KiB", "64KiB", "256KiB", "1MiB"})
      EXPECT_EQ(names.count(fmt::format("disk/{}/{}/depth:8", way, block)), 1u) << way << " " << block;
    for (const int depth : {1, 2, 4, 16, 32})
      EXPECT_EQ(names.count(fmt::format("disk/{}/256KiB/depth:{}", way, depth)), 1u) << way << " " << depth;
  }
  EXPECT_EQ(names.count("stages/read"), 1u);
  for (const char* stage : {"verify", "decode", "project", "sort", "prepare", "draw/cpu"})
    for (const int threads : {1, 2})
      EXPECT_EQ(names.count(fmt::format("stages/{}/threads:{}", stage, threads)), 1u) << stage;
  for (const char* backend : {"osmesa", "egl"})
    EXPECT_EQ(names.count(fmt::format("stages/draw/{}", backend)), 1u) << backend;
  for (const char* frame :
       {"lod:1/threads:2/memory:512MiB", "lod:2/threads:2/memory:512MiB", "lod:4/threads:2/memory:512MiB",
        "lod:2/threads:1/memory:512MiB", "lod:2/threads:2/memory:128MiB"})
    EXPECT_EQ(names.count(fmt::format("frames/{}", frame)), 1u) << frame;

  ASSERT_TRUE(report.contains("verdict"));
  const std::string first = report["verdict"]["lines"][0];
  expectSays(first, "bounds the frame");
  for (const std::string& words : {std::string("Disk: geometry.bin"), std::string("buffered, warm"),
                                   std::string("draw, cpu"), std::string("1 px"), first})
    expectSays(result.out, words);
  for (const char* plot : {"disk.png", "stages.png", "frames.png"})
    EXPECT_GT(readImage(fs::path(file("plots")) / plot).size.width, 100) << plot;
}

TEST_F(Bench, MeasuresAConversionAndLeavesNothingBehind) {
  fs::create_directory(file("tmp"));
  const ProgramResult result =
      run({"bench", "--convert", "--nodes", "9K", "--quick", "--memory", "256M", "--tmp", file("tmp"),
           "--json", file("b.json"), "--plot", folder_.path().string()});
  EXPECT_TRUE(fs::is_empty(file("tmp")));
  const auto report = readReport(file("b.json"));
  const bool cold = report["conversion"]["grid_files_cold"];
  const std::set<std::string> names = namesIn(report);
  for (const char* name : {"rate", "phase/scan", "phase/scatter", "phase/build", "peak_memory", "cache"})
    EXPECT_EQ(names.count(fmt::format("conversion/{}/{}", cold ? "cold" : "warm", name)), 1u) << name;
  expectSays(result.out, "nodes/s");
  EXPECT_GT(readImage(file("conversion.png")).size.width, 100);
}

TEST_F(Bench, ConversionThatIsInterruptedLeavesNothingBehind) {
  const std::string tmp = file("tmp");
  fs::create_directory(tmp);
  RunningProgram program({"bench", "--convert", "--nodes", "10M", "--tmp", tmp});
  FolderWatch(tmp).waitUntil([&] { return !fs::is_empty(tmp); });
  program.signal(SIGINT);
  const ProgramResult result = program.wait();
  expectRefused(result, 128 + SIGINT, {});
  EXPECT_TRUE(fs::is_empty(tmp));
}

TEST_F(Bench, ReportsWrongUsage) {
  writeCache();
  const std::string cache = file("a.splats");
  expectRefused({"bench"}, 2, {"--convert"});
  expectRefused({"bench", cache, "--convert"}, 2, {"give either a cache or --convert"});
  expectRefused({"bench", cache, "--nodes", "8M"}, 2, {"--nodes needs --convert"});
  for (const char* nodes : {"0", "-5", "many", "8MM", "99999999999999999999", "999"})
    expectRefused({"bench", "--convert", std::string("--nodes=") + nodes}, 2, {nodes});
  expectRefused({"bench", "--convert", "--nodes", "999999G"}, 1, {"MiB free"});
  expectRefused({"bench", "--convert", "--tmp", file("nowhere")}, 1, {"nowhere"});
  expectRefused({"bench", file("none.splats")}, 1, {"none.splats"});
  expectRefused({"bench", cache, "--scalar", "heat"}, 1, {"heat"});
  expectRefused({"bench", cache, "--lod-pixels", "1,-2"}, 2, {"-2"});
  expectRefused({"bench", cache, "--lod-pixels", "1,,2"}, 2, {"--lod-pixels"});
  expectRefused({"bench", cache, "--plot", file("no/where")}, 1, {"--plot"});
  expectRefused({"bench", cache, "--plot", cache + "/manifest.json"}, 1, {"is not a directory"});
  expectRefused({"bench", cache, "--json", file("no/b.json")}, 1, {"--json"});
}

}  // namespace
}  // namespace curvisplat
