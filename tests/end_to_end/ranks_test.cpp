// The program as several ranks under mpirun: the same pictures as one process's, and failures of one line.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "stream/base/file.h"
#include "tests/support/folder_files.h"
#include "tests/support/mpi_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

class RanksCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    ASSERT_EQ(runProgram({"generate", "half-annulus", "--size", "64x32x32", "-o", file("g")}).status, 0);
    const ProgramResult made = runProgram({"convert", file("g.xyz"), file("g.fun"), "-o", file("g.splats")});
    ASSERT_EQ(made.status, 0) << made.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }
  void SetUp() override {
    const std::string why_not = whyNoRanks();
    if (!why_not.empty()) GTEST_SKIP() << why_not;
  }

  static std::string file(const std::string& name) { return (*folder_ / name).string(); }
  static std::vector<std::string> renderTo(const std::string& name, std::vector<std::string> more = {}) {
    std::vector<std::string> words{"render", file("g.splats"), "-o",        file(name),
                                   "--size", "150x100",        "--threads", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// A script that draws never.png: the given rank from a cache of its own, the others from `cache`.
  static std::string renderScript(unsigned rank, const std::string& its_cache, const std::string& cache) {
    const std::string script = file(fmt::format("as_rank_{}.sh", rank));
    writeFileAtomically(script, fmt::format("#!/bin/sh\n"
                                            "cache=\"{}\"\n"
                                            "[ \"$OMPI_COMM_WORLD_RANK\" = {} ] && cache=\"{}\"\n"
                                            "exec \"{}\" render \"$cache\" -o \"{}\"\n",
                                            cache, rank, its_cache, CURVISPLAT_PROGRAM, file("never.png")));
    fs::permissions(script, fs::perms::owner_all);
    return script;
  }
  static void expectSameFile(const std::string& a, const std::string& b) {
    EXPECT_TRUE(readTextFile(file(a)) == readTextFile(file(b))) << a << " and " << b;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};

std::unique_ptr<TemporaryFolder> RanksCommand::folder_;

TEST_F(RanksCommand, DrawOnePictureTogether) {
  const std::vector<std::string> looks[] = {
      {}, {"--slice=-0.4,0.1,0.5,1,0.3,0", "--shade", "--outline", "--scalar-bar"}};
  for (const std::vector<std::string>& look : looks) {
    ASSERT_EQ(runProgram(renderTo("one.exr", look)).status, 0);
    for (const unsigned count : {2u, 3u}) {
      std::vector<std::string> more = look;
      more.insert(more.end(), {"--stats", file("s.json")});
      const ProgramResult shared = runAsRanks(count, renderTo("shared.exr", more));
      EXPECT_EQ(shared.status, 0) << shared.err;
      EXPECT_EQ(lineCount(shared.out), 2) << shared.out;  // of rank 0 alone
      expectSameFile("one.exr", "shared.exr");
      const auto json = nlohmann::json::parse(readTextFile(file("s.json")));
      EXPECT_EQ(json["ranks"], count);
      ASSERT_EQ(json["frames"].size(), 1u);
      EXPECT_EQ(json["frames"][0]["of_ranks"].size(), count);
    }
  }
}

TEST_F(RanksCommand, ShareOutFrames) {
  const std::vector<std::string> orbit{"--orbit", "360", "--frames", "5"};
  ASSERT_EQ(runProgram(renderTo("one_%d.png", orbit)).status, 0);
  std::vector<std::string> more = orbit;
  more.insert(more.end(), {"--stats", file("s.json")});
  const ProgramResult shared = runAsRanks(2, renderTo("shared_%d.png", more));
  EXPECT_EQ(shared.status, 0) << shared.err;
  for (int n = 0; n < 5; ++n) expectSameFile(fmt::format("one_{}.png", n), fmt::format("shared_{}.png", n));
  const auto frames = nlohmann::json::parse(readTextFile(file("s.json")))["frames"];
  ASSERT_EQ(frames.size(), 5u);
  for (int n = 0; n < 5; ++n) EXPECT_EQ(frames[static_cast<size_t>(n)]["frame"], n);
  // Fewer frames than ranks: each is drawn together.
  ASSERT_EQ(runAsRanks(3, renderTo("two_%d.png", {"--orbit", "144", "--frames", "2"})).status, 0);
  expectSameFile("one_0.png", "two_0.png");
  expectSameFile("one_1.png", "two_1.png");
}

TEST_F(RanksCommand, ReportAFailureOnce) {
  const ProgramResult usage = runAsRanks(3, renderTo("a.png", {"--lod-pixels", "-1"}));
  EXPECT_EQ(usage.status, 2);
  EXPECT_EQ(lineCount(usage.err), 1) << usage.err;
  EXPECT_NE(usage.err.find("rank 0 of 3"), std::string::npos) << usage.err;
  EXPECT_NE(usage.err.find("--lod-pixels"), std::string::npos) << usage.err;
  const ProgramResult first = runAsRanks(2, renderTo("a.png", {"--first-image", file("f.png")}));
  EXPECT_EQ(first.status, 2);
  EXPECT_EQ(lineCount(first.err), 1) << first.err;
}

TEST_F(RanksCommand, ReportADamagedStepOfASeriesOnce) {
  ASSERT_EQ(runProgram({"generate", "wake", "--size", "20x16x12", "--steps", "4", "-o", file("s")}).status,
            0);
  for (const int damaged : {1, 2, 3}) {  // of rank 0, and of another, which rank 0 tries again
    const std::string name = file(fmt::format("s_{:04}.fun", damaged));
    const auto size = fs::file_size(name);
    fs::resize_file(name, size - 7);
    const ProgramResult result = runAsRanks(3, {"convert", file("s.xyz"), file("s_%04d.fun"), "-o",
                                                file("s.splats"), "--overwrite", "--threads", "1"});
    fs::resize_file(name, size);
    EXPECT_EQ(result.status, 1);
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find("rank 0 of 3"), std::string::npos) << result.err;
    EXPECT_NE(result.err.find(fmt::format("s_{:04}.fun", damaged)), std::string::npos) << result.err;
  }
}

TEST_F(RanksCommand, TheFirstConvertsAStepThatAnotherCannotReadAndSaysSo) {
  ASSERT_EQ(runProgram({"generate", "wake", "--size", "20x16x12", "--steps", "4", "-o", file("s")}).status,
            0);
  // Rank 1 sees another version of the last step's file.
  fs::create_directory(file("other"));
  for (const char* name : {"s.xyz", "s_0000.fun", "s_0000.nam", "s_0001.fun", "s_0001.nam", "s_0002.fun",
                           "s_0002.nam", "s_0003.fun", "s_0003.nam"})
    fs::copy_file(file(name), file("other/") + name);
  fs::resize_file(file("other/s_0003.fun"), 100);
  const std::string script = file("one_old.sh");
  writeFileAtomically(script,
                      fmt::format("#!/bin/sh\n"
                                  "cd \"{}\"\n"
                                  "[ \"$OMPI_COMM_WORLD_RANK\" = 1 ] && cd other\n"
                                  "exec \"{}\" convert s.xyz s_%04d.fun --threads 1 --overwrite -o \"{}\"\n",
                                  file(""), CURVISPLAT_PROGRAM, file("s.splats")));
  fs::permissions(script, fs::perms::owner_all);
  const ProgramResult result = runAsRanks(3, {}, script);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("warning: rank 1 could not convert step 3 (s_0003.fun)"), std::string::npos)
      << result.err;
  const ProgramResult alone = runProgram({"convert", file("s.xyz"), file("s_%04d.fun"), "--threads", "1",
                                          "--overwrite", "-o", file("alone.splats")});
  ASSERT_EQ(alone.status, 0) << alone.err;
  for (const auto& [name, bytes] : filesOf(file("alone.splats")))
    if (name != "manifest.json") {
      EXPECT_TRUE(readTextFile(file("s.splats/" + name)) == bytes) << name;
    }
}

