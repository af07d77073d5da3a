// The program as several ranks under mpirun: the same pictures as one process's, and failures of one line.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>

#include "stream/base/file.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class RanksCommand : public ProgramSuite<RanksCommand> {
 protected:
  static void prepare() { madeCache(file("g"), "half-annulus", "64x32x32"); }
  void SetUp() override {
    const std::string why_not = whyNoRanks();
    if (!why_not.empty()) GTEST_SKIP() << why_not;
  }

  static Words renderTo(const std::string& name, const Words& more = {}) {
    return Words{"render", file("g.splats"), "-o", file(name), "--size", "150x100", "--threads", "1"} + more;
  }
  /// A script of bash that runs the program in the tests' folder; the given rank does something else before.
  static std::string atRank(unsigned rank, const std::string& before, const std::string& words) {
    const std::string script = file("as_ranks.sh");
    writeFileAtomically(script, fmt::format("#!/bin/bash\ncd \"{}\"\n"
                                            "[ \"$OMPI_COMM_WORLD_RANK\" = {} ] && {}\n"
                                            "exec \"{}\" {}\n",
                                            file(""), rank, before, CURVISPLAT_PROGRAM, words));
    fs::permissions(script, fs::perms::owner_all);
    return script;
  }
  /// Expects that the folder has no file whose name begins so.
  static void expectNone(const std::string& begin) {
    for (const auto& entry : fs::directory_iterator(file("")))
      EXPECT_FALSE(entry.path().filename().string().starts_with(begin)) << entry.path();
  }
  static void expectSameFile(const std::string& a, const std::string& b) {
    EXPECT_TRUE(readTextFile(file(a)) == readTextFile(file(b))) << a << " and " << b;
  }
};

TEST_F(RanksCommand, DrawOnePictureTogether) {
  const Words looks[] = {{}, {"--slice=-0.4,0.1,0.5,1,0.3,0", "--shade", "--outline", "--scalar-bar"}};
  for (const Words& look : looks) {
    if (look.empty() && !faults::isWholeSweep()) continue;
    run(renderTo("one.exr", look));
    for (const unsigned count : {2u, 3u}) {
      if (count == 2 && !faults::isWholeSweep()) continue;
      const ProgramResult shared =
          runAsRanks(count, renderTo("shared.exr", look + Words{"--stats", file("s.json")}));
      EXPECT_EQ(shared.status, 0) << shared.err;
      EXPECT_EQ(lineCount(shared.out), 2) << shared.out;  // of rank 0 alone
      expectSameFile("one.exr", "shared.exr");
      const auto json = jsonOf(file("s.json"));
      EXPECT_EQ(json["ranks"], count);
      ASSERT_EQ(json["frames"].size(), 1u);
      EXPECT_EQ(json["frames"][0]["of_ranks"].size(), count);
    }
  }
}

TEST_F(RanksCommand, ShareOutFrames) {
  const Words orbit{"--orbit", "360", "--frames", "3"};
  run(renderTo("one_%d.png", orbit));
  const ProgramResult shared =
      runAsRanks(2, renderTo("shared_%d.png", orbit + Words{"--stats", file("s.json")}));
  EXPECT_EQ(shared.status, 0) << shared.err;
  for (int n = 0; n < 3; ++n) expectSameFile(fmt::format("one_{}.png", n), fmt::format("shared_{}.png", n));
  const auto frames = jsonOf(file("s.json"))["frames"];
  ASSERT_EQ(frames.size(), 3u);
  for (int n = 0; n < 3; ++n) EXPECT_EQ(frames[static_cast<size_t>(n)]["frame"], n);
  // Fewer frames than ranks: each is drawn together.
  ASSERT_EQ(runAsRanks(3, renderTo("two_%d.png", {"--orbit", "240", "--frames", "2"})).status, 0);
  expectSameFile("one_0.png", "two_0.png");
  expectSameFile("one_1.png", "two_1.png");
}

