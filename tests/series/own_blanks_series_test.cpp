// Series whose scalars have values at different samples: each set of them is a series like that of its scalars alone.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "preprocess/addition/join_series.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_verify.h"
#include "tests/series/step_series.h"
#include "tests/support/expect_error.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

/// s0 and s3 have values everywhere, s1 where i >= 5; s2 where j >= 4, or 6 from step `changes` on, and at no sample of step `none`.
struct Parts {
  size_t steps = 5;
  size_t none = 99;
  size_t changes = 3;
  size_t lacks = 99;  // from this step on there is no s2
};

class PartsSource : public FunctionStep {
 public:
  PartsSource(const Parts& parts, uint64_t step)
      : FunctionStep({{gridBlock(10, 9, 7)}, 4, [=](const GridNode& node) {
                        const auto i = static_cast<double>(node.i), j = static_cast<double>(node.j);
                        const double t = 0.1 * static_cast<double>(step);
                        const float none = std::numeric_limits<float>::quiet_NaN();
                        NodeValues values;
                        values.position = {i + 0.2 * std::sin(j), j, static_cast<double>(node.k)};
                        const bool has_s2 = step != parts.none && node.j >= (step < parts.changes ? 4u : 6u);
                        values.scalars = {static_cast<float>(std::sin(0.3 * i - t)),
                                          node.i < 5 ? none : static_cast<float>(std::cos(0.3 * j + t)),
                                          has_s2 ? static_cast<float>(i + j + t) : none,
                                          static_cast<float>(std::cos(0.2 * i + t))};
                        return values;
                      }}) {
    description_.times = {static_cast<double>(step)};
    if (step >= parts.lacks) description_.scalars[2].name = "other";
    description_.files = {"step " + std::to_string(step)};
  }
};

/// Steps from `first` on.
SeriesInput inputOfParts(const Parts& parts, uint64_t first = 0,
                         std::vector<uint32_t> scalars = {0, 1, 2, 3}) {
  SeriesInput input;
  input.count = parts.steps - first;
  input.name = [first](uint64_t step) { return "file " + std::to_string(first + step); };
  input.open = [parts, first](uint64_t step) { return std::make_unique<PartsSource>(parts, first + step); };
  input.scalars = [scalars](const GridDescription&) { return scalars; };
  return input;
}

SeriesOptions apart(const fs::path& output) {
  SeriesOptions options = optionsFor(output);
  options.convert.differing = DifferingScalars::kKeepApart;
  return options;
}

void convertSets(const Parts& parts, const fs::path& output) {
  convertQuietly(inputOfParts(parts), apart(output));
}

TEST(OwnBlanksSeries, EachSetIsASeriesOfItsScalars) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "all.splats";
  convertSets({}, cache);
  const CacheReader whole(cache);
  EXPECT_EQ(whole.allScalars(), (std::vector<std::string>{"s0", "s3", "s1", "s2"}));
  ASSERT_EQ(whole.series().steps.size(), 5u);
  const std::vector<uint32_t> scalars[] = {{0, 3}, {1}, {2}};
  for (size_t n = 0; n < std::size(scalars); ++n) {
    SCOPED_TRACE(n);
    const fs::path alone = folder / ("alone" + std::to_string(n) + ".splats");
    convertQuietly(inputOfParts({}, 0, scalars[n]), optionsFor(alone));
    const CacheReader set = n == 0 ? whole.atStep(4) : whole.atStep(4).ownBlanks(n - 1);
    EXPECT_EQ(set.step(), 4u);
    EXPECT_EQ(set.wholePath(), cache);
    const auto files = allFilesOf(set.cachePath());
    for (const auto& [name, bytes] : allFilesOf(alone)) {
      if (name.ends_with("manifest.json") || name.ends_with("steps.bin"))
        continue;  // with checksums of manifests
      ASSERT_TRUE(files.contains(name)) << name;
      EXPECT_TRUE(files.at(name) == bytes) << name;
    }
    for (const std::string& finding : verifyCache(set).findings) ADD_FAILURE() << finding;
  }
  EXPECT_EQ(CacheReader::ofScalar(cache, "s2").atStep(4).series().geometries(), 2u);
}