TEST_F(RanksCommand, ThatSeeOtherFilesAreRefused) {
  fs::create_directory(file("elsewhere"));
  ASSERT_EQ(runProgram({"generate", "half-annulus", "--size", "60x32x32", "-o", file("elsewhere/g")}).status,
            0);
  ASSERT_EQ(runProgram({"convert", file("elsewhere/g.xyz"), file("elsewhere/g.fun"), "-o",
                        file("elsewhere/g.splats")})
                .status,
            0);
  for (const std::string command : {"convert g.xyz g.fun --threads 1 -o ", "render g.splats -o "}) {
    const std::string output = file(command.front() == 'c' ? "mixed.splats" : "mixed.png");
    const std::string script = file("one_elsewhere.sh");
    writeFileAtomically(script, fmt::format("#!/bin/sh\n"
                                            "cd \"{}\"\n"
                                            "[ \"$OMPI_COMM_WORLD_RANK\" = 2 ] && cd elsewhere\n"
                                            "exec \"{}\" {} \"{}\"\n",
                                            file(""), CURVISPLAT_PROGRAM, command, output));
    fs::permissions(script, fs::perms::owner_all);
    const ProgramResult result = runAsRanks(3, {}, script);
    EXPECT_EQ(result.status, 1) << result.err;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find("rank 2 of 3"), std::string::npos) << result.err;
    EXPECT_NE(result.err.find("here than at rank 0"), std::string::npos) << result.err;
    for (const auto& entry : fs::directory_iterator(file("")))
      EXPECT_FALSE(entry.path().filename().string().starts_with("mixed")) << entry.path();
  }
}

