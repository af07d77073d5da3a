// The convert subcommand, option by option, on the real program; also --add-scalar and --refine.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <regex>
#include <string>
#include <vector>

#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "tests/reference/function_grid.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

class ConvertOptionsTest : public ProgramTest {
 protected:
  void SetUp() override {
    Progress progress;
    writePlot3d(SceneGridSource(makeScene("wake"), {60, 50, 40}), folder_ / "wake", progress);
  }

  Words convert(const Words& more) const {
    return Words{"convert", file("wake.xyz"), file("wake.fun"), "-o", file("wake.splats")} + more;
  }
};

TEST_F(ConvertOptionsTest, PrintsWhatItDid) {
  const ProgramResult result = run(convert({"--stats", file("stats.json")}));
  EXPECT_EQ(lineCount(result.out), 3) << result.out;
  expectSays(result.out, "120000 samples, 118000 splats");
  expectSays(result.out, "rounded within");
  expectSays(result.err, "2000 nodes on block faces coincide");

  const auto stats = jsonOf(folder_ / "stats.json");
  EXPECT_EQ(stats["samples"], 120000);
  EXPECT_EQ(stats["merged_nodes"], 2000);
  EXPECT_GT(stats["peak_memory_bytes"], 0);
  EXPECT_LE(stats["temporary_bytes"], 70 * 120000);
  std::vector<std::string> phases;
  for (const auto& phase : stats["phases"]) phases.push_back(phase["name"]);
  EXPECT_EQ(phases,
            (std::vector<std::string>{"scan", "count", "scatter", "seams", "build", "faces", "finish"}));
  uint64_t bytes = 0;
  for (const auto& [name, size] : stats["files"].items()) {
    EXPECT_EQ(size, std::filesystem::file_size(folder_ / "wake.splats" / name));
    bytes += size.get<uint64_t>();
  }
  EXPECT_EQ(stats["cache_bytes"], bytes);
}

TEST_F(ConvertOptionsTest, GivesTheSameCacheForAnyThreadsAndMemory) {
  run(convert({"--threads", "1", "--memory", "200M"}));
  const Files one = filesOf(folder_ / "wake.splats");
  run(convert({"--threads", "2", "--memory", "8G", "--overwrite"}));
  EXPECT_TRUE(filesOf(folder_ / "wake.splats") == one);
}

TEST_F(ConvertOptionsTest, TakesAGridAfterItsSolutionAndAllScalarsWithADerivedOne) {
  run({"convert", file("wake.fun"), file("wake.xyz"), "-o", file("a.splats"), "--scalar", "all,volume"});
  run(convert({"--scalar", "all", "--scalar", "volume"}));
  // All files that there are, as they are chosen in a dialog.
  for (const Words& files : {Words{file("wake.fun"), file("wake.nam"), file("wake.xyz")},
                             Words{file("wake.nam"), file("wake.xyz"), file("wake.fun")}})
    run(Words{"info"} + files);
  for (const char* const name : {"geometry.bin", "var.0.bin", "var.1.bin"})
    EXPECT_TRUE(readTextFile(folder_ / "a.splats" / name) == readTextFile(folder_ / "wake.splats" / name))
        << name;
}

TEST_F(ConvertOptionsTest, PutsTemporaryFilesIntoTheGivenFolderAndRemovesThem) {
  std::filesystem::create_directory(folder_ / "tmp");
  run(convert({"--tmp", file("tmp")}));
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "tmp"));
  expectRefused(convert({"--tmp", file("none"), "--overwrite"}), 1, {"--tmp"});
}

TEST_F(ConvertOptionsTest, RefusesLessMemoryThanItNeeds) {
  expectRefused(convert({"--memory", "10M"}), 1, {"--memory"});
  EXPECT_FALSE(std::filesystem::exists(folder_ / "wake.splats"));
}