TEST(OwnBlanksSeries, AddsStepsResumesAndTakesUpAKilledAddition) {
  const TemporaryFolder folder;
  convertSets({}, folder / "all.splats");
  const auto wanted = allFilesOf(folder / "all.splats");
  for (const size_t before : {2u, 3u}) {
    if (before == 2 && !faults::isWholeSweep()) continue;  // added: StepsAreAddedToACacheOfOne
    SCOPED_TRACE(before);
    const fs::path cache = folder / "more.splats", more = folder / "one_more.splats";
    fs::remove_all(cache);
    fs::remove_all(more);
    convertSets({before, 99, 3, 99}, cache);
    convertSets({before + 1, 99, 3, 99}, more);
    // Killed after the first set had the step, which no reader sees.
    fs::remove_all(cache / "blanks.1");
    fs::copy(more / "blanks.1", cache / "blanks.1", fs::copy_options::recursive);
    EXPECT_EQ(CacheReader(cache).ownBlanks(0).series().steps.size(), before);
    SeriesOptions adding = apart(cache);
    adding.add = before == 2;
    adding.convert.resume = !adding.add;
    convertQuietly(inputOfParts({}, adding.add ? before : 0), adding);
    EXPECT_TRUE(allFilesOf(cache) == wanted);
  }
}

TEST(OwnBlanksSeries, StepsAreAddedToACacheOfOne) {
  const TemporaryFolder folder;
  convertSets({}, folder / "all.splats");
  const fs::path cache = folder / "more.splats";
  convertSets({1, 99, 3, 99}, cache);
  EXPECT_FALSE(CacheReader(cache).seriesManifest().hasFeature("own-blanks-steps"));
  SeriesOptions adding = apart(cache);
  adding.add = true;
  convertQuietly(inputOfParts({}, 1), adding);
  EXPECT_TRUE(allFilesOf(cache) == allFilesOf(folder / "all.splats"));
}

void expectS2EndsAfterTwo(const Parts& parts, const char* reason) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "all.splats";
  std::vector<std::string> warnings;
  Progress progress;
  convertSeries(inputOfParts(parts), apart(cache), progress, [&](const SeriesEvent& event) {
    if (event.added)
      warnings.insert(warnings.end(), event.added->warnings.begin(), event.added->warnings.end());
  });
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], fmt::format("s2: {} at this step; kept up to the step before", reason));
  const CacheReader whole(cache);
  EXPECT_EQ(whole.series().steps.size(), 5u);
  EXPECT_EQ(whole.ownBlanks(0).series().steps.size(), 5u);
  EXPECT_EQ(whole.ownBlanks(1).series().steps.size(), 2u);
  EXPECT_EQ(whole.atStep(4).ownBlanks(1).step(), 1u);
}

TEST(OwnBlanksSeries, ASetEndsWhereItHasNoValuesOrIsMissing) {
  expectS2EndsAfterTwo({5, 2, 99, 99}, "no sample has a value");
  expectS2EndsAfterTwo({5, 99, 99, 2}, "missing");
}

TEST(OwnBlanksSeries, RanksAndPartsMakeTheSameBytes) {
  for (const Parts& parts : {Parts{8, 99, 7, 99}, Parts{8, 7, 99, 99}, Parts{8, 99, 3, 99}}) {
    SCOPED_TRACE(parts.changes);
    if (parts.none == 7 && !faults::isWholeSweep()) continue;
    const TemporaryFolder folder;
    convertSets(parts, folder / "one.splats");
    const auto wanted = allFilesOf(folder / "one.splats");
    runRanks(3, [&](Ranks& ranks) {
      SeriesOptions options = apart(folder / "ranks.splats");
      options.convert.ranks = &ranks;
      options.convert.threads = 1;
      convertQuietly(inputOfParts(parts), options);
    });
    EXPECT_TRUE(allFilesOf(folder / "ranks.splats") == wanted);

    // A part whose own steps begin on a grid that came after the first step cannot be joined.
    if (parts.changes == 3) continue;
    const fs::path output = folder / "joined.splats";
    makePartsFolder(partsFolder(output));
    for (uint64_t index = 0; index < 2; ++index) {
      const SeriesPart part{index, 2};
      SeriesInput input = inputOfParts(parts);
      const std::vector<uint64_t> places = placesOfPart(part, parts.steps);
      SeriesInput own = input;
      own.count = places.size();
      own.places = places;
      own.open = [&](uint64_t step) { return input.open(places[step]); };
      SeriesOptions options = apart(partCache(partsFolder(output), part));
      options.to_part = index > 0;
      const Conversion run = convertQuietly(own, options);
      writePartRecord(partsFolder(output), part, parts.steps, run.report.origins);
    }
    Progress progress;
    joinParts({partsFolder(output), output, false}, progress);
    EXPECT_TRUE(allFilesOf(output) == wanted);
  }
}

TEST(OwnBlanksSeries, AnotherSetIsRefused) {
  const TemporaryFolder folder;
  const fs::path cache = folder / "all.splats";
  convertSets({2, 99, 3, 99}, cache);
  fs::remove_all(cache / "blanks.1");
  fs::copy(cache / "blanks.2", cache / "blanks.1", fs::copy_options::recursive);
  expectError([&] { CacheReader(cache).ownBlanks(0); }, {"blanks.1", "convert again"});
}

}  // namespace
}  // namespace curvisplat
