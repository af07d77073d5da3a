// Series of time steps: a step must look as a cache of that step alone does, whatever came before it.
#include "preprocess/addition/convert_series.h"

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/memory_plan.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "tests/series/step_series.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

/// Expects that two readers decode to the same bits, and state the same ranges.
void expectSameCache(const CacheReader& found, const CacheReader& wanted) {
  ASSERT_EQ(found.bricks().size(), wanted.bricks().size());
  ASSERT_EQ(found.manifest().variables.size(), wanted.manifest().variables.size());
  EXPECT_EQ(found.manifest().requirements, wanted.manifest().requirements);
  EXPECT_EQ(found.manifest().steps.front().time, wanted.manifest().steps.front().time);
  for (size_t v = 0; v < wanted.manifest().variables.size(); ++v) {
    EXPECT_EQ(found.manifest().variables[v].min, wanted.manifest().variables[v].min);
    EXPECT_EQ(found.manifest().variables[v].max, wanted.manifest().variables[v].max);
  }
  SplatGeometry geometry, wanted_geometry;
  SplatVariable values, wanted_values;
  for (uint32_t brick = 0; brick < wanted.bricks().size(); ++brick) {
    found.readGeometry(brick, geometry);
    wanted.readGeometry(brick, wanted_geometry);
    ASSERT_EQ(geometry.x, wanted_geometry.x);
    ASSERT_EQ(geometry.shear21, wanted_geometry.shear21);
    ASSERT_EQ(geometry.weight, wanted_geometry.weight);
    for (size_t v = 0; v < wanted.manifest().variables.size(); ++v) {
      found.readVariable(brick, v, values);
      wanted.readVariable(brick, v, wanted_values);
      ASSERT_EQ(values.mean, wanted_values.mean) << brick;
      ASSERT_EQ(values.slope0, wanted_values.slope0) << brick;
      ASSERT_EQ(values.slope1, wanted_values.slope1) << brick;
      ASSERT_EQ(values.slope2, wanted_values.slope2) << brick;
      ASSERT_EQ(values.variance, wanted_values.variance) << brick;
      EXPECT_EQ(found.brickVariables(v)[brick].min, wanted.brickVariables(v)[brick].min);
      EXPECT_EQ(found.brickVariables(v)[brick].largest_slope, wanted.brickVariables(v)[brick].largest_slope);
    }
  }
}

/// Converts the series, and each step alone, and compares.
void expectEachAsAlone(const std::vector<StepKind>& kinds, const std::vector<uint32_t>& geometries) {
  const TemporaryFolder folder;
  convertQuietly(inputOf(kinds), optionsFor(folder / "series.splats"));
  const CacheReader series(folder / "series.splats");
  ASSERT_EQ(series.series().steps.size(), kinds.size());
  for (size_t step = 0; step < kinds.size(); ++step) {
    SCOPED_TRACE(step);
    EXPECT_EQ(series.series().steps[step].geometry, geometries[step]);
    const fs::path alone = folder / ("alone" + std::to_string(step) + ".splats");
    convertQuietly(inputOf({kinds[step]}), optionsFor(alone));
    const CacheReader wanted(alone), found = series.atStep(step);
    expectSameCache(found, wanted);
    expectSameCache(CacheReader(folder / "series.splats", step), wanted);
    for (const std::string& finding : verifyCache(found).findings) ADD_FAILURE() << finding;
  }
}

