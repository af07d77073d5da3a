// Interrupted conversions: whatever is left of one, it is no cache, and what goes on from it gives the same
// bytes. The process that dies is another one: see tests/programs/dying_convert.cpp.
#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <random>

#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/convert.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/formats/open/open_grid.h"
#include "preprocess/formats/plot3d/plot3d_writer.h"
#include "preprocess/scenes/scenes.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/partial_folder.h"
#include "tests/reference/function_grid.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// No test pulls the plug, and syncing takes most of the time.
class UnsyncedSystemCalls : public SystemCalls {
  int fsync(int) override { return 0; }
};

/// Stops the job at a write.
class StoppingSystemCalls : public SystemCalls {
 public:
  StoppingSystemCalls(Progress& progress, int64_t stop_at) : progress_(progress), stop_at_(stop_at) {}
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override {
    if (writes_++ == stop_at_) progress_.stop(SIGINT);
    return SystemCalls::pwrite(fd, from, count, offset);
  }

 private:
  Progress& progress_;
  const int64_t stop_at_;
  std::atomic<int64_t> writes_ = 0;
};

/// Calls at the end of a conversion: kCallsToFinish come when all bricks are written, kCallsToRemove remove
/// an old cache.
constexpr int64_t kCallsToFinish = 17, kCallsToRemove = 8;

class Resume : public ::testing::Test {
 protected:
  static constexpr uint64_t kBucketSplats = 9000;

  /// A grid, and the cache that is expected of it.
  struct Made {
    TemporaryFolder folder;
    Files expected;
  };

  Resume() : unsynced_(calls_) {
    if (!wake_) wake_ = made(SceneGridSource(makeScene("wake"), {47, 40, 36}));
    use(*wake_);
  }
  static void TearDownTestSuite() { wake_.reset(); }

  std::unique_ptr<Made> made(const GridSource& grid) {
    auto made = std::make_unique<Made>();
    Progress progress;
    writePlot3d(grid, made->folder / "in", progress);
    use(*made);
    convertNow({});
    made->expected = allFilesOf(output_);
    fs::remove_all(output_);
    return made;
  }
  void use(const Made& made) {
    grid_ = made.folder / "in.xyz";
    function_ = made.folder / "in.fun";
    OpenGridOptions options;
    options.grid = grid_;
    options.solutions = {function_};
    options.temporary_folder = folder_.path();
    source_ = openGrid(options);
    work_ = made.folder / "work";
    fs::remove_all(work_);
    fs::create_directory(work_);
    output_ = work_ / "a.splats";
    expected_ = made.expected;
  }
  /// Tries another grid than the wake.
  void setUp(const GridSource& grid) {
    other_ = made(grid);
    use(*other_);
  }

  struct Words {
    bool resume = false, overwrite = false;
    std::optional<uint64_t> bucket_splats;
  };

  ConvertOptions optionsFor(const Words& words) const {
    ConvertOptions options;
    options.output = output_;
    options.scalars = {0};
    options.title = "killed";
    options.memory_bytes = uint64_t{1} << 30;
    options.resume = words.resume;
    options.overwrite = words.overwrite;
    options.limits.bucket_splats = words.bucket_splats;
    options.surfaces = surfaces_;
    return options;
  }

  ConvertReport convertNow(const Words& words) const {
    Progress progress;
    return convert(*source_, optionsFor(words), progress);
  }

  /// Runs a conversion that is killed at a call. Its output, if it is not killed.
  std::optional<std::string> killedAt(int64_t call, std::vector<std::string> words = {"writes"}) const {
    std::vector<std::string> arguments{grid_, function_, output_, std::to_string(dying_bucket_splats_),
                                       std::to_string(call)};
    arguments.insert(arguments.end(), words.begin(), words.end());
    if (surfaces_) arguments.emplace_back("surfaces");
    const ProgramResult result = RunningProgram(arguments, CURVISPLAT_DYING_CONVERT).wait();
    if (result.status == 128 + SIGKILL) return std::nullopt;
    EXPECT_EQ(result.status, 0) << result.err;
    return result.out;
  }