TEST_F(ConvertOptionsTest, TakesATrailingSlash) {
  run({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("slash.splats/")});
  EXPECT_TRUE(std::filesystem::exists(folder_ / "slash.splats" / "manifest.json"));
}

/// Expects that the line's first number, which has a unit, is `value` with two significant digits. `units`: by their names.
void expectEstimated(const std::string& text, const std::string& line, double value,
                     const std::map<std::string, double>& units) {
  std::smatch found;
  ASSERT_TRUE(std::regex_search(text, found, std::regex(line + "([0-9.]+) ([A-Za-z]+)"))) << line << text;
  std::string digits = found.str(1);
  const double unit = units.at(found.str(2));
  std::erase(digits, '.');
  digits.erase(0, digits.find_first_not_of('0'));
  digits.erase(digits.find_last_not_of('0') + 1);
  EXPECT_LE(digits.size(), 2u) << found.str();
  EXPECT_NEAR(std::stod(found.str(1)) * unit, value, 0.051 * value) << found.str();
}

const std::map<std::string, double> kByteUnits{{"bytes", 1}, {"KiB", 0x1p10}, {"MiB", 0x1p20}};
const std::map<std::string, double> kTimeUnits{{"s", 1}, {"min", 60}};

/// --dry-run's forecast, and the conversion that it is of.
void expectForecastHolds(const Words& conversion, const TemporaryFolder& folder) {
  const ProgramResult forecast =
      run(conversion + Words{"--dry-run", "--stats", (folder / "dry.json").string()});
  EXPECT_FALSE(std::filesystem::exists(folder / "out.splats"));
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    EXPECT_EQ(entry.path().filename().string().find("dry-run"), std::string::npos) << entry.path();
  run(conversion + Words{"--stats", (folder / "real.json").string()});
  uint64_t bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "out.splats"))
    bytes += entry.file_size();
  const auto found = jsonOf(folder / "dry.json")["dry_run"];
  EXPECT_NEAR(found["cache_bytes"].get<double>() / static_cast<double>(bytes), 1, 0.05) << forecast.out;
  const auto peak = jsonOf(folder / "real.json")["peak_memory_bytes"].get<double>();
  EXPECT_NEAR(found["memory_bytes"].get<double>() / peak, 1, 0.3) << forecast.out;
  for (const std::string name : {"cache", "temporary", "memory"})
    if (found["steps"] == 1)  // a sample that was the whole grid has measured them
      expectSays(forecast.out, fmt::format("  {:<10} {}", name, byteText(found[name + "_bytes"])));
    else
      expectEstimated(forecast.out, "  " + name + " +", found[name + "_bytes"], kByteUnits);
  expectEstimated(forecast.out, "  time +", found["seconds"], kTimeUnits);
}

TEST_F(ConvertOptionsTest, InfoEstimatesWithTwoDigits) {
  const auto estimate =
      nlohmann::json::parse(run({"info", file("wake.xyz"), file("wake.fun"), "--json"}).out)["estimate"];
  const std::string text = run({"info", file("wake.xyz"), file("wake.fun")}).out;
  expectEstimated(text, "a cache of about ", estimate["cache_bytes"], kByteUnits);
  expectEstimated(text, "with one scalar, ", estimate["cache_bytes_per_further_scalar"], kByteUnits);
  expectEstimated(text, "scalar; about ", estimate["seconds"], kTimeUnits);
}

TEST_F(ConvertOptionsTest, ADryRunPredictsCostsAndLeavesNothing) {
  expectForecastHolds({"convert", file("wake.xyz"), file("wake.fun"), "-o", file("out.splats")}, folder_);
}

TEST_F(ConvertOptionsTest, ADryRunOfASeriesCountsItsSteps) {
  run({"generate", "wake", "--size", "56x40x30", "--steps", "4", "-o", file("s")});
  expectForecastHolds({"convert", file("s.xyz"), file("s_*.fun"), "-o", file("out.splats")}, folder_);
}

