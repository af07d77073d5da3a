// Series converted by several ranks, and in parts: the cache has the bytes of one process's.
#include "preprocess/addition/shared_series.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "preprocess/addition/join_series.h"
#include "preprocess/addition/series_steps.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/cache_verify.h"
#include "tests/series/step_series.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

Conversion convertBy(unsigned count, const SeriesInput& input, const SeriesOptions& options) {
  Conversion first;
  runRanks(count, [&](Ranks& ranks) {
    SeriesOptions of_rank = options;
    of_rank.convert.ranks = &ranks;
    of_rank.convert.threads = 1;
    const Conversion run = convertQuietly(input, of_rank);
    if (ranks.isFirst()) first = run;
  });
  return first;
}

/// A grid that stays, one that moves at each step, one that moves now and then and comes back, and one that leaves for a
/// step, so that groups begin elsewhere after it.
const std::vector<StepKind> kSteady = steadyGrid(10), kMoving{{0, 0}, {1, 1}, {2, 2}, {3, 3}, {4, 4}},
                            kNowAndThen{{0},      {1},    {2, 0.5}, {3, 0.5}, {4, 0.5}, {5, 0.5},
                                        {6, 0.5}, {7, 1}, {8},      {9},      {10}},
                            kOnceAway{{0}, {1}, {2, 0.5}, {3}, {4}, {5}, {6}};

TEST(SharedSeries, HasTheBytesOfOneProcess) {
  // 7 ranks are more than there are groups.
  const auto of_steady = faults::isWholeSweep() ? std::vector<unsigned>{2, 7, 16} : std::vector<unsigned>{7};
  const auto of_others = faults::isWholeSweep() ? std::vector<unsigned>{2, 4} : std::vector<unsigned>{4};
  const std::pair<std::vector<StepKind>, std::vector<unsigned>> cases[] = {
      {kSteady, of_steady}, {kMoving, {3}}, {kNowAndThen, of_others}, {kOnceAway, {2}}};
  for (const auto& [kinds, counts] : cases) {
    const TemporaryFolder folder;
    const Conversion one = convertQuietly(inputOf(kinds), optionsFor(folder / "one.splats"));
    const auto wanted = allFilesOf(folder / "one.splats");
    for (const unsigned count : counts) {
      SCOPED_TRACE(fmt::format("{} steps, {} ranks", kinds.size(), count));
      SeriesOptions options = optionsFor(folder / "shared.splats");
      options.convert.overwrite = true;
      const Conversion shared = convertBy(count, inputOf(kinds), options);
      EXPECT_TRUE(allFilesOf(folder / "shared.splats") == wanted);
      EXPECT_EQ(shared.report.converted, kinds.size());
      EXPECT_EQ(shared.report.new_geometries, one.report.new_geometries);
      EXPECT_EQ(entriesOf(folder.path()), 2u) << "something is left";
    }
  }
}

TEST(SharedSeries, AddsStepsAndResumes) {
  const TemporaryFolder folder;
  convertQuietly(inputOf(kSteady), optionsFor(folder / "one.splats"));
  const auto wanted = allFilesOf(folder / "one.splats");
  for (const size_t before : {1u, 2u, 6u}) {
    if (before == 2 && !faults::isWholeSweep()) continue;
    SCOPED_TRACE(before);
    const fs::path cache = folder / "more.splats";
    fs::remove_all(cache);
    convertQuietly(inputOf({kSteady.begin(), kSteady.begin() + static_cast<std::ptrdiff_t>(before)}),
                   optionsFor(cache));
    SeriesOptions adding = optionsFor(cache);
    if (before % 2 == 0) {
      adding.convert.resume = true;
      convertBy(3, inputOf(kSteady), adding);
    } else {
      adding.add = true;
      convertBy(3, inputOf({kSteady.begin() + static_cast<std::ptrdiff_t>(before), kSteady.end()}), adding);
    }
    EXPECT_TRUE(allFilesOf(cache) == wanted);
  }
}

TEST(SharedSeries, OneProcessRemovesWhatKilledRanksHaveLeft) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats", left = folder / "a.splats.ranks.partial";
  convertQuietly(inputOf({kSteady[0], kSteady[1]}), optionsFor(cache));
  {
    const PartialFolder made(folder / "a.splats.ranks", false);
    fs::create_directory(left / "rank1.splats");
    fs::copy(left, folder / "kept", fs::copy_options::recursive);
  }
  fs::rename(folder / "kept", left);
  SeriesOptions resuming = optionsFor(cache);
  resuming.convert.resume = true;
  {
    const PartialFolder running(folder / "a.splats.ranks", false);
    EXPECT_THROW(convertQuietly(inputOf(kSteady), resuming), Error);
    fs::copy(left, folder / "kept", fs::copy_options::recursive);
  }
  fs::rename(folder / "kept", left);
  convertQuietly(inputOf(kSteady), resuming);
  EXPECT_FALSE(fs::exists(left));
  EXPECT_EQ(CacheReader(cache).series().steps.size(), kSteady.size());
}