  int64_t callsOfAll(const std::vector<std::string>& words) {
    const int64_t calls = std::stoll(killedAt(-1, words).value());
    fs::remove_all(output_);
    return calls;
  }

  /// Kills a conversion when about `part` of its bricks are there.
  void killInBuild(double part = 0.6) {
    if (!calls_of_all_) calls_of_all_ = callsOfAll({"writes"});
    killedAt(static_cast<int64_t>(static_cast<double>(*calls_of_all_) * part));
    ASSERT_TRUE(readJournal(partial())->splats);
    ASSERT_GT(readBrickLog(partial(), 1).size(), 2u);
  }

  fs::path partial() const { return work_ / "a.splats.partial"; }
  fs::path scratch() const { return readJournal(partial())->scratch; }

  /// Expects that the cache is there, as if nothing had happened, and nothing else.
  void expectWhole() const {
    for (const auto& entry : fs::directory_iterator(work_)) EXPECT_EQ(entry.path(), output_);
    const Files files = allFilesOf(output_);
    EXPECT_EQ(files.size(), expected_.size());
    for (const auto& [name, bytes] : expected_)
      EXPECT_TRUE(files.contains(name) && files.at(name) == bytes) << name;
  }

  /// Expects that the folder does not open as a cache, unless it has all that the cache has.
  void expectUnfinishedOrWhole(const fs::path& path) const {
    try {
      const CacheReader reader(path);
    } catch (const Error&) {
      return;
    }
    const Files files = allFilesOf(path);
    for (const auto& [name, bytes] : expected_)
      EXPECT_TRUE(files.contains(name) && files.at(name) == bytes) << path << ": " << name;
  }

  void expectRefused(const Words& words, const std::string& saying) const {
    const Files before = allFilesOf(partial());
    SCOPED_TRACE(saying);
    expectError([&] { convertNow(words); }, {saying});
    EXPECT_TRUE(allFilesOf(partial()) == before);
  }

  UnsyncedSystemCalls calls_;
  const ScopedSystemCalls unsynced_;
  const TemporaryFolder folder_;
  static inline std::unique_ptr<Made> wake_;  // made by the first test
  std::unique_ptr<Made> other_;
  fs::path grid_, function_;
  uint64_t dying_bucket_splats_ = kBucketSplats;
  bool surfaces_ = false;
  std::optional<int64_t> calls_of_all_;  // that write
  fs::path work_, output_;
  std::unique_ptr<GridSource> source_;
  Files expected_;
};

TEST_F(Resume, CompletesWhateverCallWasTheLast) {
  const std::optional<uint64_t> bucket_splats[] = {kBucketSplats, std::nullopt, 3000};
  int resumed = 0;
  int64_t call = 0;
  for (; !killedAt(call); call += faults::isWholeSweep() ? 1 : call < 12 ? 4 : 37) {
    SCOPED_TRACE(call);
    expectUnfinishedOrWhole(partial());
    expectUnfinishedOrWhole(output_);
    resumed += convertNow({true, false, bucket_splats[call % 3]}).resumed;
    expectWhole();
    if (HasFailure()) return;
    fs::remove_all(output_);
  }
  EXPECT_GT(call, 60);
  EXPECT_GT(resumed, faults::isWholeSweep() ? 30 : 1);
  expectWhole();
}

/// Bricks of a grid in one bucket are worth nothing until the topmost is there; unless the splats are
/// lost, and the new plan knows smaller cells.
TEST_F(Resume, ContinuesOrDropsTheBricksOfALargeCell) {
  dying_bucket_splats_ = 1'000'000;
  const int64_t calls = callsOfAll({"writes"});
  size_t most = 0;
  for (int64_t call = calls - kCallsToFinish - 34; call < calls - kCallsToFinish;
       call += faults::isWholeSweep() ? 2 : 13) {
    SCOPED_TRACE(call);
    killedAt(call);
    if (readJournal(partial())->splats) most = std::max(most, readBrickLog(partial(), 1).size());
    if (call % 3 == 0) fs::remove_all(scratch());
    convertNow({true, false, call % 4 < 2 ? std::optional<uint64_t>(kBucketSplats) : std::nullopt});
    expectWhole();
    if (HasFailure()) return;
    fs::remove_all(output_);
  }
  EXPECT_GT(most, 5u);
}

