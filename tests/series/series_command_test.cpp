// Series of time steps, as a person converts, lists and draws them. convert --follow notices what a
// simulation writes without polling; kill_series.py and full_disk.sh have its ends.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class SeriesCommand : public ProgramTest {
 protected:
  void generate(const std::string& prefix, int steps, const Words& more = {}) const {
    run(Words{"generate", "wake", "--size", "40x30x16", "--steps", std::to_string(steps), "-o",
              file(prefix)} +
        more);
  }
  /// A picture in the view and the function that all tests use.
  std::string draw(const std::string& cache, const std::string& picture, const Words& more = {}) const {
    run(Words{"render", file(cache), "-o", file(picture), "--size", "80x60", "--view", "+z", "--range", "0,1",
              "--opacity-unit", "0.5"} +
        more);
    return bytesOfFile(file(picture));
  }
};

TEST_F(SeriesCommand, EachStepDrawsAsACacheOfThatStepAlone) {
  for (const bool moving : {false, true}) {
    SCOPED_TRACE(moving);
    const std::string name = moving ? "m" : "f";
    Words more;
    if (moving) more = {"--moving"};
    generate(name, 3, more);
    const std::string grid = moving ? file(name + "_%04d.xyz") : file(name + ".xyz");
    const ProgramResult converted =
        run({"convert", grid, file(name + "_%04d.fun"), "-o", file(name + ".splats")});
    EXPECT_EQ(lineCount(converted.out), 3) << converted.out;
    EXPECT_EQ(CacheReader(file(name + ".splats")).series().geometries(), moving ? 3u : 1u);
    run({"info", file(name + ".splats"), "--verify"});

    draw(name + ".splats", "frame_%d.png", {"--steps", "all"});
    for (int step = 0; step < 3; ++step) {
      SCOPED_TRACE(step);
      if (step != (moving ? 1 : 2) && !faults::isWholeSweep()) continue;
      const std::string number = fmt::format("{:04}", step);
      const std::string own_grid = moving ? file(name + "_" + number + ".xyz") : file(name + ".xyz");
      fs::remove_all(file("alone.splats"));
      run({"convert", own_grid, file(name + "_" + number + ".fun"), "-o", file("alone.splats")});
      const std::string alone = draw("alone.splats", "alone.png");
      EXPECT_TRUE(draw(name + ".splats", "step.png", {"--step", std::to_string(step)}) == alone);
      EXPECT_TRUE(draw(name + ".splats", "time.png", {"--time", fmt::format("{}.2", step)}) == alone);
      // The view of a moving camera stays; a still one fits the step.
      if (!moving) {
        EXPECT_TRUE(bytesOfFile(file(fmt::format("frame_{}.png", step))) == alone);
      }
    }
  }
}

TEST_F(SeriesCommand, DrawsStepsBackwardsInMemoryAndOutOfIt) {
  generate("f", 4);
  run({"convert", file("f.xyz"), file("f_%04d.fun"), "-o", file("f.splats")});
  for (const char* memory : {"512M", "96M"}) {
    draw("f.splats", "a_%d.png", {"--steps", "1:3:2", "--memory", memory, "--backend", "cpu"});
    for (const int frame : {0, 1}) {
      const std::string step = std::to_string(1 + 2 * frame);
      EXPECT_TRUE(bytesOfFile(file(fmt::format("a_{}.png", frame))) ==
                  draw("f.splats", "b.png", {"--step", step, "--backend", "cpu"}))
          << memory << " " << step;
    }
  }
  // Two turns of the camera through the four steps.
  draw("f.splats", "o_%d.png", {"--steps", "all", "--orbit", "360", "--frames", "8"});
  EXPECT_TRUE(fs::exists(file("o_7.png")));
  EXPECT_FALSE(fs::exists(file("o_8.png")));
  // Parts have the steps, the cameras and the names of the whole.
  for (const char* part : {"1/2", "2/2"})
    draw("f.splats", "p_%d.png", {"--steps", "all", "--orbit", "360", "--frames", "8", "--part", part});
  for (int n = 0; n < 8; ++n)
    EXPECT_TRUE(bytesOfFile(file(fmt::format("o_{}.png", n))) ==
                bytesOfFile(file(fmt::format("p_{}.png", n))))
        << n;
}