TEST_F(RanksCommand, ReportAFailureOnce) {
  expectRefused(runAsRanks(3, renderTo("a.png", {"--lod-pixels", "-1"})), 2, {"rank 0 of 3", "--lod-pixels"});
  expectRefused(runAsRanks(2, renderTo("a.png", {"--first-image", file("f.png")})), 2, {});
}

TEST_F(RanksCommand, ReportADamagedStepOfASeriesOnce) {
  run({"generate", "wake", "--size", "20x16x12", "--steps", "4", "-o", file("s")});
  for (const int damaged : {1, 3}) {  // of rank 0, and of another, which rank 0 tries again
    if (damaged == 1 && !faults::isWholeSweep()) continue;
    const std::string name = file(fmt::format("s_{:04}.fun", damaged));
    const auto size = fs::file_size(name);
    fs::resize_file(name, size - 7);
    const ProgramResult result =
        runAsRanks(3, {"convert", file("s.xyz"), file("s_%04d.fun"), "-o", file("s.splats"), "--overwrite",
                       "--threads", "1", "--refine", "1"});
    fs::resize_file(name, size);
    expectRefused(result, 1, {"rank 0 of 3", fmt::format("s_{:04}.fun", damaged)});
  }
}

TEST_F(RanksCommand, TheFirstConvertsAStepThatAnotherCannotReadAndSaysSo) {
  run({"generate", "wake", "--size", "20x16x12", "--steps", "4", "-o", file("s")});
  // Rank 1 sees another version of the last step's file.
  fs::create_directory(file("other"));
  for (const char* name : {"s.xyz", "s_0000.fun", "s_0000.nam", "s_0001.fun", "s_0001.nam", "s_0002.fun",
                           "s_0002.nam", "s_0003.fun", "s_0003.nam"})
    fs::copy_file(file(name), file("other/") + name);
  fs::resize_file(file("other/s_0003.fun"), 100);
  const std::string script =
      atRank(1, "cd other",
             "convert s.xyz s_%04d.fun --threads 1 --refine 1 --overwrite -o \"" + file("s.splats") + '"');
  const ProgramResult result = runAsRanks(3, {}, script);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  expectSays(result.err, "warning: rank 1 could not convert step 3 (s_0003.fun)");
  run({"convert", file("s.xyz"), file("s_%04d.fun"), "--threads", "1", "--refine", "1", "--overwrite", "-o",
       file("alone.splats")});
  for (const auto& [name, bytes] : filesOf(file("alone.splats")))
    if (name != "manifest.json") {
      EXPECT_TRUE(readTextFile(file("s.splats/" + name)) == bytes) << name;
    }
}

TEST_F(RanksCommand, AddStepsWhereOneCannotReadAStepThatIsThere) {
  run({"generate", "wake", "--size", "20x16x12", "--steps", "4", "-o", file("a")});
  const std::string cache = '"' + file("a.splats") + '"';
  const auto convert = [&](const std::string& words, unsigned ranks, const std::string& of_second = "true") {
    return runAsRanks(ranks, {},
                      atRank(1, of_second, "convert a.xyz 'a_*.fun' --threads 1 --steps " + words));
  };
  ASSERT_EQ(convert("0:1 --refine 1 -o " + cache, 1).status, 0);
  ASSERT_EQ(convert("2:3 --add-steps --to " + cache, 1).status, 0);
  const Files expected = filesOf(file("a.splats"));
  fs::create_directory(file("unread"));
  for (const auto& entry : fs::directory_iterator(file("")))
    if (entry.path().filename().string().starts_with("a") && entry.is_regular_file())
      fs::copy_file(entry.path(), file("unread/") + entry.path().filename().string());
  fs::resize_file(file("unread/a_0002.fun"), 100);
  const ProgramResult result = convert("2:3 --add-steps --resume --to " + cache, 2, "cd unread");
  EXPECT_EQ(result.status, 0) << result.err;
  expectSays(result.out, "4 steps, 0 of them converted now");
  EXPECT_TRUE(filesOf(file("a.splats")) == expected);
}