TEST(ConvertSeries, StepsOfOneGridShareItsGeometry) {
  expectEachAsAlone(steadyGrid(9), {0, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST(ConvertSeries, AMovedGridHasItsOwnGeometryAndOneThatComesBackHasNot) {
  expectEachAsAlone({{0}, {1, 0.5}, {2, 0.5}, {3, 0}, {4, 1}, {5, 0.5}, {6, 1}}, {0, 1, 1, 0, 2, 1, 2});
}

TEST(ConvertSeries, OtherBlankingIsAnotherGeometry) {
  expectEachAsAlone({{0}, {1, 0, false, false, true}, {2}}, {0, 1, 0});
}

TEST(ConvertSeries, BytesDependNeitherOnThreadsNorMemoryNorTheOrderOfAdding) {
  const std::vector<StepKind> kinds{{0}, {1}, {2, 0.5}, {3, 0.5}, {4}, {5}};
  const TemporaryFolder folder;
  convertQuietly(inputOf(kinds), optionsFor(folder / "a.splats"));
  const auto wanted = allFilesOf(folder / "a.splats");

  SeriesOptions other = optionsFor(folder / "b.splats");
  other.convert.threads = 1;
  other.convert.memory_bytes = leastMemory(2);
  other.convert.limits.bucket_splats.reset();
  convertQuietly(inputOf(kinds), other);
  EXPECT_TRUE(allFilesOf(folder / "b.splats") == wanted);

  convertQuietly(inputOf({kinds[0]}), optionsFor(folder / "c.splats"));
  for (size_t step = 1; step < kinds.size(); ++step) {
    SeriesOptions adding = optionsFor(folder / "c.splats");
    adding.add = true;
    convertQuietly(inputOf({kinds[step]}), adding);
  }
  EXPECT_TRUE(allFilesOf(folder / "c.splats") == wanted);
}

TEST(ConvertSeries, AStepThatWasConvertedAloneHasItsTime) {
  for (const bool in_header : {false, true}) {
    const std::vector<StepKind> kinds{{7, 0, false, false, false, in_header},
                                      {9, 0, false, false, false, in_header}};
    const TemporaryFolder folder;
    convertQuietly(inputOf(kinds), optionsFor(folder / "a.splats"));
    ConvertOptions alone = optionsFor(folder / "b.splats").convert;
    alone.scalars = {0, 1};
    Progress progress;
    convert(StepSource(kinds[0]), alone, progress);
    EXPECT_EQ(CacheReader(folder / "b.splats").series().steps[0].time, 7);
    SeriesOptions added = optionsFor(folder / "b.splats");
    added.add = true;
    convertQuietly(inputOf({kinds[1]}), added);
    EXPECT_TRUE(allFilesOf(folder / "b.splats") == allFilesOf(folder / "a.splats"));
  }
}

/// The text of the exception that converting throws.
std::string refusal(const std::vector<StepKind>& kinds, const SeriesOptions& options) {
  return curvisplat::errorOf([&] { convertQuietly(inputOf(kinds), options); });
}

TEST(ConvertSeries, StepsThatDoNotFitAreNamedOrLeftOut) {
  struct Case {
    StepKind kind;
    const char* words;
  };
  const Case cases[] = {{{1, 0, true}, "block 1"}, {{1, 0, false, true}, "'s1'"}, {{-1}, "not after"}};
  for (const Case& each : cases) {
    const std::vector<StepKind> kinds{{0}, each.kind, {2}};
    const TemporaryFolder folder;
    const std::string message = refusal(kinds, optionsFor(folder / "a.splats"));
    expectSays(message, "step 1 (file 1)");
    expectSays(message, each.words);
    EXPECT_EQ(CacheReader(folder / "a.splats").series().steps.size(), 1u);

    SeriesOptions options = optionsFor(folder / "b.splats");
    options.keep_going = true;
    const Conversion run = convertQuietly(inputOf(kinds), options);
    EXPECT_EQ(run.report.left_out, 1u);
    ASSERT_EQ(run.left_out.size(), 1u);
    convertQuietly(inputOf({{0}, {2}}), optionsFor(folder / "c.splats"));
    EXPECT_TRUE(allFilesOf(folder / "b.splats") == allFilesOf(folder / "c.splats"));
  }
}

TEST(ConvertSeries, AddedStepsAreCountedFromThoseOfTheCache) {
  const TemporaryFolder folder;
  SeriesOptions options = optionsFor(folder / "a.splats");
  convertQuietly(inputOf({{0}, {1}}), options);
  options.add = true;
  const auto expectStep = [&](const std::vector<StepKind>& kinds, const char* words) {
    const std::string message = refusal(kinds, options);
    expectSays(message, words);
  };
  expectStep({{2}, {3, 0, true}}, "step 3 (file 1)");
  options.convert.resume = true;  // step 2 is there
  expectStep({{2}, {3, 0, true}}, "step 3 (file 1)");
  expectStep({{3, 0, true}}, "step 3 (file 0)");
}

TEST(ConvertSeries, FailuresOfTheOutputLeaveNothingOut) {
  const TemporaryFolder folder;
  SeriesOptions options = optionsFor(folder / "a.splats");
  convertQuietly(inputOf({{0}, {1}}), options);
  for (const bool keep_going : {false, true}) {
    options.keep_going = keep_going;
    options.add = false;
    const std::string exists = refusal({{0}, {1}}, options);
    expectSays(exists, "step 0 (file 0)");
    expectSays(exists, "exists already");
    options.add = true;
    for (const StepKind& added : {StepKind{2}, StepKind{2, 0.5}}) {
      faults::FaultySystemCalls disk;
      disk.fail_write_at = 3;
      const ScopedSystemCalls in_place(disk);
      const std::string message = refusal({added, {3}}, options);
      expectSays(message, "step 2 (file 0)");
      expectSays(message, "No space left");
      EXPECT_EQ(message.find("--keep-going"), std::string::npos) << message;
    }
  }
}

TEST(ConvertSeries, ResumesAfterTheStepsThatAreDone) {
  const std::vector<StepKind> kinds{{0}, {1}, {2, 0.5}, {3, 0.5}, {4}};
  const TemporaryFolder folder;
  convertQuietly(inputOf(kinds), optionsFor(folder / "whole.splats"));
  const auto wanted = allFilesOf(folder / "whole.splats");
  for (uint64_t stop = 0; stop < kinds.size(); ++stop) {
    const fs::path output = folder / ("stopped" + std::to_string(stop) + ".splats");
    SeriesInput interrupted = inputOf(kinds);
    interrupted.open = [&](uint64_t step) -> std::unique_ptr<GridSource> {
      if (step == stop) throw Interrupted(SIGINT, "stopped");
      return std::make_unique<StepSource>(kinds[step]);
    };
    EXPECT_THROW(convertQuietly(interrupted, optionsFor(output)), Interrupted);
    if (stop > 0) {
      EXPECT_EQ(CacheReader(output).series().steps.size(), stop);
    }
    SeriesOptions options = optionsFor(output);
    options.convert.resume = true;
    const Conversion run = convertQuietly(inputOf(kinds), options);
    EXPECT_EQ(run.report.converted, kinds.size() - stop);
    EXPECT_TRUE(allFilesOf(output) == wanted) << stop;
  }
}

/// A conversion was killed before it had removed its own files, which are in the cache and in the temporary
/// folder.
TEST(ConvertSeries, ClearsAConversionKilledAtTheEndOfAStep) {
  for (const double shift : {0.0, 0.5}) {  // the second step's geometry is a conversion of its own
    const std::vector<StepKind> kinds{{0}, {1, shift}, {2, shift}};
    const TemporaryFolder folder;
    SeriesOptions options = optionsFor(folder / "a.splats");
    convertQuietly(inputOf(kinds), options);
    const auto wanted = allFilesOf(folder.path());
    fs::remove_all(options.convert.output);

    convertQuietly(inputOf({kinds[0]}), options);
    const auto leave = [&](const fs::path& cache) {
      const fs::path scratch = folder / (cache.filename().string() + ".tmp.7.0");
      fs::create_directory(scratch);
      std::ofstream(scratch / "splats.bin") << "rest";
      writeJournal(cache, {{}, scratch, std::nullopt});
    };
    leave(options.convert.output);
    if (shift != 0) {
      const fs::path geometry = options.convert.output / "geometry.1";
      fs::copy(options.convert.output, geometry);
      leave(geometry);
    }
    options.convert.resume = true;
    convertQuietly(inputOf(kinds), options);
    EXPECT_TRUE(allFilesOf(folder.path()) == wanted) << shift;
  }
}

TEST(ConvertSeries, ResumingDoesNotMixSeries) {
  const TemporaryFolder folder;
  convertQuietly(inputOf({{0}, {1}}), optionsFor(folder / "a.splats"));
  SeriesOptions options = optionsFor(folder / "a.splats");
  options.convert.resume = true;
  expectSays(refusal({{0}, {1.5}, {2}}, options), "was not made from");
}

TEST(ConvertSeries, LeftoversOfAKilledAdditionDoNotMatter) {
  const std::vector<StepKind> kinds{{0}, {1}, {2, 0.5}};
  const TemporaryFolder folder;
  convertQuietly(inputOf(kinds), optionsFor(folder / "a.splats"));
  const auto wanted = allFilesOf(folder / "a.splats");
  convertQuietly(inputOf({kinds[0], kinds[1]}), optionsFor(folder / "b.splats"));
  // A record that no manifest counts, values that no record counts, a geometry that no step has.
  std::ofstream(folder / "b.splats/steps.bin", std::ios::binary | std::ios::app) << std::string(500, 'x');
  std::ofstream(folder / "b.splats/var.0.2.bin") << "half";
  std::ofstream(folder / "b.splats/var.0.2.bin.part") << "half";
  fs::create_directory(folder / "b.splats/geometry.1");
  std::ofstream(folder / "b.splats/geometry.1/manifest.json") << "half";
  EXPECT_EQ(CacheReader(folder / "b.splats").series().steps.size(), 2u);
  SeriesOptions adding = optionsFor(folder / "b.splats");
  adding.add = true;
  convertQuietly(inputOf({kinds[2]}), adding);
  auto found = allFilesOf(folder / "b.splats");
  found.erase("var.0.2.bin");
  found.erase("var.0.2.bin.part");
  EXPECT_TRUE(found == wanted);
}

TEST(ConvertSeries, WhatAUserHasPutWhereAGeometryGoesStays) {
  for (const bool is_link : {false, true}) {
    const TemporaryFolder folder;
    convertQuietly(inputOf({{0}, {1}}), optionsFor(folder / "a.splats"));
    const fs::path mine = is_link ? folder / "elsewhere" : folder / "a.splats/geometry.1";
    fs::create_directory(mine);
    std::ofstream(mine / "results.txt") << "mine";
    if (is_link) fs::create_directory_symlink(mine, folder / "a.splats/geometry.1");
    SeriesOptions adding = optionsFor(folder / "a.splats");
    adding.add = true;
    expectError([&] { convertQuietly(inputOf({{2, 0.5}}), adding); }, {"geometry.1", "move it elsewhere"});
    EXPECT_TRUE(fs::exists(mine / "results.txt"));
    EXPECT_EQ(CacheReader(folder / "a.splats").series().steps.size(), 2u);
  }
}

TEST(ConvertSeries, AFolderNamedAsTheJournalStays) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "a.splats";
  SeriesOptions options = optionsFor(cache);
  convertQuietly(inputOf({{0}}), options);
  fs::create_directory(cache / "journal");
  std::ofstream(cache / "journal/monday.txt") << "mine";
  options.convert.overwrite = true;
  for (const size_t times : {1, 2}) {
    convertQuietly(inputOf(steadyGrid(times)), options);
    EXPECT_TRUE(fs::exists(cache / "journal.1/monday.txt"));
    EXPECT_FALSE(fs::exists(cache / "journal"));
  }
}

TEST(ConvertSeries, ASeriesRefusesFurtherScalars) {
  const TemporaryFolder folder;
  convertQuietly(inputOf(steadyGrid(2)), optionsFor(folder / "a.splats"));
  AddScalarOptions options;
  options.cache = folder / "a.splats";
  options.scalars = {0};
  Progress progress;
  expectError([&] { addScalars(StepSource({0}), options, progress); }, {"series of 2 steps"});
}

TEST(ConvertSeries, DamagedStepsAreRefused) {
  const TemporaryFolder folder;
  convertQuietly(inputOf({{0}, {1}, {2, 0.5}}), optionsFor(folder / "a.splats"));
  const std::string steps = allFilesOf(folder / "a.splats").at("steps.bin");
  for (size_t at = 0; at < steps.size(); at += 7) {
    std::string damaged = steps;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    std::ofstream(folder / "a.splats/steps.bin", std::ios::binary) << damaged;
    EXPECT_THROW(CacheReader(folder / "a.splats"), Error) << at;
  }
  std::ofstream(folder / "a.splats/steps.bin", std::ios::binary) << steps.substr(0, steps.size() - 1);
  EXPECT_THROW(CacheReader(folder / "a.splats"), Error);
  std::ofstream(folder / "a.splats/steps.bin", std::ios::binary) << steps;
  EXPECT_THROW(CacheReader(folder / "a.splats", 3), Error);
  std::ofstream(folder / "a.splats/geometry.1/manifest.json", std::ios::app) << " ";
  EXPECT_THROW(CacheReader(folder / "a.splats", 2), Error);
  EXPECT_EQ(CacheReader(folder / "a.splats", 1).step(), 1u);
}

/// A cache of this version, kept with the numbers that read_cache.py decoded from it: it must stay readable.
TEST(Series, OfAnEarlierProgramIsStillRead) {
  const fs::path kept = fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/series.splats";
  const auto expected = nlohmann::json::parse(readTextFile(fs::path(kept).replace_extension(".json")));
  const CacheReader cache(kept);
  ASSERT_EQ(cache.series().steps.size(), expected.size());
  SplatGeometry geometry;
  SplatVariable values;
  for (size_t step = 0; step < expected.size(); ++step) {
    SCOPED_TRACE(step);
    const CacheReader at_step = cache.atStep(step);
    EXPECT_TRUE(verifyCache(at_step).findings.empty());
    EXPECT_EQ(at_step.manifest().steps.front().time, expected[step]["time"].get<double>());
    EXPECT_EQ(at_step.series().steps[step].geometry, expected[step]["geometry"].get<uint32_t>());
    double means = 0, slopes = 0, x = 0;
    for (uint32_t brick = 0; brick < at_step.bricks().size(); ++brick) {
      at_step.readGeometry(brick, geometry);
      at_step.readVariable(brick, 0, values);
      for (size_t n = 0; n < values.size(); ++n) {
        means += values.mean[n];
        slopes += std::abs(values.slope0[n]) + std::abs(values.slope1[n]) + std::abs(values.slope2[n]);
        x += geometry.x[n];
      }
    }
    EXPECT_NEAR(means, expected[step]["means"].get<double>(), 1e-3);
    EXPECT_NEAR(slopes, expected[step]["slopes"].get<double>(), 1e-3);
    EXPECT_NEAR(x, expected[step]["x"].get<double>(), 1e-2);
  }
}

TEST(Series, SaysThatItsCacheHasBeenReplacedOrRemoved) {
  const TemporaryFolder folder;
  const fs::path kept = fs::path(CURVISPLAT_TEST_DATA) / "caches/version_2/series.splats",
                 cache = folder / "a.splats";
  fs::copy(kept, cache, fs::copy_options::recursive);
  const CacheReader reader(cache);
  const auto refusal = [&] { return errorOf([&] { reader.at({1}); }); };
  EXPECT_EQ(refusal(), "");
  const std::string replaced =
      cache.string() + ": has been replaced or removed since it was opened; open it again";
  fs::rename(cache, folder / "earlier");
  EXPECT_TRUE(refusal().starts_with(replaced)) << refusal();
  fs::create_directory(cache);
  EXPECT_TRUE(refusal().starts_with(replaced)) << refusal();
}

TEST(Series, NearestStepInTime) {
  Series series;
  for (const double time : {0.0, 1.0, 4.0}) series.add({time, 0, 0, 0, {}});
  EXPECT_EQ(series.nearest(-5), 0u);
  EXPECT_EQ(series.nearest(0.4), 0u);
  EXPECT_EQ(series.nearest(0.5), 0u);
  EXPECT_EQ(series.nearest(0.6), 1u);
  EXPECT_EQ(series.nearest(3.9), 2u);
  EXPECT_EQ(series.nearest(100), 2u);
}

}  // namespace
}  // namespace curvisplat