TEST_F(SeriesCommand, SelectsAddsAndLists) {
  generate("f", 7);
  run({"convert", file("f.xyz"), file("f_*.fun"), "-o", file("all.splats")});
  run({"convert", file("f.xyz"), file("f_*.fun"), "--steps", "1:5:2", "-o", file("some.splats")});
  run({"convert", file("f.xyz"), file("f_*.fun"), "--every", "3", "-o", file("third.splats")});
  EXPECT_EQ(CacheReader(file("all.splats")).series().steps.size(), 7u);
  EXPECT_EQ(CacheReader(file("some.splats")).series().steps.size(), 3u);
  EXPECT_EQ(CacheReader(file("third.splats")).series().steps.size(), 3u);

  run({"convert", file("f.xyz"), file("f_0000.fun"), "-o", file("added.splats")});
  run({"convert", "--add-steps", file("f.xyz"), file("f_0001.fun"), "--to", file("added.splats")});
  const ProgramResult added =
      run({"convert", "--add-steps", file("f.xyz"), file("f_0002.fun"), file("f_0003.fun"),
           file("f_0004.fun"), file("f_0005.fun"), file("f_0006.fun"), "--to", file("added.splats")});
  expectSays(added.out, "7 steps, 5 of them converted now");
  for (const char* name : {"steps.bin", "var.0.bin", "var.0.6.bin", "geometry.bin"})
    EXPECT_TRUE(bytesOfFile(file(std::string("added.splats/") + name)) ==
                bytesOfFile(file(std::string("all.splats/") + name)))
        << name;

  const ProgramResult info = run({"info", file("all.splats")});
  expectSays(info.out, "steps      7, times 0 to 6, 1 geometry");
  const std::string at_step = run({"info", file("all.splats"), "--step", "2"}).out;
  for (const char* own : {"faces.bin ", "faces.step2.bin ", "this step ", "all steps "})
    expectSays(at_step, std::string("\n") + own);
  EXPECT_EQ(at_step.find("faces.step3.bin"), std::string::npos) << at_step;
  const auto json = nlohmann::json::parse(run({"info", file("all.splats"), "--json", "--step", "2"}).out);
  ASSERT_EQ(json["steps"].size(), 7u);
  EXPECT_EQ(json["steps"][6]["time"], 6);
  uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(file("all.splats")))
    if (entry.path().filename() != "manifest.json") bytes += entry.file_size();
  EXPECT_EQ(json["series_bytes"], bytes);
  EXPECT_EQ(json["variables"][0]["max"], json["steps"][2]["variables"][0]["max"]);
}

TEST_F(SeriesCommand, PatternsLeaveOutCaches) {
  generate("f", 3);
  for (const char* step : {"0", "1", "2"})
    fs::rename(file(std::string("f_000") + step + ".fun"), file(std::string("q.") + step));
  const Words words{"convert", file("f.xyz"), file("q.*"), "-o", file("q.splats")};
  run(words);
  for (const char* again : {"--resume", "--overwrite"}) {
    Words more = words;
    more.push_back(again);
    expectSays(run(more).out, "3 steps");
  }
}

TEST_F(SeriesCommand, AnInterruptedAdditionGoesOnWhereItStood) {
  generate("f", 5);
  const Words addition{"convert",          "--add-steps",      file("f.xyz"), file("f_0002.fun"),
                       file("f_0003.fun"), file("f_0004.fun"), "--resume"};
  const auto resumed = [&](int added_before) {
    const std::string cache = file("to.splats");
    run({"convert", file("f.xyz"), file("f_0000.fun"), file("f_0001.fun"), "-o", cache, "--overwrite"});
    // What an addition that was stopped after some of its steps leaves behind.
    for (int n = 0; n < added_before; ++n)
      run({"convert", "--add-steps", file("f.xyz"), file(fmt::format("f_{:04}.fun", 2 + n)), "--to", cache});
    Words words = addition;
    words.insert(words.end(), {"--to", cache});
    run(words);
    return filesOf(cache);
  };
  const Files expected = resumed(0);
  EXPECT_EQ(CacheReader(file("to.splats")).series().steps.size(), 5u);
  for (int added_before = 1; added_before < 4; ++added_before)
    if (added_before == 2 || faults::isWholeSweep()) {
      EXPECT_TRUE(resumed(added_before) == expected) << added_before;
    }
}