TEST_F(ConvertOptionsTest, ADryRunNeedsANewCache) {
  const ProgramResult added = runProgram(
      {"convert", file("wake.xyz"), "--add-scalar", "i", "--to", file("wake.splats"), "--dry-run"});
  EXPECT_EQ(added.status, 2);
  EXPECT_EQ(
      added.err,
      "curvisplat: --dry-run: is for a new cache; leave out --add-scalar, --add-steps, --to and --follow\n");
  run(convert({}));
  const ProgramResult in_the_way = runProgram(convert({"--dry-run"}));
  EXPECT_EQ(in_the_way.status, 1);
  expectSays(in_the_way.err, "--overwrite");
}

class AddScalarCommand : public ProgramTest {
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

  const std::string cache = file("a.splats");
};

TEST_F(AddScalarCommand, AddsAScalarThatCanBeDrawn) {
  const std::string geometry = bytesOfFile(file("a.splats/geometry.bin"));
  const ProgramResult added = run({"convert", file("scene.xyz"), file("more.fun"), "--add-scalar", "wave",
                                   "--to", cache + "/", "--memory", "256M", "--stats", file("stats.json")});
  expectSays(added.out, "added wave");
  EXPECT_EQ(lineCount(added.out), 2) << added.out;
  EXPECT_TRUE(bytesOfFile(file("a.splats/geometry.bin")) == geometry);

  const auto stats = jsonOf(file("stats.json"));
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
  const auto refused = [&](const Words& more, int status, const std::string& says) {
    expectRefused(Words{"convert", file("scene.xyz"), file("more.fun")} + more, status, {says});
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

class RefineCommand : public ProgramTest {
 protected:
  RefineCommand() {
    Progress progress;
    writePlot3d(SceneGridSource(makeScenes("duct"), {9, 7, 6}), folder_ / "duct", progress);
  }

  Words convert(const std::string& cache, const Words& more = {}) const {
    return Words{"convert", file("duct.xyz"), file("duct.fun"), "-o", file(cache)} + more;
  }
  nlohmann::json manifest(const std::string& cache) const {
    return jsonOf(folder_ / cache / "manifest.json");
  }
};

TEST_F(RefineCommand, CutsEachCellAndSaysSo) {
  run(convert("1.splats"));
  run(convert("2.splats", {"--refine", "2", "--threads", "1"}));
  const nlohmann::json whole = manifest("1.splats"), fine = manifest("2.splats");
  EXPECT_FALSE(whole.contains("refined"));
  EXPECT_EQ(fine["refined"], 2);
  EXPECT_EQ(fine["nodes"], 3 * 17 * 13 * 11);
  EXPECT_EQ(fine["blocks"][0]["ni"], 17);
  EXPECT_NEAR(fine["volume"].get<double>() / whole["volume"].get<double>(), 1, 1e-3);
  EXPECT_EQ(fine["lower"], whole["lower"]);
  EXPECT_EQ(fine["upper"], whole["upper"]);
  const ProgramResult info = runProgram({"info", file("2.splats")});
  expectSays(info.out, "2 x 2 x 2");
  const ProgramResult probe = runProgram({"info", file("2.splats"), "--probe", "0.5,0.5,0.5"});
  expectSays(probe.out, "the middle of the part of a cell there is at");
  EXPECT_EQ(runProgram({"info", file("1.splats")}).out.find("refined"), std::string::npos);

  const Files one = filesOf(folder_ / "2.splats");
  run(convert("2.splats", {"--refine", "2", "--threads", "2", "--memory", "200M", "--overwrite"}));
  EXPECT_TRUE(filesOf(folder_ / "2.splats") == one);
  run(convert("1.splats", {"--refine", "1", "--overwrite"}));
  EXPECT_EQ(manifest("1.splats"), whole);
}

TEST_F(RefineCommand, FurtherScalarsFollowTheCache) {
  run(convert("a.splats", {"--refine", "2"}));
  const auto add = [&](const char* scalar, const Words& more) {
    return Words{"convert", file("duct.xyz"), "--add-scalar", scalar, "--to", file("a.splats")} + more;
  };
  run(add("i", {}));
  run(add("j", {"--refine", "2"}));
  expectRefused(add("k", {"--refine", "3"}), 2, {"was converted with --refine 2"});
  const nlohmann::json variables = manifest("a.splats")["variables"];
  ASSERT_EQ(variables.size(), 3u);
  EXPECT_EQ(variables[1]["max"], 8) << "the index of the grid's own nodes, interpolated";
  run({"info", file("a.splats"), "--verify"});
}

TEST_F(RefineCommand, ASeriesGoesOnAsItBegan) {
  run({"generate", "wake", "--size", "9x8x7", "--steps", "3", "-o", file("s")});
  const auto series = [&](const std::string& cache, const Words& more) {
    return Words{"convert", file("s.xyz"), file("s_*.fun"), "-o", file(cache)} + more;
  };
  run(series("all.splats", {"--refine", "2"}));
  run(series("some.splats", {"--refine", "2", "--steps", "0:1"}));
  expectRefused(series("some.splats", {"--resume", "--refine", "4"}), 2, {"was converted with --refine 2"});
  run(series("some.splats", {"--resume"}));
  EXPECT_TRUE(filesOf(folder_ / "some.splats") == filesOf(folder_ / "all.splats"));

  run(series("added.splats", {"--refine", "2", "--steps", "0:0"}));
  const auto add = [&](const Words& more) {
    return Words{"convert",     file("s.xyz"), file("s_0001.fun"),  file("s_0002.fun"),
                 "--add-steps", "--to",        file("added.splats")} +
           more;
  };
  expectRefused(add({"--refine", "3"}), 2, {"was converted with --refine 2"});
  run(add({}));
  EXPECT_TRUE(filesOf(folder_ / "added.splats") == filesOf(folder_ / "all.splats"));
}

/// A quarter of a ring of three cells around its axis: these bend along j, and nowhere else.
void writeRing(const std::filesystem::path& name) {
  const FunctionGridSource ring({gridBlock(9, 4, 5)}, 1, [](const GridNode& node) {
    const double turn = static_cast<double>(node.j) * std::numbers::pi / 6;
    const double radius = 8 + static_cast<double>(node.i);
    return NodeValues{{radius * std::cos(turn), radius * std::sin(turn), static_cast<double>(node.k)},
                      {static_cast<float>(radius)}};
  });
  Progress progress;
  writePlot3d(ring, name, progress);
}

TEST_F(RefineCommand, CutsByNeed) {
  writeRing(folder_ / "ring");
  const auto convert_ring = [&](const std::string& cache, const Words& more) {
    return runProgram(Words{"convert", file("ring.xyz"), file("ring.fun"), "-o", file(cache)} + more);
  };
  const ProgramResult whole = convert_ring("1.splats", {"--refine", "1"});
  EXPECT_EQ(whole.status, 0);
  expectSays(whole.err, "note: cells differ much from those beside them: a picture will show bands");
  expectSays(whole.err, "--refine auto");
  EXPECT_EQ(manifest("1.splats")["nodes"], 9 * 4 * 5);

  const ProgramResult by_need = convert_ring("auto.splats", {"--threads", "1"});
  EXPECT_EQ(by_need.status, 0);
  expectSays(by_need.err,
             "note: cells that bend or grow steeply, or end in stairs, are cut: 180 nodes of the files "
             "become 315; --refine 1");
  EXPECT_EQ(by_need.err.find("cells differ"), std::string::npos);
  const nlohmann::json cut = manifest("auto.splats");
  EXPECT_FALSE(cut.contains("refined"));
  EXPECT_EQ(cut["blocks"][0]["refined"], (nlohmann::json{1, 2, 1}));
  EXPECT_EQ(cut["nodes"], 9 * 7 * 5);
  expectSays(runProgram({"info", file("auto.splats")}).out, "1 x 2 x 1");
  const Files one = filesOf(folder_ / "auto.splats");
  convert_ring("auto.splats", {"--refine", "auto", "--threads", "2", "--memory", "200M", "--overwrite"});
  EXPECT_TRUE(filesOf(folder_ / "auto.splats") == one);

  const auto add = [&](const char* scalar, const Words& more) {
    return Words{"convert", file("ring.xyz"), "--add-scalar", scalar, "--to", file("auto.splats")} + more;
  };
  run(add("i", {}));
  run(add("j", {"--refine", "auto"}));
  expectRefused(add("k", {"--refine", "4"}), 2, {"was converted with --refine auto"});
  run({"info", file("auto.splats"), "--verify"});
  const ProgramResult probe = runProgram({"info", file("auto.splats"), "--probe", "8,0,0", "--source"});
  EXPECT_EQ(probe.status, 0) << probe.err;

  // The duct is even enough.
  run(convert("even.splats", {"--refine", "auto"}));
  run(convert("1.splats", {"--overwrite"}));
  EXPECT_EQ(manifest("even.splats")["blocks"], manifest("1.splats")["blocks"]);
}

TEST_F(RefineCommand, IndicesAreThoseOfTheFiles) {
  writeRing(folder_ / "ring");
  const auto convert_ring = [&](const std::string& cache, const Words& more) {
    return Words{"convert", file("ring.xyz"), file("ring.fun"), "-o", file(cache), "--scalar", "all,j"} +
           more;
  };
  run(convert_ring("1.splats", {"--refine", "1", "--surface", "j=2"}));
  run(convert_ring("cut.splats", {"--surface", "j=2"}));
  EXPECT_EQ(manifest("cut.splats")["blocks"][0]["nj"], 7);
  // A node of the files, and a point between two of them.
  const auto nodeAt = [&](const std::string& cache, const std::string& point, const Words& more) {
    const ProgramResult probe = run(Words{"info", file(cache), "--probe", point, "--json"} + more);
    const auto json = nlohmann::json::parse(probe.out)["probe"];
    return std::array<int, 3>{json["i"], json["j"], json["k"]};
  };
  for (const Words& more : {Words{}, Words{"--source"}}) {
    EXPECT_EQ(nodeAt("cut.splats", "5.5,9.52628,2", more), (std::array{3, 2, 2}));
    EXPECT_EQ(nodeAt("cut.splats", "5.4,9.6,2.1", more), nodeAt("1.splats", "5.4,9.6,2.1", more));
  }
  const auto picture = [&](const std::string& cache, const std::string& face) {
    run({"render", file(cache), "-o", file("p.pfm"), "--size", "64x64", "--view", "iso", "--volume", "off",
         "--surface", face});
    return bytesOfFile(file("p.pfm"));
  };
  const std::string of_plane = picture("1.splats", "j=2");
  EXPECT_TRUE(picture("cut.splats", "j=2") == of_plane) << "the cells of a plane through nodes of the files";
  EXPECT_TRUE(picture("cut.splats", "j=2:i=1-5") != of_plane);
  EXPECT_TRUE(picture("cut.splats", "jmax:k=1-9") == picture("1.splats", "jmax:k=1-9"));
  EXPECT_TRUE(picture("cut.splats", "k=0:j=0-2") != picture("cut.splats", "k=0"));
  expectRefused({"render", file("cut.splats"), "-o", file("p.pfm"), "--surface", "j=4"}, 1,
                {"j goes from 0 to 3", "block 1:j=2"});
  expectRefused(convert_ring("no.splats", {"--surface", "j=4"}), 1, {"expected 0 to 3"});
}

TEST_F(RefineCommand, AllStepsAreCutByTheNeedOfTheFirst) {
  writeRing(folder_ / "ring");
  for (const char* const step : {"r_0.fun", "r_1.fun", "r_2.fun"})
    std::filesystem::copy_file(folder_ / "ring.fun", folder_ / step);
  const auto series = [&](const std::string& cache, const Words& more) {
    return Words{"convert", file("ring.xyz"), file("r_*.fun"), "-o", file(cache)} + more;
  };
  expectSays(run(series("all.splats", {})).err, "180 nodes of the files become 315");
  EXPECT_EQ(manifest("all.splats")["blocks"][0]["refined"], (nlohmann::json{1, 2, 1}));
  run(series("some.splats", {"--steps", "0:1"}));
  run(series("some.splats", {"--resume"}));
  EXPECT_TRUE(filesOf(folder_ / "some.splats") == filesOf(folder_ / "all.splats"));
}

TEST_F(RefineCommand, HalvesCellsOfUnstructuredGrids) {
  // Two tetrahedra, the second of three times the volume.
  writeFileAtomically(folder_ / "pair.vtk",
                      "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
                      "POINTS 5 float\n0 0 0 1 0 0 0 1 0 0 0 1 0 0 -3\nCELLS 2 10\n4 0 1 2 3\n4 0 2 1 4\n"
                      "CELL_TYPES 2\n10\n10\nPOINT_DATA 5\nSCALARS s float\nLOOKUP_TABLE default\n1 2 3 4 5\n"
                      "SCALARS t float\nLOOKUP_TABLE default\n2 4 6 8 10\n");
  const auto convert_it = [&](const std::string& cache, const Words& more) {
    return Words{"convert", file("pair.vtk"), "-o", file(cache), "--scalar", "s"} + more;
  };
  const ProgramResult by_need = runProgram(convert_it("auto.splats", {}));
  expectSays(by_need.err,
             "cells beside larger or smaller ones are halved along each edge; --refine 1 leaves them whole");
  run(convert_it("1.splats", {"--refine", "1"}));
  run(convert_it("4.splats", {"--refine", "4"}));
  EXPECT_FALSE(manifest("1.splats").contains("refined"));
  EXPECT_EQ(manifest("1.splats")["nodes"], 5);
  EXPECT_EQ(manifest("auto.splats")["refined"], 2);
  EXPECT_EQ(manifest("auto.splats")["nodes"], 14) << "and the middles of nine edges";
  EXPECT_EQ(manifest("4.splats")["refined"], 4);
  for (const char* const cache : {"auto.splats", "4.splats"})
    EXPECT_NEAR(manifest(cache)["volume"].get<double>(), 4.0 / 6, 1e-4) << cache;

  run({"convert", file("pair.vtk"), "--add-scalar", "t", "--to", file("auto.splats")});
  EXPECT_EQ(manifest("auto.splats")["variables"].size(), 2);
  const std::string of_cut = runProgram({"info", file("auto.splats"), "--probe", "0.2,0.2,0.2"}).out;
  expectSays(of_cut, "of the cut mesh");
  expectSays(runProgram({"info", file("auto.splats"), "--probe", "0.25,0.25,0.25", "--source"}).out,
             "2.5 at the point");
  expectRefused(convert_it("3.splats", {"--refine", "3"}), 1, {"are cut into 2, 4, 8 or 16 parts"});
  EXPECT_FALSE(std::filesystem::exists(folder_ / "3.splats"));
}

TEST_F(RefineCommand, RefusesWhatCannotBeRefined) {
  for (const char* const parts : {"0", "17", "x", "2x", ""}) {
    const ProgramResult result = runProgram(convert("no.splats", {"--refine", parts}));
    EXPECT_EQ(result.status, 2);
    expectSays(result.err, "--refine");
  }
}

}  // namespace
}  // namespace curvisplat
