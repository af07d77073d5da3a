// Caches that are kept: several programs make one, files change meanwhile, and what lies in their folder is damaged.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <iterator>

#include "stream/base/file.h"
#include "tests/end_to_end/window_fixture.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/vts_writer.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

TEST_F(KeptCaches, ProcessesMayOpenOneNewFileAtOnce) {
  for (int round = 0; round < (faults::isWholeSweep() ? 10 : 1); ++round) {
    fs::remove_all("kept");
    std::vector<std::unique_ptr<RunningProgram>> programs;
    for (int n = 0; n < 4; ++n)
      programs.push_back(std::make_unique<RunningProgram>(
          Words{"render", "a.xyz", "a.fun", "-o", fmt::format("at_once_{}.png", n), "--size", "20x20"}));
    for (const auto& program : programs) {
      const ProgramResult result = program->wait();
      EXPECT_EQ(result.status, 0) << result.err;
    }
  }
}

TEST_F(KeptCaches, WhatIsKnownOfAFileMayBeDamaged) {
  run(render("a.xyz", "a.fun"));
  const fs::path known = "kept/curvisplat/known";
  std::vector<fs::path> notes(fs::directory_iterator(known), {});
  ASSERT_EQ(notes.size(), 2u);
  fs::remove(notes[0]);
  fs::create_directory(notes[0]);
  std::ofstream(notes[1]) << std::string(100'000, '1');
  run(render("a.xyz", "a.fun"));
  EXPECT_EQ(kept().size(), 1u);
}

/// The user does not know the cache, and cannot leave a step out of it.
TEST_F(KeptCaches, FilesThatAreNoSeriesAreNamedWithoutTheCache) {
  for (const char* size : {"8x8x8", "8x8x9"})
    run({"generate", "wake", "--size", size, "-o", fmt::format("part_{}", size + 4)});
  const ProgramResult result =
      runProgram({"render", "part_8.xyz", "part_8.fun", "part_9.fun", "-o", "a.png", "--size", "20x20"});
  EXPECT_NE(result.status, 0);
  EXPECT_EQ(result.err.find("kept"), std::string::npos) << result.err;
  EXPECT_EQ(result.err.find("--keep-going"), std::string::npos) << result.err;
  expectSays(result.err, "part_9.fun: cannot be a time step after ");
}

TEST_F(KeptCaches, ASeriesThatIsStoppedIsNamedWithoutTheCache) {
  run({"generate", "wake", "--size", "100x80x60", "--steps", "4", "-o", "long"});
  RunningProgram render({"render", "long.xyz", "long_0000.fun", "long_0001.fun", "long_0002.fun",
                         "long_0003.fun", "-o", "a.png", "--size", "20x20", "--threads", "1"});
  ASSERT_TRUE(eventually([] {
    std::error_code error;
    for (fs::recursive_directory_iterator at("kept/curvisplat", error), end; !error && at != end;
         at.increment(error))
      if (at->path().filename() == "manifest.json") return true;
    return false;
  }));
  render.signal(SIGTERM);
  const ProgramResult result = render.wait();
  EXPECT_EQ(result.status, 128 + SIGTERM);
  expectSays(result.err, "interrupted");
  EXPECT_EQ(result.err.find("kept"), std::string::npos) << result.err;
  EXPECT_EQ(result.err.find("--resume"), std::string::npos) << result.err;
}

/// The pressure of some nodes is negative, so that they have no Mach number: it is kept apart, as `convert` does.
TEST_F(KeptCaches, AScalarThatSomeNodesLackIsAdded) {
  constexpr std::array<int32_t, 3> kNodes{14, 12, 10};
  std::ofstream grid("flow.xyz", std::ios::binary), flow("flow.q", std::ios::binary);
  const auto write = [](std::ofstream& file, const auto& values) {
    file.write(reinterpret_cast<const char*>(values.data()),
               static_cast<std::streamsize>(values.size() * sizeof(values[0])));
  };
  std::vector<float> places, values;
  const size_t nodes = 14 * 12 * 10;
  for (int axis = 0; axis < 3; ++axis)
    for (size_t n = 0; n < nodes; ++n) {
      const size_t index[] = {n % 14, n / 14 % 12, n / (14 * 12)};
      places.push_back(static_cast<float>(index[axis]));
    }
  for (int q = 0; q < 5; ++q)
    for (size_t n = 0; n < nodes; ++n) {
      const float along = static_cast<float>(n % 14) / 14;
      const bool is_odd = n % 331 == 0;  // 6 nodes
      values.push_back(q == 0   ? 1 + along
                       : q == 1 ? 0.5f + along
                       : q < 4  ? 0.1f
                       : is_odd ? 0.01f
                                : 3 + along);
    }
  write(grid, kNodes);
  write(grid, places);
  write(flow, kNodes);
  write(flow, std::array<float, 4>{0.5f, 0, 1, 0});
  write(flow, values);
  grid.close();
  flow.close();
  const auto drawn = [](const Words& input, const std::string& scalar) {
    run(input + Words{"-o", "drawn.pfm", "--size", "60x50", "--scalar", scalar});
    return readImage("drawn.pfm").rgba;
  };
  const Words opened{"render", "flow.xyz", "flow.q"};
  const auto before = drawn(opened, "density");
  const auto added = drawn(opened, "mach_number");
  EXPECT_EQ(drawn(opened, "density"), before);
  run({"convert", "flow.xyz", "flow.q", "-o", "flow.splats", "--scalar", "all,mach_number"});
  EXPECT_EQ(added, drawn({"render", "flow.splats"}, "mach_number"));
  EXPECT_NE(added, before);
}

// The commands that keep caches have neither --tmp nor --no-preflight.
TEST_F(KeptCaches, CopiesAreTheirOwnersAlone) {
  fs::create_directory("kept");
  run(render("a.xyz", "a.fun"));
  for (const auto& entry : fs::recursive_directory_iterator("kept"))
    if (entry.is_directory() && entry.path().extension() != ".splats") {
      EXPECT_EQ(entry.status().permissions(), fs::perms::owner_all) << entry.path();
    }
}

TEST_F(KeptCaches, AFullDiskIsRefusedWithWhatHelpsThere) {
  run({"generate", "half-annulus", "--size", "60x50x40", "-o", "large"});
  fs::create_directory("kept");
  const ProgramResult result =
      RunningProgram({"unshare", "--mount", "sh", "-c",
                      "mount -t tmpfs -o size=8m none kept && exec " CURVISPLAT_PROGRAM
                      " render large.xyz large.fun -o full.png --size 20x20"},
                     "/usr/bin/env")
          .wait();
  if (result.err.find("curvisplat: ") != 0)
    GTEST_SKIP() << "no file system can be mounted here: " << result.err;
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  expectSays(result.err, "make room, or set XDG_CACHE_HOME to a folder on another disk");
  EXPECT_EQ(result.err.find("--"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists("full.png"));
}

TEST_F(KeptCaches, FilesThatChangeMeanwhileAreConvertedAgain) {
  run({"generate", "half-annulus", "--size", "100x70x60", "-o", "changing"});
  RunningProgram first(
      {"render", "changing.xyz", "changing.fun", "-o", "grid.png", "--size", "20x20", "--threads", "1"});
  ASSERT_TRUE(eventually([] {
    if (!fs::exists("kept/curvisplat")) return false;
    for (const auto& entry :
         fs::recursive_directory_iterator("kept/curvisplat", fs::directory_options::skip_permission_denied))
      if (entry.path().extension() == ".partial") return true;
    return false;
  }));
  fs::last_write_time("changing.fun", fs::file_time_type::clock::now());
  const ProgramResult changed = first.wait();
  EXPECT_EQ(changed.status, 0) << changed.err;
  expectSays(changed.err,
             "changing.fun: was changed while it was converted, and the cache may hold a part of");
  expectSays(changed.err, "changing.fun: changed while it was converted; it is converted again");
  const auto made = fs::last_write_time(kept().at(0) / "manifest.json");
  for (const bool again : {true, false}) {
    const auto before = fs::last_write_time(kept().at(0) / "manifest.json");
    const ProgramResult result = run(render("changing.xyz", "changing.fun"));
    EXPECT_EQ(result.err.find("changed while"), std::string::npos) << result.err;
    EXPECT_EQ(fs::last_write_time(kept().at(0) / "manifest.json") != before, again);
  }
  EXPECT_NE(fs::last_write_time(kept().at(0) / "manifest.json"), made);
}

TEST_F(KeptCaches, OfAGridThatIsStoppedNothingStays) {
  run({"generate", "half-annulus", "--size", "120x100x80", "-o", "stopped"});
  RunningProgram render(
      {"render", "stopped.xyz", "stopped.fun", "-o", "grid.png", "--size", "20x20", "--threads", "1"});
  const auto bytes_of_partial = [] {
    uint64_t bytes = 0;
    std::error_code error;
    for (fs::recursive_directory_iterator at("kept/curvisplat", error), end; !error && at != end;
         at.increment(error))
      if (at->path().string().find(".partial/geometry.bin") != std::string::npos)
        bytes += at->file_size(error);
    return bytes;
  };
  ASSERT_TRUE(eventually([&] { return bytes_of_partial() > 0; }));  // after which `convert` could go on
  render.signal(SIGTERM);
  EXPECT_EQ(render.wait().status, 128 + SIGTERM);
  for (const auto& entry : fs::recursive_directory_iterator("kept/curvisplat"))
    EXPECT_TRUE(entry.path().filename() == "known" || entry.path().parent_path().filename() == "known")
        << entry.path();
}

void writeSet(const std::string& set, const std::string& file, int times) {
  std::ofstream out(set);
  out << R"(<VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet>)";
  for (int n = 0; n < times; ++n) out << fmt::format("<DataSet index=\"{}\" file=\"{}\"/>", n, file);
  out << "</vtkMultiBlockDataSet></VTKFile>";
}

// Each block was once compared with every other one, which took more than a minute.
TEST_F(KeptCaches, InfoOfASetThatNamesOneFileThousandsOfTimesEnds) {
  writeFileAtomically("one.vts", vtsFile(annulusVtsGrid(2, 2, 2), {}));
  writeSet("many.vtm", "one.vts", 2000);
  const ProgramResult result = run({"info", "many.vtm"});
  expectSays(result.out, "nodes     16000 in 2000 blocks");
  expectSays(result.out, "cells     2000; 0 degenerate");
}

TEST_F(KeptCaches, SetsThatNameFilesThousandsOfTimesAreSearchedOnce) {
  writeSet("outer.vtm", "middle.vtm", 3000);
  writeSet("middle.vtm", "inner.vtm", 3000);
  writeSet("inner.vtm", "none.vts", 3000);
  const ProgramResult result = runProgram({"render", "outer.vtm", "-o", "grid.png", "--size", "20x20"});
  EXPECT_EQ(result.status, 1);  // 27 thousand million files
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
}

TEST_F(KeptCaches, FilesOutsideAreNotReadAndAFailureLeavesNothing) {
  fs::create_directory("set");
  writeFileAtomically("outside.vts", vtsFile(annulusVtsGrid(2, 2, 2), {}));
  writeSet("set/a.vtm", "../outside.vts", 1);
  fs::remove_all("kept");
  const ProgramResult result = runProgram({"render", "set/a.vtm", "-o", "grid.png", "--size", "20x20"});
  EXPECT_EQ(result.status, 1);
  expectSays(result.err, "which lies outside its folder");
  EXPECT_EQ(std::distance(fs::directory_iterator("kept/curvisplat/known"), {}), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator("kept/curvisplat"), {}), 1);
}

}  // namespace
}  // namespace curvisplat