TEST_F(SeriesCommand, FollowsWhatASimulationWrites) {
  generate("f", 3);
  run({"convert", file("f.xyz"), file("f_*.fun"), "-o", file("all.splats")});
  const auto move = [&](const std::string& step, const std::string& to) {
    fs::create_directories(file(to));
    for (const char* ending : {".fun", ".nam"})
      fs::rename(file("f_" + step + ending), file(to + "/f_" + step + ending));
  };
  // Nothing has been written yet. The first step's file is incomplete at first.
  for (const char* step : {"0000", "0001", "0002"}) move(step, "later");
  fs::create_directories(file("run"));
  fs::rename(file("f.xyz"), file("run/f.xyz"));
  RunningProgram following({"convert", file("run/f.xyz"), file("run/f_*.fun"), "--follow", "--until", "2",
                            "-o", file("a.splats")});
  const std::string first = bytesOfFile(file("later/f_0000.fun"));
  fs::copy_file(file("later/f_0000.nam"), file("run/f_0000.nam"));
  std::ofstream(file("run/f_0000.fun"), std::ios::binary) << first.substr(0, 1000);
  std::ofstream(file("run/f_0000.fun"), std::ios::binary) << first;
  {
    FolderWatch watch(folder_.path());
    watch.waitUntil([&] { return fs::exists(file("a.splats")); });
  }
  for (const char* step : {"0001", "0002"})
    for (const char* ending : {".nam", ".fun"})
      fs::copy_file(file(std::string("later/f_") + step + ending),
                    file(std::string("run/f_") + step + ending));
  const ProgramResult result = following.wait();
  EXPECT_EQ(result.status, 0) << result.err;
  expectSays(result.out, "2 steps");
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 2u);

  // Ended by a signal, and continued. The cache is whole in between.
  RunningProgram interrupted(
      {"convert", file("run/f.xyz"), file("run/f_*.fun"), "--follow", "--resume", "-o", file("a.splats")});
  {
    FolderWatch watch(file("a.splats"));
    watch.waitUntil([&] { return CacheReader(file("a.splats")).series().steps.size() == 3; });
  }
  interrupted.signal(SIGTERM);
  const ProgramResult ended = interrupted.wait();
  expectRefused(ended, 128 + SIGTERM, {});
  for (const char* name : {"steps.bin", "var.0.bin", "var.0.1.bin", "var.0.2.bin", "geometry.bin"})
    EXPECT_TRUE(bytesOfFile(file(std::string("a.splats/") + name)) ==
                bytesOfFile(file(std::string("all.splats/") + name)))
        << name;
}

TEST_F(SeriesCommand, RangesAreOfTheSeriesOrOfAStep) {
  generate("f", 3);
  {  // the last node of the last step
    std::fstream last(file("f_0002.fun"), std::ios::binary | std::ios::in | std::ios::out);
    const float value = 5;
    last.seekp(-4, std::ios::end).write(reinterpret_cast<const char*>(&value), sizeof value);
  }
  run({"convert", file("f.xyz"), file("f_*.fun"), "-o", file("a.splats")});
  const CacheReader first(file("a.splats"));
  const VariableInfo series = first.seriesManifest().variables[0];
  const VariableInfo step = first.atStep(1).manifest().variables[0];
  ASSERT_LT(step.max, series.max);
  const auto rangeOf = [&](const Words& more) {
    Words arguments{"render", file("a.splats"), "-o", file("r_%d.png"), "--size",
                    "40x30",  "--view",         "+z", "--stats",        file("r.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    run(arguments);
    const auto json = nlohmann::json::parse(bytesOfFile(file("r.json")));
    return json["transfer_function"]["range"].get<std::vector<double>>();
  };
  const std::vector<double> of_step{step.min, step.max}, of_series{series.min, series.max};
  EXPECT_EQ(rangeOf({"--steps", "1:1", "--range", "series"}), of_series);
  EXPECT_EQ(rangeOf({"--steps", "1:1", "--range", "step"}), of_step);
  EXPECT_EQ(rangeOf({"--steps", "1:1", "--range", "data"}), of_series);
  EXPECT_EQ(rangeOf({"--step", "1", "--range", "data"}), of_step);
  // Chosen from the data, too: the same whichever step comes first.
  EXPECT_EQ(rangeOf({"--steps", "0:2"}), rangeOf({"--steps", "1:1"}));
}

TEST_F(SeriesCommand, FileSeriesOfParaView) {
  generate("f", 3);
  // A .series takes files of any format; times are its own.
  std::ofstream(file("s.p3d.series")) << R"({"file-series-version": "1.0", "files": [
      {"name": "two.p3d", "time": 5}, {"name": "one.p3d", "time": 2.5}]})";
  std::ofstream(file("one.p3d"))
      << R"({"filenames": [{"time": 0, "xyz": "f.xyz", "function": "f_0000.fun"}]})";
  std::ofstream(file("two.p3d"))
      << R"({"filenames": [{"time": 0, "xyz": "f.xyz", "function": "f_0001.fun"}]})";
  run({"convert", file("s.p3d.series"), "--steps", "all", "-o", file("a.splats")});
  const CacheReader cache(file("a.splats"));
  ASSERT_EQ(cache.series().steps.size(), 2u);
  EXPECT_EQ(cache.series().steps[0].time, 2.5);
  EXPECT_EQ(cache.series().steps[1].time, 5);
  EXPECT_EQ(cache.series().geometries(), 1u);
  // Without --steps it is one step, and a note says so.
  const ProgramResult one = run({"convert", file("s.p3d.series"), "-o", file("b.splats")});
  expectSays(one.err, "2 time steps");
  // So is a .p3d of several steps.
  std::ofstream(file("both.p3d")) << R"({"filenames": [{"time": 1, "xyz": "f.xyz", "function": "f_0000.fun"},
      {"time": 2, "xyz": "f.xyz", "function": "f_0002.fun"}]})";
  run({"convert", file("both.p3d"), "--steps", "all", "-o", file("c.splats")});
  EXPECT_EQ(CacheReader(file("c.splats")).series().steps.size(), 2u);
}