/// A cell of several bricks, which no division parts.
TEST_F(Resume, TakesNodesThatAllCoincide) {
  setUp(FunctionGridSource({gridBlock(50, 50, 33)}, 1, [](const GridNode& node) {
    return NodeValues{glm::dvec3(1, 2, 3), {static_cast<float>(node.i)}, false};
  }));
  const int64_t calls = callsOfAll({"writes"});
  size_t most = 0;
  for (int64_t call = calls - kCallsToFinish - 18; call < calls - kCallsToFinish - 2;
       call += faults::isWholeSweep() ? 1 : 5) {
    SCOPED_TRACE(call);
    killedAt(call);
    most = std::max(most, readBrickLog(partial(), 1).size());
    convertNow({true, false, call % 2 ? std::optional<uint64_t>(30000) : std::nullopt});
    expectWhole();
    if (HasFailure()) return;
    fs::remove_all(output_);
  }
  EXPECT_EQ(most, 2u);
}

TEST_F(Resume, ReplacesAnOldCacheAtOnce) {
  const Files old{{"manifest.json", ""}, {"geometry.bin", ""}};
  const int64_t calls = callsOfAll({"writes"});
  ConvertOptions options = optionsFor({});
  options.title = "old";
  Progress progress;
  convert(*source_, options, progress);
  fs::copy(output_, folder_ / "old.splats");
  fs::remove_all(output_);
  for (int64_t call = calls / 8; call <= calls + kCallsToRemove;
       call += call < calls - kCallsToFinish ? calls / (faults::isWholeSweep() ? 4 : 2)
               : faults::isWholeSweep()      ? 1
                                             : 10) {
    SCOPED_TRACE(call);
    fs::remove_all(output_);
    fs::copy(folder_ / "old.splats", output_);
    killedAt(call, {"writes", "overwrite"});
    const CacheReader reader(output_);  // the old one, or the new
    convertNow({true, true, std::nullopt});
    expectWhole();
    if (HasFailure()) return;
  }
}

/// Faces come after the bricks, which are all kept. The splats are removed meanwhile, and nothing is lost with them.
TEST_F(Resume, WritesFacesAnew) {
  surfaces_ = true;
  const uint64_t bricks = convertNow({false, false, std::nullopt}).bricks;
  expected_ = allFilesOf(output_);
  EXPECT_TRUE(expected_.contains("faces.bin"));
  fs::remove_all(output_);
  const int64_t calls = callsOfAll({"writes"});
  int without_splats = 0;
  for (int64_t call = calls - 50; call < calls; call += faults::isWholeSweep() ? 2 : 24) {
    SCOPED_TRACE(call);
    killedAt(call);
    const bool is_unfinished = fs::exists(partial() / "bricks.log");
    const bool has_all_bricks = is_unfinished && readBrickLog(partial(), 1).size() == bricks;
    if (has_all_bricks) fs::remove(scratch() / "splats.bin");
    const ConvertReport report = convertNow({true, false, std::nullopt});
    if (has_all_bricks) {
      EXPECT_EQ(report.resumed_bricks, bricks);
      ++without_splats;
    }
    expectWhole();
    if (HasFailure()) return;
    fs::remove_all(output_);
  }
  EXPECT_GT(without_splats, 0);
}

TEST_F(Resume, CompletesAfterBeingKilledAgainAndAgain) {
  const int64_t calls = callsOfAll({"all"});
  std::mt19937_64 random(7);
  for (int turn = 0; turn < (faults::isWholeSweep() ? 4 : 1); ++turn) {
    SCOPED_TRACE(turn);
    bool killed = true;
    for (int kill = 0; kill < 4 && killed; ++kill)
      killed = !killedAt(static_cast<int64_t>(random() % static_cast<uint64_t>(calls)), {"all", "resume"});
    if (killed) convertNow({true, false, std::nullopt});
    expectWhole();
    fs::remove_all(output_);
  }
}