TEST_F(RanksCommand, ThatSeeOtherNumbersOfStepsAreRefused) {
  run({"generate", "wake", "--size", "20x16x12", "--steps", "3", "-o", file("n")});
  for (const int fewer : {2, 1}) {  // one is no series
    if (fewer == 2 && !faults::isWholeSweep()) continue;
    const fs::path folder = file(fmt::format("fewer{}", fewer));
    fs::create_directory(folder);
    fs::copy_file(file("n.xyz"), folder / "n.xyz");
    for (int step = 0; step < fewer; ++step)
      for (const char* ending : {"fun", "nam"})
        fs::copy_file(file(fmt::format("n_000{}.{}", step, ending)),
                      folder / fmt::format("n_000{}.{}", step, ending));
    const std::string script =
        atRank(1, "cd " + folder.filename().string(),
               "convert n.xyz 'n_*.fun' --threads 1 -o \"" + file("mixed.splats") + '"');
    expectRefused(
        runAsRanks(2, {}, script), 1,
        {"rank 1 of 2", fmt::format("{} here and 3 time steps at rank 0; give all ranks the same files",
                                    fewer == 1 ? "1 time step" : "2 time steps")});
    expectNone("mixed");
  }
}

TEST_F(RanksCommand, ConvertScalarsOfAMeshThatShareNoSample) {
  constexpr int kCells = 12;
  std::string text = fmt::format(
      "# vtk DataFile Version 3.0\nm\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} float\n", 4 * (kCells + 1));
  for (int x = 0; x <= kCells; ++x) text += fmt::format("{0} 0 0 {0} 1 0 {0} 1 1 {0} 0 1\n", x);
  text += fmt::format("CELLS {} {}\n", kCells, 9 * kCells);
  for (int n = 0; n < kCells; ++n) {
    text += "8";
    for (int corner = 0; corner < 8; ++corner) text += fmt::format(" {}", 4 * n + corner);
    text += "\n";
  }
  text += fmt::format("CELL_TYPES {}\n", kCells);
  for (int n = 0; n < kCells; ++n) text += "12\n";
  text += fmt::format("CELL_DATA {}\n", kCells);
  for (const int remainder : {0, 1}) {
    text += fmt::format("SCALARS s{} float 1\nLOOKUP_TABLE default\n", remainder);
    for (int n = 0; n < kCells; ++n) text += n % 2 == remainder ? fmt::format("{}\n", n) : "nan\n";
  }
  writeFileAtomically(file("m.vtk"), text);
  const auto to = [](const std::string& name) {
    return Words{"convert", file("m.vtk"), "--threads", "1", "-o", file(name)};
  };
  run(to("m1.splats"));
  const ProgramResult shared = runAsRanks(3, to("m3.splats"));
  EXPECT_EQ(shared.status, 0) << shared.err;
  EXPECT_TRUE(filesOf(file("m3.splats")) == filesOf(file("m1.splats")));
}

TEST_F(RanksCommand, ThatSeeOtherFilesAreRefused) {
  fs::create_directory(file("elsewhere"));
  run({"generate", "half-annulus", "--size", "60x32x32", "-o", file("elsewhere/g")});
  ASSERT_EQ(runProgram({"convert", file("elsewhere/g.xyz"), file("elsewhere/g.fun"), "-o",
                        file("elsewhere/g.splats")})
                .status,
            0);
  for (const std::string command : {"convert g.xyz g.fun --threads 1 -o ", "render g.splats -o "}) {
    const std::string output = file(command.front() == 'c' ? "mixed.splats" : "mixed.png");
    const std::string script = atRank(2, "cd elsewhere", fmt::format("{} \"{}\"", command, output));
    expectRefused(runAsRanks(3, {}, script), 1, {"rank 2 of 3", "here than at rank 0"});
    expectNone("mixed");
  }
}