TEST(SharedSeries, LeavesOutWhatDoesNotFitOrNamesIt) {
  std::vector<StepKind> kinds = kSteady;
  kinds[5].lacks_scalar = kinds[6].other_blocks = true;
  kinds[9].time = 3;
  const TemporaryFolder folder;
  SeriesOptions options = optionsFor(folder / "one.splats");
  options.keep_going = true;
  const Conversion one = convertQuietly(inputOf(kinds), options);
  ASSERT_EQ(one.left_out.size(), 3u);
  options.convert.output = folder / "shared.splats";
  const Conversion shared = convertBy(3, inputOf(kinds), options);
  ASSERT_EQ(shared.left_out.size(), one.left_out.size());
  for (size_t n = 0; n < one.left_out.size(); ++n)
    EXPECT_EQ(shared.left_out[n].substr(0, 30), one.left_out[n].substr(0, 30));
  EXPECT_TRUE(allFilesOf(folder / "shared.splats") == allFilesOf(folder / "one.splats"));

  expectError([&] { convertBy(3, inputOf(kinds), optionsFor(folder / "refused.splats")); },
              {"step 5 (file 5)"});
  EXPECT_EQ(CacheReader(folder / "refused.splats").series().steps.size(), 5u);
  EXPECT_EQ(entriesOf(folder.path()), 3u) << "something is left";
}

TEST(SharedSeries, LeavesOutStepsBeforeTheFirstAndOnResuming) {
  std::vector<StepKind> kinds = steadyGrid(9);
  kinds[2].lacks_scalar = true;
  SeriesInput input = inputOf(kinds);
  input.open = [open = input.open](uint64_t step) {
    if (step == 0) throw Error("broken");
    return open(step);
  };
  const TemporaryFolder folder;
  SeriesOptions options = optionsFor(folder / "one.splats");
  options.keep_going = true;
  convertQuietly(input, options);
  const auto wanted = allFilesOf(folder / "one.splats");
  for (const uint64_t before : {0u, 4u}) {
    SCOPED_TRACE(before);
    options.convert.output = folder / "shared.splats";
    fs::remove_all(options.convert.output);
    if (before > 0) {
      SeriesInput beginning = input;
      beginning.count = before;
      convertQuietly(beginning, options);
      options.convert.resume = true;
    }
    const Conversion shared = convertBy(3, input, options);
    EXPECT_EQ(shared.left_out.size(), 2u);
    EXPECT_TRUE(allFilesOf(options.convert.output) == wanted);
  }
  options.keep_going = false;
  EXPECT_THROW(convertBy(3, input, options), Error);
}

TEST(SharedSeries, CanBeInterruptedInAnyRound) {
  const TemporaryFolder folder;
  convertQuietly(inputOf(kSteady), optionsFor(folder / "one.splats"));
  const auto wanted = allFilesOf(folder / "one.splats");
  for (const uint64_t stop : {1u, 5u}) {
    if (stop == 1 && !faults::isWholeSweep()) continue;
    SCOPED_TRACE(stop);
    const fs::path cache = folder / "stopped.splats";
    SeriesInput interrupted = inputOf(kSteady);
    interrupted.open = [&](uint64_t step) -> std::unique_ptr<DataSource> {
      if (step == stop) throw Interrupted(SIGINT, "stopped");
      return std::make_unique<StepSource>(kSteady[step]);
    };
    // Interrupted, or what another rank says that finds the common folder removed before it hears of it.
    EXPECT_ANY_THROW(convertBy(3, interrupted, optionsFor(cache)));
    EXPECT_EQ(entriesOf(folder.path()), 2u) << "something is left";
    SeriesOptions options = optionsFor(cache);
    options.convert.resume = true;
    convertBy(2, inputOf(kSteady), options);
    EXPECT_TRUE(allFilesOf(cache) == wanted);
    fs::remove_all(cache);
  }
}