TEST_F(SeriesCommand, RefusesInOneLine) {
  generate("f", 3);
  const auto refused = [&](const Words& arguments, int status, const std::string& words) {
    expectRefused(arguments, status, {words});
  };
  refused({"convert", file("f.xyz"), file("g_*.fun"), "-o", file("a.splats")}, 1, "g_*.fun");
  refused({"convert", file("f.xyz"), file("f_*.fun"), "--steps", "5:9", "-o", file("a.splats")}, 2,
          "3 steps");
  refused({"convert", file("f.xyz"), file("f_*.fun"), "--steps", "1:x", "-o", file("a.splats")}, 2,
          "FIRST:LAST");
  refused({"convert", file("f.xyz"), file("f_*.fun"), "--time-step", "1", "-o", file("a.splats")}, 2,
          "--steps 1");
  refused({"convert", "--add-steps", file("f.xyz"), file("f_0000.fun")}, 2, "--to");
  run({"convert", file("f.xyz"), file("f_*.fun"), "-o", file("a.splats")});
  refused({"render", file("a.splats"), "-o", file("a.png"), "--step", "3"}, 2, "steps 0 to 2");
  refused(
      {"convert", file("f.xyz"), file("f_*.fun"), "-o", file("w.splats"), "--follow", "--stats", file("s")},
      2, "--stats");
  // Options that would have no effect.
  for (const Words& option :
       {Words{"--value-precision", "fine"}, {"--overlap", "all"}, {"--surface", "k=3"}, {"--no-surfaces"}})
    for (const char* mode : {"--add-steps", "--add-scalar=f"}) {
      Words words{"convert", mode, file("f.xyz"), file("f_0000.fun"), "--to", file("a.splats")};
      words.insert(words.end(), option.begin(), option.end());
      refused(words, 2, option[0] + " cannot be combined with");
    }
  for (const Words& option : {Words{"--trace", file("t.json")},
                              {"--value-precision", "fine"},
                              {"--blank", "0"},
                              {"--tmp", file("")},
                              {"--memory", "1G"},
                              {"--threads", "1"},
                              {"--keep-going"},
                              {"--overlap", "all"},
                              {"--time-step", "1"},
                              {"--stats", file("s.json")}}) {
    Words words{"convert", "--join", file("p.splats.parts"), "-o", file("p.splats")};
    words.insert(words.end(), option.begin(), option.end());
    refused(words, 2, option[0] + " cannot be combined with --join");
  }
  refused({"render", file("a.splats"), "-o", file("a.png"), "--steps", "all"}, 2, "frame");
  refused({"convert", file("f.xyz"), file("f_0000.fun"), "--add-scalar", "f", "--to", file("a.splats")}, 1,
          "series of 3 steps");

  // A step of another size is named, and left out with --keep-going.
  run({"generate", "wake", "--size", "20x30x16", "-o", file("other")});
  fs::copy_file(file("other.fun"), file("f_0003.fun"));
  fs::copy_file(file("f_0002.fun"), file("f_0004.fun"));
  for (const char* name : {"f_0003.nam", "f_0004.nam"}) fs::copy_file(file("f_0000.nam"), file(name));
  const ProgramResult broken =
      runProgram({"convert", file("f.xyz"), file("f_*.fun"), "-o", file("b.splats")});
  EXPECT_EQ(broken.status, 1);
  expectSays(broken.err, "step 3");
  expectSays(broken.err, "f_0003.fun");
  EXPECT_EQ(CacheReader(file("b.splats")).series().steps.size(), 3u);
  const ProgramResult kept =
      run({"convert", file("f.xyz"), file("f_*.fun"), "-o", file("c.splats"), "--keep-going"});
  expectSays(kept.err, "left out step 3");
  EXPECT_EQ(CacheReader(file("c.splats")).series().steps.size(), 4u);
}