TEST_F(RanksCommand, ThatHaveOtherOptionsAreRefused) {
  const auto expectOtherRefused = [&](const std::string& command, const std::string& of_one,
                                      const std::string& told) {
    const std::string script = atRank(1, fmt::format("exec \"{}\" {}", CURVISPLAT_PROGRAM, of_one), command);
    expectRefused(runAsRanks(2, {}, script), 2,
                  {"rank 1 of 2", told + " at rank 0; start all ranks with the same options"});
    expectNone("mixed");
  };
  const std::string convert = "convert g.xyz g.fun -o mixed.splats";
  expectOtherRefused(convert + " --no-surfaces", convert, "--no-surfaces is not given here and 'true'");
  const std::string render = "render g.splats -o mixed.png --size 60x40";
  if (faults::isWholeSweep()) {
    expectOtherRefused(convert, convert + " --value-precision fine",
                       "--value-precision is 'fine' here and not given");
    expectOtherRefused(convert, convert + " --memory 512M", "--memory is '512M' here and not given");
    expectOtherRefused(render, "render g.splats -o mixed.png --size 61x40",
                       "--size is '61x40' here and '60x40'");
  }
  const std::string frames = "render g.splats -o mixed%d.png --size 60x40 --orbit 90 --frames ";
  expectOtherRefused(frames + "6", frames + "3", "--frames is '3' here and '6'");
  expectOtherRefused(convert, render, "--output is 'mixed.png' here and 'mixed.splats'");
}

TEST_F(RanksCommand, OfSeveralThatFailOfOneCauseTheLowestReports) {
  // All ranks but the first see no cache; rank 0 fails later than they do, as it hears of it.
  const std::string script = atRank(0, "cache=g.splats", "render \"${cache:-missing.splats}\" -o never.png");
  expectRefused(runAsRanks(4, {}, script), 1, {"rank 1 of 4", "missing.splats"});
  EXPECT_FALSE(fs::exists(file("never.png")));
}

TEST_F(RanksCommand, AreEndedByTheOneThatFails) {
  // Rank 1 sees no cache, as on a machine where the file system is not mounted.
  const std::string script = atRank(1, "cache=missing.splats", "render \"${cache:-g.splats}\" -o never.png");
  expectRefused(runAsRanks(3, {}, script), 1, {"rank 1 of 3", "missing.splats"});
  EXPECT_FALSE(fs::exists(file("never.png")));
}

TEST_F(RanksCommand, ConvertTogether) {
  const Files expected = filesOf(file("g.splats"));
  for (const unsigned count : {2u, 3u}) {
    if (count == 2 && !faults::isWholeSweep()) continue;
    fs::remove_all(file("shared.splats"));
    const ProgramResult shared =
        runAsRanks(count, {"convert", file("g.xyz"), file("g.fun"), "-o", file("shared.splats"), "--threads",
                           "1", "--memory", "256M", "--stats", file("c.json")});
    EXPECT_EQ(shared.status, 0) << shared.err;
    EXPECT_EQ(lineCount(shared.out), 3) << shared.out;
    const Files found = filesOf(file("shared.splats"));
    ASSERT_EQ(found.size(), expected.size());
    for (const auto& [name, bytes] : expected) EXPECT_TRUE(found.at(name) == bytes) << name;
    EXPECT_EQ(jsonOf(file("c.json"))["ranks"], count);
  }
  expectNone("shared.splats.");
}

TEST_F(RanksCommand, CutCellsByNeedAlike) {
  run({"generate", "wake", "--size", "20x16x12", "-o", file("cut")});
  const auto to = [](const std::string& name) {
    return Words{"convert", file("cut.xyz"), file("cut.fun"), "--threads", "1", "--overwrite",
                 "-o",      file(name)};
  };
  run(to("cut_by_one.splats"));
  EXPECT_NE(run({"info", file("cut_by_one.splats")}).out.find("each cell of the files' grid is"),
            std::string::npos);
  for (const unsigned count : {2u, 3u}) {
    if (count == 2 && !faults::isWholeSweep()) continue;
    const ProgramResult shared = runAsRanks(count, to("cut.splats"));
    EXPECT_EQ(shared.status, 0) << shared.err;
    Files expected = filesOf(file("cut_by_one.splats")), found = filesOf(file("cut.splats"));
    expected.erase("manifest.json");  // their titles differ
    found.erase("manifest.json");
    EXPECT_TRUE(found == expected) << count;
  }
}