TEST_F(Resume, RebuildsWhatTheDiskHasLost) {
  const auto cut = [](const fs::path& path, uint64_t left) { fs::resize_file(path, left); };
  const auto flip = [](const fs::path& path, size_t byte) {
    std::string bytes = bytesOfFile(path);
    bytes.at(byte) ^= 0x10;
    overwriteFile(path, bytes);
  };
  const std::pair<const char*, std::function<void()>> losses[] = {
      {"the end of the splats", [&] { cut(scratch() / "splats.bin", 100000); }},
      {"all of the splats", [&] { cut(scratch() / "splats.bin", 0); }},
      {"the file of splats", [&] { fs::remove(scratch() / "splats.bin"); }},
      {"the folder of splats", [&] { fs::remove_all(scratch()); }},
      {"a bit of the last splats",
       [&] { flip(scratch() / "splats.bin", fs::file_size(scratch() / "splats.bin") - 100); }},
      {"every page of the splats",
       [&] {
         const auto size = fs::file_size(scratch() / "splats.bin");
         overwriteFile(scratch() / "splats.bin", std::string(size, '\0'));
       }},
      {"the end of the geometry", [&] { cut(partial() / "geometry.bin", 5000); }},
      {"all of the geometry", [&] { fs::remove(partial() / "geometry.bin"); }},
      {"a bit of the geometry", [&] { flip(partial() / "geometry.bin", 9000); }},
      {"a bit of a variable", [&] { flip(partial() / "var.0.bin", 600); }},
      {"all of a variable", [&] { cut(partial() / "var.0.bin", 0); }},
      {"the end of the log", [&] { cut(partial() / "bricks.log", 3 * 200 + 77); }},
      {"a bit of the log", [&] { flip(partial() / "bricks.log", 2 * 200 + 150); }},
      {"the log", [&] { fs::remove(partial() / "bricks.log"); }},
      {"a bit of the journal", [&] { flip(partial() / "journal", 300); }},
      {"the end of the journal", [&] { cut(partial() / "journal", 300); }},
      {"the journal", [&] { fs::remove(partial() / "journal"); }},
  };
  killInBuild();
  const fs::path temporary = scratch(), killed = folder_ / "killed";
  ASSERT_EQ(temporary.parent_path(), work_);
  fs::copy(work_, killed, fs::copy_options::recursive);
  for (size_t n = 0; n < std::size(losses); ++n) {
    if (!faults::isTried(n, 3)) continue;  // of each file something
    const auto& [what, lose] = losses[n];
    SCOPED_TRACE(what);
    fs::remove_all(work_);
    fs::copy(killed, work_, fs::copy_options::recursive);
    lose();
    convertNow({true, false, std::nullopt});
    fs::remove_all(temporary);  // without the journal no one knows of it
    expectWhole();
  }
}

TEST_F(Resume, ReportsFinishedWork) {
  killInBuild();
  const size_t done = readBrickLog(partial(), 1).size();
  Progress progress;
  const ConvertReport report = convert(*source_, optionsFor({true, false, std::nullopt}), progress);
  EXPECT_TRUE(report.resumed);
  EXPECT_EQ(report.resumed_bricks, done);
  EXPECT_EQ(report.nodes, 47u * 40 * 36);
  EXPECT_GT(report.merged_nodes, 0u);
  EXPECT_GT(report.temporary_bytes, 61u * 65536);
  // The grid is not read again.
  std::vector<std::string> phases;
  for (const Progress::Phase& phase : progress.phases()) phases.push_back(phase.name);
  EXPECT_EQ(phases, (std::vector<std::string>{"check", "build", "finish"}));
  EXPECT_LT(progress.phases()[1].steps, 65536u);
  EXPECT_GT(progress.phases()[1].steps, 0u);
}