/// Whether the process holds a queue of inotify with watches.
bool hasWatches(pid_t process) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(process) + "/fdinfo", error)) {
    if (bytesOfFile(entry.path()).find("inotify wd:") != std::string::npos) return true;
  }
  return false;
}

class Follow : public ProgramTest {
 protected:
  /// w.xyz and w_0000.fun, ..., which have been there for a while.
  void generate(int steps) {
    run({"generate", "wake", "--size", "24x20x16", "--steps", std::to_string(steps), "-o", file("w")});
    settle();
  }
  void settle(std::chrono::hours ago = std::chrono::hours(1)) const {
    for (const auto& entry : fs::directory_iterator(folder_.path()))
      if (entry.is_regular_file()) fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - ago);
  }
};

TEST_F(Follow, NoticesChanges) {
  generate(2);
  fs::rename(file("w_0001.fun"), file("later"));
  fs::create_symlink("none", file("w_0001.fun"));
  RunningProgram following(
      {"convert", file("w.xyz"), file("w_*.fun"), "--follow", "--until", "2", "-o", file("a.splats")});
  {
    FolderWatch watch(folder_.path());
    watch.waitUntil([&] { return fs::exists(file("a.splats")); });
  }
  EXPECT_TRUE(hasWatches(following.process()));
  fs::rename(file("later"), file("w_0001.fun"));
  const ProgramResult result = following.wait();
  EXPECT_EQ(result.status, 0) << result.err;
  expectSays(result.err, "warning: waiting for a file: " + file("w_0001.fun") +
                             ": is a link to none, which does not exist");
  EXPECT_EQ(lineCount(result.err), 2) << result.err;
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 2u);
}

// A program may pause for longer than two seconds within a file.
TEST_F(Follow, TriesTheLastFileAgainWhenItHasChanged) {
  generate(3);
  const std::string whole = bytesOfFile(file("w_0001.fun"));
  fs::rename(file("w_0002.fun"), file("later"));
  // The file that takes its place has its size and its date.
  std::ofstream(file("w_0001.fun"), std::ios::binary) << std::string(whole.size(), '\x7f');
  const auto written = fs::last_write_time(file("w_0001.fun"));
  const auto command = [&](const char* cache, const std::string& more) {
    return fmt::format("exec '{}' convert '{}' '{}' --follow --until 2 --refine 1 -o '{}' {} 2>'{}'",
                       CURVISPLAT_PROGRAM, file("w.xyz"), file("w_*.fun"), file(cache), more, file("said"));
  };
  std::ofstream(file("said"));
  RunningProgram following({"-c", command("a.splats", "")}, "/bin/sh");
  {
    FolderWatch watch(folder_.path());
    watch.waitUntil([&] { return bytesOfFile(file("said")).find("not taken yet: ") != std::string::npos; });
  }
  std::ofstream(file("whole"), std::ios::binary) << whole;
  fs::last_write_time(file("whole"), written);
  fs::rename(file("whole"), file("w_0001.fun"));
  EXPECT_EQ(following.wait().status, 0);
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 2u);
  const std::string said = bytesOfFile(file("said"));
  EXPECT_EQ(lineCount(said), 1) << said;
  expectSays(said, "w_0001.fun");
  // It is given up when the next one is written.
  fs::resize_file(file("w_0001.fun"), whole.size() / 2);
  fs::rename(file("later"), file("w_0002.fun"));
  RunningProgram ending({"-c", command("b.splats", "--keep-going")}, "/bin/sh");
  EXPECT_EQ(ending.wait().status, 0);
  EXPECT_EQ(CacheReader(file("b.splats")).series().steps.size(), 2u);
  expectSays(bytesOfFile(file("said")), "left out ");
}

TEST_F(Follow, TakesFilesOfAnotherClock) {
  generate(2);
  settle(-std::chrono::hours(100));
  const ProgramResult result = runProgram(
      {"convert", file("w.xyz"), file("w_*.fun"), "--follow", "--until", "2", "-o", file("a.splats")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 2u);
}

TEST_F(Follow, WaitsForAFolder) {
  generate(1);
  RunningProgram following({"convert", file("run/w.xyz"), file("run/w_*.fun"), "--follow", "--until", "1",
                            "-o", file("a.splats")});
  fs::create_directories(file("run"));
  for (const char* name : {"w.xyz", "w_0000.nam", "w_0000.fun"})
    fs::rename(file(name), file(std::string("run/") + name));
  const ProgramResult result = following.wait();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(CacheReader(file("a.splats")).series().steps.size(), 1u);
}

}  // namespace
}  // namespace curvisplat