TEST_F(RanksCommand, ConvertASeriesTogether) {
  run({"generate", "wake", "--size", "24x20x12", "--steps", "7", "-o", file("s")});
  const auto to = [&](const std::string& name, const Words& more = {}) {
    return Words{"convert", file("s.xyz"), file("s_%04d.fun"), "--refine", "1", "--threads",
                 "1",       "-o",          file(name)} +
           more;
  };
  run(to("s1.splats"));
  const Files expected = filesOf(file("s1.splats"));
  const ProgramResult shared = runAsRanks(2, to("s2.splats", {"--stats", file("s.json")}));
  EXPECT_EQ(shared.status, 0) << shared.err;
  EXPECT_EQ(lineCount(shared.out), 3) << shared.out;
  EXPECT_TRUE(filesOf(file("s2.splats")) == expected);
  const auto json = jsonOf(file("s.json"));
  EXPECT_EQ(json["ranks"], 2);
  EXPECT_EQ(json["each_step"].size(), 7u);

  // Parts by processes that know nothing of each other; the last one has nothing to do.
  for (const char* part : {"2/4", "4/4", "1/4"}) {
    const ProgramResult made = run(to("s3.splats", {"--part", part, "--stats", file("p.json")}));
    EXPECT_EQ(lineCount(made.out), 1) << made.out;
    const auto numbers = jsonOf(file("p.json"));
    EXPECT_EQ(numbers["each_step"].size(), numbers["converted"]);
    fs::remove(file("p.json"));
  }
  const Words join{"convert", "--join", file("s3.splats.parts"), "-o", file("s3.splats")};
  expectRefused(join, 1, {"part 3 of 4 is missing"});
  run(to("s3.splats", {"--part", "3/4"}));
  run(join);
  EXPECT_TRUE(filesOf(file("s3.splats")) == expected);
  // The part without steps may be missing. Parts of two conversions are refused.
  fs::remove(file("s3.splats.parts/4of4.json"));
  run(join + Words{"--overwrite"});
  EXPECT_TRUE(filesOf(file("s3.splats")) == expected);
  run(to("s3.splats", {"--part", "5/5"}));
  expectRefused(join + Words{"--overwrite"}, 1,
                {"has parts of 4 and parts of 5", "remove the files *of4.* or *of5.*"});
  for (const Words& wrong :
       {to("w.splats", {"--part", "5/4"}),
        to("w.splats", {"--part", "1/2", "--keep-going"}),
        to("w.splats", {"--part", "1/2", "--dry-run"}),
        {"convert", "--join", file("s3.splats.parts"), "-o", file("w.splats"), "--resume"}})
    expectRefused(wrong, 2, {});
  EXPECT_FALSE(fs::exists(file("w.splats.parts")));
}

TEST_F(RanksCommand, AddScalarsTogether) {
  const auto adding = [](const std::string& cache, const Words& more = {}) {
    return Words{"convert",
                 file("g.xyz"),
                 file("g.fun"),
                 "--add-scalar",
                 "volume,jacobian",
                 "--to",
                 file(cache),
                 "--threads",
                 "1",
                 "--memory",
                 "256M"} +
           more;
  };
  fs::copy(file("g.splats"), file("one.splats"));
  run(adding("one.splats"));
  const Files expected = filesOf(file("one.splats"));
  for (const unsigned count : {2u, 3u}) {
    if (count == 3 && !faults::isWholeSweep()) continue;
    fs::remove_all(file("added.splats"));
    fs::copy(file("g.splats"), file("added.splats"));
    const ProgramResult shared = runAsRanks(count, adding("added.splats", {"--stats", file("a.json")}));
    EXPECT_EQ(shared.status, 0) << shared.err;
    EXPECT_EQ(lineCount(shared.out), 2) << shared.out;  // of rank 0 alone
    EXPECT_TRUE(filesOf(file("added.splats")) == expected);
    EXPECT_EQ(jsonOf(file("a.json"))["ranks"], count);
  }
  expectRefused(runAsRanks(2, adding("added.splats")), 2, {"already has a scalar"});
  EXPECT_TRUE(filesOf(file("added.splats")) == expected);
  expectNone("added.splats.");
}