TEST_F(RanksCommand, OfSeveralThatFailOfOneCauseTheLowestReports) {
  // All ranks but the first see no cache; rank 0 fails later than they do, as it hears of it.
  const std::string script = renderScript(0, file("g.splats"), file("missing.splats"));
  const ProgramResult result = runAsRanks(4, {}, script);
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("rank 1 of 4"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("missing.splats"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(file("never.png")));
}

TEST_F(RanksCommand, AreEndedByTheOneThatFails) {
  // Rank 1 sees no cache, as on a machine where the file system is not mounted.
  const std::string script = renderScript(1, file("missing.splats"), file("g.splats"));
  const ProgramResult result = runAsRanks(3, {}, script);
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("rank 1 of 3"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("missing.splats"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(file("never.png")));
}

TEST_F(RanksCommand, ConvertTogether) {
  const Files expected = filesOf(file("g.splats"));
  for (const unsigned count : {2u, 3u}) {
    fs::remove_all(file("shared.splats"));
    const ProgramResult shared =
        runAsRanks(count, {"convert", file("g.xyz"), file("g.fun"), "-o", file("shared.splats"), "--threads",
                           "1", "--memory", "256M", "--stats", file("c.json")});
    EXPECT_EQ(shared.status, 0) << shared.err;
    EXPECT_EQ(lineCount(shared.out), 3) << shared.out;
    const Files found = filesOf(file("shared.splats"));
    ASSERT_EQ(found.size(), expected.size());
    for (const auto& [name, bytes] : expected) EXPECT_TRUE(found.at(name) == bytes) << name;
    EXPECT_EQ(nlohmann::json::parse(readTextFile(file("c.json")))["ranks"], count);
  }
  for (const auto& entry : fs::directory_iterator(folder_->path()))
    EXPECT_EQ(entry.path().filename().string().find("shared.splats."), std::string::npos) << entry.path();
}

TEST_F(RanksCommand, ConvertASeriesTogether) {
  ASSERT_EQ(runProgram({"generate", "wake", "--size", "40x30x16", "--steps", "7", "-o", file("s")}).status,
            0);
  std::vector<std::string> words{"convert", file("s.xyz"), file("s_%04d.fun"), "--threads", "1", "-o"};
  const auto to = [&](const std::string& name, std::vector<std::string> more = {}) {
    more.insert(more.begin(), words.begin(), words.end());
    more.insert(more.begin() + static_cast<std::ptrdiff_t>(words.size()), file(name));
    return more;
  };
  ASSERT_EQ(runProgram(to("s1.splats")).status, 0);
  const Files expected = filesOf(file("s1.splats"));
  const ProgramResult shared = runAsRanks(2, to("s2.splats", {"--stats", file("s.json")}));
  EXPECT_EQ(shared.status, 0) << shared.err;
  EXPECT_EQ(lineCount(shared.out), 3) << shared.out;
  EXPECT_TRUE(filesOf(file("s2.splats")) == expected);
  const auto json = nlohmann::json::parse(readTextFile(file("s.json")));
  EXPECT_EQ(json["ranks"], 2);
  EXPECT_EQ(json["each_step"].size(), 7u);

  // Parts by processes that know nothing of each other; the last one has nothing to do.
  for (const char* part : {"2/4", "4/4", "1/4"}) {
    const ProgramResult made = runProgram(to("s3.splats", {"--part", part, "--stats", file("p.json")}));
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_EQ(lineCount(made.out), 1) << made.out;
    const auto numbers = nlohmann::json::parse(readTextFile(file("p.json")));
    EXPECT_EQ(numbers["each_step"].size(), numbers["converted"]);
    fs::remove(file("p.json"));
  }
  const std::vector<std::string> join{"convert", "--join", file("s3.splats.parts"), "-o", file("s3.splats")};
  const ProgramResult early = runProgram(join);
  EXPECT_EQ(early.status, 1);
  EXPECT_EQ(lineCount(early.err), 1) << early.err;
  EXPECT_NE(early.err.find("part 3 of 4 is missing"), std::string::npos) << early.err;
  EXPECT_EQ(runProgram(to("s3.splats", {"--part", "3/4"})).status, 0);
  const ProgramResult joined = runProgram(join);
  EXPECT_EQ(joined.status, 0) << joined.err;
  EXPECT_TRUE(filesOf(file("s3.splats")) == expected);
  for (const std::vector<std::string>& wrong :
       {to("w.splats", {"--part", "5/4"}),
        to("w.splats", {"--part", "1/2", "--keep-going"}),
        to("w.splats", {"--part", "1/2", "--dry-run"}),
        {"convert", "--join", file("s3.splats.parts"), "-o", file("w.splats"), "--resume"}}) {
    const ProgramResult refused = runProgram(wrong);
    EXPECT_EQ(refused.status, 2);
    EXPECT_EQ(lineCount(refused.err), 1) << refused.err;
  }
  EXPECT_FALSE(fs::exists(file("w.splats.parts")));
}

TEST_F(RanksCommand, AddScalarsTogether) {
  const auto adding = [](const std::string& cache, std::vector<std::string> more = {}) {
    std::vector<std::string> words{
        "convert",   file("g.xyz"), file("g.fun"), "--add-scalar", "volume,jacobian", "--to", file(cache),
        "--threads", "1",           "--memory",    "256M"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  fs::copy(file("g.splats"), file("one.splats"));
  ASSERT_EQ(runProgram(adding("one.splats")).status, 0);
  const Files expected = filesOf(file("one.splats"));
  for (const unsigned count : {2u, 3u}) {
    fs::remove_all(file("added.splats"));
    fs::copy(file("g.splats"), file("added.splats"));
    const ProgramResult shared = runAsRanks(count, adding("added.splats", {"--stats", file("a.json")}));
    EXPECT_EQ(shared.status, 0) << shared.err;
    EXPECT_EQ(lineCount(shared.out), 2) << shared.out;  // of rank 0 alone
    EXPECT_TRUE(filesOf(file("added.splats")) == expected);
    EXPECT_EQ(nlohmann::json::parse(readTextFile(file("a.json")))["ranks"], count);
  }
  const ProgramResult again = runAsRanks(2, adding("added.splats"));
  EXPECT_EQ(again.status, 2);
  EXPECT_EQ(lineCount(again.err), 1) << again.err;
  EXPECT_NE(again.err.find("already has a scalar"), std::string::npos) << again.err;
  EXPECT_TRUE(filesOf(file("added.splats")) == expected);
  for (const auto& entry : fs::directory_iterator(folder_->path()))
    EXPECT_EQ(entry.path().filename().string().find("added.splats."), std::string::npos) << entry.path();
}

TEST_F(RanksCommand, LeaveTheCacheWhereOneFailsInAnAddition) {
  fs::copy(file("g.splats"), file("kept.splats"));
  const Files before = filesOf(file("kept.splats"));
  // Rank 1 has no grid, or a full disk.
  for (const char* const fault : {"grid=missing.xyz", "ulimit -f 100"}) {
    const std::string script = file("one_fails.sh");
    writeFileAtomically(
        script, fmt::format("#!/bin/bash\n"
                            "grid=\"{}\"\n"
                            "[ \"$OMPI_COMM_WORLD_RANK\" = 1 ] && {}\n"
                            "exec \"{}\" convert \"$grid\" \"{}\" --add-scalar volume --to \"{}\"\n",
                            file("g.xyz"), fault, CURVISPLAT_PROGRAM, file("g.fun"), file("kept.splats")));
    fs::permissions(script, fs::perms::owner_all);
    const ProgramResult result = runAsRanks(3, {}, script);
    EXPECT_EQ(result.status, 1) << fault;
    EXPECT_EQ(lineCount(result.err), 1) << result.err;
    EXPECT_NE(result.err.find("rank 1 of 3"), std::string::npos) << result.err;
    EXPECT_TRUE(filesOf(file("kept.splats")) == before) << fault;
    for (const auto& entry : fs::directory_iterator(folder_->path()))
      EXPECT_EQ(entry.path().filename().string().find("kept.splats."), std::string::npos) << entry.path();
  }
}

TEST_F(RanksCommand, LeaveNothingWhereOneFailsInAConversion) {
  // Rank 1 has no grid.
  const std::string script = file("one_without.sh");
  writeFileAtomically(script,
                      fmt::format("#!/bin/sh\n"
                                  "grid=\"{0}\"\n"
                                  "[ \"$OMPI_COMM_WORLD_RANK\" = 1 ] && grid=\"{0}.missing\"\n"
                                  "exec \"{2}\" convert \"$grid\" \"{1}\" -o \"{3}\"\n",
                                  file("g.xyz"), file("g.fun"), CURVISPLAT_PROGRAM, file("never.splats")));
  fs::permissions(script, fs::perms::owner_all);
  const ProgramResult result = runAsRanks(2, {}, script);
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("rank 1 of 2"), std::string::npos) << result.err;
  for (const auto& entry : fs::directory_iterator(folder_->path()))
    EXPECT_EQ(entry.path().filename().string().find("never"), std::string::npos) << entry.path();
}

TEST_F(RanksCommand, NameTheRankWhoseDiskIsFull) {
  const std::string script = file("one_full.sh");
  writeFileAtomically(script,
                      fmt::format("#!/bin/bash\n"
                                  "[ \"$OMPI_COMM_WORLD_RANK\" = 1 ] && ulimit -f 100\n"
                                  "exec \"{}\" convert \"{}\" \"{}\" -o \"{}\"\n",
                                  CURVISPLAT_PROGRAM, file("g.xyz"), file("g.fun"), file("never.splats")));
  fs::permissions(script, fs::perms::owner_all);
  const ProgramResult result = runAsRanks(3, {}, script);
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(lineCount(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("rank 1 of 3"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("File too large"), std::string::npos) << result.err;
  for (const auto& entry : fs::directory_iterator(folder_->path()))
    EXPECT_EQ(entry.path().filename().string().find("never.splats"), std::string::npos) << entry.path();
}

TEST_F(RanksCommand, AreSimulatedFromTheIndex) {
  const ProgramResult result = runProgram({"bench", file("g.splats"), "--ranks", "1,2,16,1024", "--size",
                                           "640x480", "--json", file("b.json"), "--plot", file("plots")});
  EXPECT_EQ(result.status, 0) << result.err;
  const auto counts = nlohmann::json::parse(readTextFile(file("b.json")))["ranks"]["counts"];
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
  const ProgramResult wrong = runProgram({"bench", file("g.splats"), "--ranks", "0"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_EQ(lineCount(wrong.err), 1) << wrong.err;
}

TEST_F(RanksCommand, ASingleOneNeedsNoMpi) {
  const ProgramResult alone = runAsRanks(1, renderTo("alone.exr"));
  EXPECT_EQ(alone.status, 0) << alone.err;
  ASSERT_EQ(runProgram(renderTo("one.exr")).status, 0);
  expectSameFile("one.exr", "alone.exr");
}

}  // namespace
}  // namespace curvisplat