/// Expects what `work` throws on a disk that is full from each `stride`-th write on; until it is not full any
/// more.
void expectGivenFoldersOnFullDisks(const fs::path& given, int64_t stride, const std::function<void()>& work) {
  int64_t failures = 0;
  for (int64_t at = 0;; at += stride) {
    SCOPED_TRACE(at);
    ASSERT_LT(at, 100'000);
    faults::FaultySystemCalls full;
    full.is_unsynced = true;
    full.fail_write_at = at;
    const std::string message = errorOf([&] {
      const ScopedSystemCalls faulty(full);
      work();
    });
    if (message.empty()) break;
    // A rank may also find the common folder removed before it hears that another one has failed.
    if (message.find("No space left on device") == std::string::npos) continue;
    ++failures;
    EXPECT_FALSE(faults::namesTemporaryFile(message)) << message;
    expectSays(message, given.string());
    expectSays(message, ": no room for ");
  }
  EXPECT_GE(failures, 3);
}

TEST(SharedSeries, NamesTheFolderOfTheOutputIfTheDiskIsFull) {
  const TemporaryFolder folder;
  SeriesOptions options = optionsFor(folder / "a.splats");
  options.convert.overwrite = true;
  for (const unsigned ranks : {1u, 3u})
    expectGivenFoldersOnFullDisks(folder.path(), faults::isWholeSweep() ? 29 : 113,
                                  [&] { convertBy(ranks, inputOf(kMoving), options); });
}

TEST(SharedSeries, RemovesOnlyItsOwnTemporaryFiles) {
  const TemporaryFolder folder;
  const std::vector<StepKind> kinds = steadyGrid(5);
  convertQuietly(inputOf(kinds), optionsFor(folder / "one.splats"));
  fs::create_directory(folder / "other");
  const fs::path cache = folder / "w.splats";
  const fs::path others[] = {folder / "w.splats.ranks_old", folder / "w.splats.rank1.77.0",
                             folder / (scratchNameOfRanks(folder / "other" / "w.splats") + "1.77.0"),
                             folder / (scratchNameOfRanks(cache) + "1.77.0.kept")};
  const fs::path abandoned = folder / (scratchNameOfRanks(cache) + "1.77.0");
  for (const fs::path& path : others) fs::create_directory(path);
  fs::create_directory(abandoned);
  SeriesOptions options = optionsFor(cache);
  options.convert.temporary_folder = folder.path();  // the output's folder
  convertBy(3, inputOf(kinds), options);
  EXPECT_TRUE(allFilesOf(cache) == allFilesOf(folder / "one.splats"));
  for (const fs::path& path : others) EXPECT_TRUE(fs::exists(path)) << path;
  EXPECT_FALSE(fs::exists(abandoned));
  EXPECT_EQ(entriesOf(folder.path()), 2u + 1u + std::size(others)) << "something is left";
}

TEST(DealSteps, GivesEachRankAGroup) {
  const auto ends = [](const std::vector<StepSpan>& ranges) {
    std::vector<uint64_t> numbers;
    for (const StepSpan& range : ranges) numbers.push_back(range.end);
    return numbers;
  };
  EXPECT_EQ(ends(dealSteps(1, 100, 1, 4)), (std::vector<uint64_t>{3, 6, 9, 12}));
  EXPECT_EQ(ends(dealSteps(3, 100, 0, 2)), (std::vector<uint64_t>{6, 9}));
  EXPECT_EQ(ends(dealSteps(1, 5, 1, 4)), (std::vector<uint64_t>{3, 5, 5, 5}));
}

// ------------------------------------------------------------------------------------------------ parts

/// Converts part `index` of `count` as `convert --part` does.
void convertPart(const fs::path& output, const std::vector<StepKind>& kinds, const SeriesPart& part,
                 const std::function<void(SeriesInput&, SeriesOptions&)>& change = {}) {
  const std::vector<uint64_t> places = placesOfPart(part, kinds.size());
  const fs::path folder = partsFolder(output);
  makePartsFolder(folder);
  std::vector<StepOrigin> origins;
  if (!places.empty()) {
    std::vector<StepKind> own;
    for (const uint64_t place : places) own.push_back(kinds[place]);
    SeriesInput input = inputOf(own);
    input.places = places;
    SeriesOptions options = optionsFor(partCache(folder, part));
    options.to_part = part.index > 0;
    options.before_change = [&] { removePartRecord(folder, part); };
    if (change) change(input, options);
    origins = convertQuietly(input, options).report.origins;
  }
  writePartRecord(folder, part, kinds.size(), origins);
}

TEST(SeriesParts, AreJoinedToTheBytesOfOneProcess) {
  for (const auto& kinds : {kSteady, kMoving}) {
    const TemporaryFolder folder;
    convertQuietly(inputOf(kinds), optionsFor(folder / "one.splats"));
    const auto wanted = allFilesOf(folder / "one.splats");
    for (const uint64_t count : {1u, 3u, 16u}) {
      if ((count == 3) != (kinds.size() == kSteady.size()) && !faults::isWholeSweep()) continue;
      SCOPED_TRACE(fmt::format("{} steps, {} parts", kinds.size(), count));
      const fs::path output = folder / "joined.splats";
      for (uint64_t index = count; index-- > 0;) convertPart(output, kinds, {index, count});
      Progress progress;
      const auto parts = allFilesOf(partsFolder(output));
      const JoinReport report = joinParts({partsFolder(output), output, true}, progress);
      EXPECT_EQ(report.steps, kinds.size());
      EXPECT_TRUE(allFilesOf(output) == wanted);
      EXPECT_TRUE(allFilesOf(partsFolder(output)) == parts) << "the parts have changed";
      for (const std::string& finding : verifyCache(CacheReader(output)).findings) ADD_FAILURE() << finding;
      fs::remove_all(partsFolder(output));
    }
    EXPECT_EQ(entriesOf(folder.path()), 2u) << "something is left";
  }
}

TEST(SeriesParts, ThatCannotBeJoinedAreRefused) {
  const TemporaryFolder folder;
  const fs::path output = folder / "a.splats";
  Progress progress;
  const auto refusal = [&] {
    return errorOf([&] { joinParts({partsFolder(output), output, false}, progress); });
  };
  convertPart(output, kNowAndThen, {0, 3});
  convertPart(output, kNowAndThen, {2, 3});
  expectSays(refusal(), "part 2 of 3 is missing");
  convertPart(output, kNowAndThen, {1, 3});
  expectSays(refusal(), "cannot be joined");
  EXPECT_FALSE(fs::exists(output));
  fs::remove_all(partsFolder(output));
  for (const uint64_t index : {0u, 1u}) convertPart(output, kOnceAway, {index, 2});
  expectSays(refusal(), "step 6 cannot be joined");
  convertPart(output, kOnceAway, {0, 3});
  expectSays(refusal(), "parts of 2 and parts of 3");
  EXPECT_EQ(entriesOf(folder.path()), 1u) << "something is left";
}

TEST(SeriesParts, OfOtherOptionsAreRefused) {
  const TemporaryFolder folder;
  const fs::path output = folder / "a.splats";
  using Change = std::function<void(SeriesInput&, SeriesOptions&)>;
  const auto scalars = [](std::vector<uint32_t> chosen) {
    return Change([chosen](SeriesInput& input, SeriesOptions&) {
      input.scalars = [chosen](const GridDescription&) { return chosen; };
    });
  };
  const std::pair<Change, std::string> cases[] = {
      {scalars({1, 0}), "set of scalars"},
      {scalars({0}), "set of scalars"},
      {[](SeriesInput&, SeriesOptions& options) { options.convert.precision = ValuePrecision::kFine; },
       "--value-precision"},
      {[](SeriesInput&, SeriesOptions& options) { options.convert.surfaces = false; }, "first step"},
      {[](SeriesInput& input, SeriesOptions&) {
         auto open = input.open;
         input.open = [open](uint64_t step) {
           return step == 0 ? std::make_unique<StepSource>(StepKind{-1}) : open(step);
         };
       },
       "first step"}};
  convertPart(output, kSteady, {0, 2});
  for (const auto& [change, words] : cases) {
    fs::remove_all(partCache(partsFolder(output), {1, 2}));
    convertPart(output, kSteady, {1, 2}, change);
    SCOPED_TRACE(words);
    expectError(
        [&] {
          Progress progress;
          joinParts({partsFolder(output), output, true}, progress);
        },
        {"part 2 was not converted as part 1 was", words});
    EXPECT_FALSE(fs::exists(output));
  }
}

/// A file system that cannot exchange names, so that a manifest that could not be synced stays.
class WithoutExchange : public faults::FaultySystemCalls {
 public:
  int exchange(const char*, const char*) override {
    errno = EINVAL;
    return -1;
  }
};

TEST(SeriesParts, AreWholeInTheCacheWhicheverSyncFails) {
  for (const auto& kinds : {steadyGrid(7), kMoving}) {
    const TemporaryFolder folder;
    const fs::path output = folder / "a.splats", parts = partsFolder(output);
    for (const uint64_t index : {0u, 1u}) convertPart(output, kinds, {index, 2});
    const CacheReader part(partCache(parts, {1, 2}));
    const uint64_t before = CacheReader(partCache(parts, {0, 2})).series().steps.size();
    bool not_synced = false;
    for (int64_t at = 0;; ++at) {
      ASSERT_LT(at, 100);
      fs::remove_all(output);
      fs::copy(partCache(parts, {0, 2}), output, fs::copy_options::recursive);
      WithoutExchange calls;
      calls.fail_sync_at = at;
      const std::string failure = errorOf([&] {
        const ScopedSystemCalls faulty(calls);
        const CacheLock lock(output);
        EXPECT_TRUE(takeStep(lock, {part, 1, {}, true}, Progress()));
      });
      const bool is_added = failure.empty() || failure.find("power loss") != std::string::npos;
      not_synced |= is_added && !failure.empty();
      const CacheReader cache(output);
      EXPECT_EQ(cache.series().steps.size(), before + (is_added ? 1 : 0)) << failure;
      for (const std::string& finding : verifyCache(cache).findings)
        ADD_FAILURE() << failure << ": " << finding;
      if (failure.empty()) break;
    }
    EXPECT_TRUE(not_synced);
  }
}

TEST(SeriesParts, NameTheFolderOfTheOutputIfTheDiskIsFull) {
  const TemporaryFolder folder;
  const fs::path output = folder / "a.splats";
  for (const uint64_t index : {0u, 1u}) convertPart(output, kSteady, {index, 2});
  expectGivenFoldersOnFullDisks(folder.path(), 1, [&] {
    Progress progress;
    joinParts({partsFolder(output), output, true}, progress);
  });
}

TEST(SeriesParts, CopiesOfFilesCanBeInterrupted) {
  const TemporaryFolder folder;
  const fs::path program = "/proc/self/exe";  // of another file system: no second name
  Progress progress;
  linkOrCopy(program, folder / "copy", progress);
  EXPECT_TRUE(bytesOfFile(folder / "copy") == bytesOfFile(program));
  progress.stop(SIGINT);
  EXPECT_THROW(linkOrCopy(program, folder / "copy", progress), Interrupted);
  EXPECT_FALSE(fs::exists(folder / "copy"));
}

TEST(SeriesParts, StayFinishedUnlessTheyChange) {
  const TemporaryFolder folder;
  const fs::path output = folder / "a.splats", record = partsFolder(output) / "1of1.json";
  const std::vector<StepKind> kinds = steadyGrid(2);
  convertPart(output, kinds, {0, 1});
  // Not given --overwrite; then continued with files of another time.
  EXPECT_THROW(convertPart(output, kinds, {0, 1}), Error);
  EXPECT_TRUE(fs::exists(record));
  const auto resume = [](SeriesInput&, SeriesOptions& options) { options.convert.resume = true; };
  EXPECT_THROW(convertPart(output, {{0}, {7}}, {0, 1}, resume), Error);
  EXPECT_TRUE(fs::exists(record));
  convertPart(output, kinds, {0, 1}, resume);
  EXPECT_TRUE(fs::exists(record));
  // Replaced, but not wholly.
  const auto fail = [](SeriesInput& input, SeriesOptions& options) {
    options.convert.overwrite = true;
    input.open = [open = input.open](uint64_t step) {
      if (step > 0) throw Error("broken");
      return open(step);
    };
  };
  EXPECT_THROW(convertPart(output, kinds, {0, 1}, fail), Error);
  EXPECT_FALSE(fs::exists(record));
}

TEST(SeriesParts, HaveWholeGroupsAndTheFirstStep) {
  EXPECT_EQ(placesOfPart({0, 2}, 7), (std::vector<uint64_t>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(placesOfPart({1, 2}, 7), (std::vector<uint64_t>{0, 6}));
  EXPECT_TRUE(placesOfPart({3, 4}, 4).empty());
  for (const uint64_t steps : {1u, 2u, 3u, 4u, 30u, 100u})
    for (const uint64_t count : {1u, 2u, 3u, 7u, 50u}) {
      std::vector<uint64_t> all;
      for (uint64_t index = 0; index < count; ++index)
        for (const uint64_t place : placesOfPart({index, count}, steps))
          if (index == 0 || place > 0) all.push_back(place);
      ASSERT_EQ(all.size(), steps);
      for (uint64_t n = 0; n < steps; ++n) EXPECT_EQ(all[n], n);
    }
}

}  // namespace
}  // namespace curvisplat