TEST_F(RanksCommand, LeaveTheCacheWhereOneFailsInAnAddition) {
  fs::copy(file("g.splats"), file("kept.splats"));
  const Files before = filesOf(file("kept.splats"));
  // Rank 1 has no grid, or a full disk.
  for (const char* const fault : {"grid=missing.xyz", "ulimit -f 100"}) {
    if (fault[0] == 'g' && !faults::isWholeSweep())
      continue;  // LeaveNothingWhereOneFailsInAConversion has none
    const std::string script =
        atRank(1, fault, "convert ${grid:-g.xyz} g.fun --add-scalar volume --to kept.splats");
    SCOPED_TRACE(fault);
    expectRefused(runAsRanks(3, {}, script), 1, {"rank 1 of 3"});
    EXPECT_TRUE(filesOf(file("kept.splats")) == before);
    expectNone("kept.splats.");
  }
}

TEST_F(RanksCommand, LeaveNothingWhereOneFailsInAConversion) {
  // Rank 1 has no grid.
  const std::string script = atRank(1, "grid=missing.xyz", "convert ${grid:-g.xyz} g.fun -o never.splats");
  expectRefused(runAsRanks(2, {}, script), 1, {"rank 1 of 2"});
  expectNone("never");
}

TEST_F(RanksCommand, NameTheRankWhoseDiskIsFull) {
  const std::string script = atRank(1, "ulimit -f 100", "convert g.xyz g.fun -o never.splats");
  expectRefused(runAsRanks(3, {}, script), 1, {"rank 1 of 3", "File too large"});
  expectNone("never.splats");
}

TEST_F(RanksCommand, NameTheRankWhoseCardFails) {
  const std::string card = CURVISPLAT_LOST_CARD;
  if (card.empty()) GTEST_SKIP() << "sanitizers have their own preloaded library";
  const Words words = renderTo("egl.exr", {"--backend", "egl"});
  if (const ProgramResult drawn = runProgram(words); drawn.status != 0) GTEST_SKIP() << drawn.err;
  const std::string script = atRank(1, "export LD_PRELOAD=\"" + card + '"', "\"$@\"");
  const ProgramResult result = runAsRanks(2, words, script);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  expectSays(result.err, "rank 1 of 2");
  expectSays(result.err, "warning: OpenGL could not go on; drawn by");
  expectSays(result.err, "the graphics card was reset");
}

TEST_F(RanksCommand, AreSimulatedFromTheIndex) {
  run({"bench", file("g.splats"), "--ranks", "1,2,16,1024", "--size", "640x480", "--json", file("b.json"),
       "--plot", file("plots")});
  const auto counts = jsonOf(file("b.json"))["ranks"]["counts"];
  ASSERT_EQ(counts.size(), 4u);
  EXPECT_EQ(counts[0]["efficiency"], 1);
  EXPECT_EQ(counts[0]["pixel_bytes"], 0);
  EXPECT_EQ(counts[0]["splat_bytes"], 0);
  for (const auto& one : counts) {
    EXPECT_LE(one["efficiency"].get<double>(), one["balance"].get<double>() + 1e-9);
    EXPECT_EQ(one["all_bytes"], counts[0]["all_bytes"]);  // each brick is read once
    EXPECT_GE(one["painted_splats"].get<double>(), counts[0]["painted_splats"].get<double>());
  }
  EXPECT_TRUE(fs::exists(file("plots/ranks.png")));
  expectRefused({"bench", file("g.splats"), "--ranks", "0"}, 2, {});
}

TEST_F(RanksCommand, ASingleOneNeedsNoMpi) {
  const ProgramResult alone = runAsRanks(1, renderTo("alone.exr"));
  EXPECT_EQ(alone.status, 0) << alone.err;
  run(renderTo("one.exr"));
  expectSameFile("one.exr", "alone.exr");
}

}  // namespace
}  // namespace curvisplat