TEST_F(Resume, RefusesAnotherConversion) {
  killInBuild();
  expectRefused({}, "--resume");
  ConvertOptions options = optionsFor({true, false, std::nullopt});
  options.blank_value = -1;
  Progress progress;
  EXPECT_THROW(convert(*source_, options, progress), Error);
  const auto time = fs::last_write_time(function_);
  fs::last_write_time(function_, time + std::chrono::seconds(1));
  expectRefused({true, false, std::nullopt}, "in.fun");
  fs::last_write_time(function_, time);
  const ConvertReport report = convertNow({true, false, std::nullopt});
  EXPECT_TRUE(report.resumed);
  expectWhole();
}

TEST_F(Resume, BeginsAnewIfOverwritingIsAllowed) {
  killInBuild();
  const ConvertReport report = convertNow({false, true, std::nullopt});
  EXPECT_FALSE(report.resumed);
  expectWhole();
}

TEST_F(Resume, ReportsThatTheCacheIsComplete) {
  convertNow({});
  expectError([&] { convertNow({true, false, std::nullopt}); }, {"there is nothing to resume"});
  expectWhole();
}

TEST_F(Resume, WorksWithoutAnInterruptedConversion) {
  const ConvertReport report = convertNow({true, false, std::nullopt});
  EXPECT_FALSE(report.resumed);
  expectWhole();
}

TEST_F(Resume, AStoppedConversionKeepsWhatCanBeResumed) {
  faults::FaultySystemCalls counting;
  {
    const ScopedSystemCalls scope(counting);
    convertNow({false, false, kBucketSplats});
    fs::remove_all(output_);
  }
  int left = 0, removed = 0;
  for (int64_t at = 0; at < counting.writes - 12; at += faults::isWholeSweep() ? 5 : 31) {
    SCOPED_TRACE(at);
    Progress progress;
    {
      StoppingSystemCalls calls(progress, at);
      const ScopedSystemCalls scope(calls);
      EXPECT_THROW(convert(*source_, optionsFor({false, false, kBucketSplats}), progress), Interrupted);
    }
    EXPECT_FALSE(fs::exists(output_));
    const bool resumable = fs::exists(partial());
    (resumable ? left : removed) += 1;
    if (!resumable) {
      EXPECT_TRUE(fs::is_empty(work_));
    }
    EXPECT_EQ(convertNow({true, false, std::nullopt}).resumed, resumable);
    expectWhole();
    fs::remove_all(output_);
  }
  EXPECT_GT(left, faults::isWholeSweep() ? 3 : 0);
  EXPECT_GT(removed, 0);
}

TEST_F(Resume, RepeatsTheWarningOfLostValues) {
  setUp(FunctionGridSource({gridBlock(30, 20, 20)}, 2, [](const GridNode& n) {
    const float value = n.i < 3 ? std::numeric_limits<float>::quiet_NaN() : 1;
    return NodeValues{{n.i, n.j, n.k}, {static_cast<float>(n.i), value}};
  }));
  const auto convertBoth = [&](bool resume, int64_t fail_write_at) {
    Progress progress;
    ConvertOptions options = optionsFor({resume, false, 1500});
    options.scalars = {0, 1};
    faults::FaultySystemCalls full;
    full.fail_write_at = fail_write_at;
    const ScopedSystemCalls scope(full);
    const ConvertReport report = convert(*source_, options, progress);
    fs::remove_all(output_);
    return std::pair(report.warnings, full.writes.load());
  };
  const auto [warnings, writes] = convertBoth(false, -1);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THROW(convertBoth(true, writes - 10), Error);
  ASSERT_TRUE(readJournal(partial())->splats);
  EXPECT_EQ(convertBoth(true, -1).first, warnings);
}

TEST_F(Resume, KeepsWhatIsDoneOnAFullDiskIfAskedTo) {
  killInBuild();
  faults::FaultySystemCalls full;
  full.fail_write_at = 10;
  {
    const ScopedSystemCalls scope(full);
    expectError([&] { convertNow({true, false, kBucketSplats}); }, {"No space left", "--resume"});
  }
  EXPECT_TRUE(convertNow({true, false, std::nullopt}).resumed);
  expectWhole();
}

}  // namespace
}  // namespace curvisplat
