#include "tests/support/same_caches.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

std::string describe(const Variation& variation) {
  std::string text = fmt::format("{} ranks", variation.ranks);
  const auto add = [&](const char* name, const auto& value) {
    if (value) text += fmt::format(", {} {}", *value, name);
  };
  add("threads", variation.threads);
  add("bytes of memory", variation.memory_bytes);
  add("splats a bucket", variation.bucket_splats);
  add("bytes of slabs", variation.slab_bytes);
  add("bytes of a mesh", variation.mesh_bytes);
  add("bytes of owners", variation.owner_bytes);
  add("buckets at most", variation.most_buckets);
  return text;
}

/// Varies the options that conversions and additions have in common.
template <typename Options>
Options varied(Options options, const Variation& variation) {
  if (variation.threads) options.threads = *variation.threads;
  if (variation.memory_bytes) options.memory_bytes = *variation.memory_bytes;
  if (variation.bucket_splats) options.limits.bucket_splats = variation.bucket_splats;
  if (variation.slab_bytes) options.limits.slab_bytes = variation.slab_bytes;
  return options;
}

}  // namespace

ConvertReport converted(const DataSource& source, const ConvertOptions& options) {
  Progress progress;
  return convert(source, options, progress);
}

ConvertReport convertedByRanks(unsigned ranks, const DataSource& source, const ConvertOptions& options) {
  ConvertReport first;
  runRanks(ranks, [&](Ranks& all) {
    ConvertOptions of_rank = options;
    of_rank.ranks = &all;
    ConvertReport report = converted(source, of_rank);
    if (all.isFirst()) first = std::move(report);
  });
  return first;
}

AddScalarReport added(const DataSource& source, const AddScalarOptions& options) {
  Progress progress;
  return addScalars(source, options, progress);
}

AddScalarReport addedByRanks(unsigned ranks, const DataSource& source, const AddScalarOptions& options) {
  AddScalarReport first;
  runRanks(ranks, [&](Ranks& all) {
    AddScalarOptions of_rank = options;
    of_rank.ranks = &all;
    AddScalarReport report = added(source, of_rank);
    if (all.isFirst()) first = std::move(report);
  });
  return first;
}

void expectSameFiles(const Files& found, const Files& expected, std::initializer_list<std::string_view> but) {
  const auto is_compared = [&](const std::string& name) {
    return std::find(but.begin(), but.end(), name) == but.end();
  };
  for (const auto& [name, bytes] : expected) {
    if (!is_compared(name)) continue;
    const auto file = found.find(name);
    if (file == found.end())
      ADD_FAILURE() << name << " is missing";
    else if (file->second != bytes)
      ADD_FAILURE() << name << " has other bytes";
  }
  for (const auto& [name, bytes] : found)
    if (is_compared(name) && !expected.contains(name)) ADD_FAILURE() << name << " should not be there";
}

ConvertReport expectSameCaches(const DataSource& source, ConvertOptions options,
                               const std::vector<Variation>& variations) {
  const ConvertReport first = converted(source, options);
  const Files expected = allFilesOf(options.output);
  const size_t entries = entriesOf(options.output.parent_path());
  options.overwrite = true;
  for (const Variation& variation : variations) {
    SCOPED_TRACE(describe(variation));
    ConvertOptions other = varied(options, variation);
    if (variation.mesh_bytes) other.limits.mesh_bytes = variation.mesh_bytes;
    if (variation.owner_bytes) other.limits.owner_bytes = variation.owner_bytes;
    const ConvertReport report =
        variation.ranks > 1 ? convertedByRanks(variation.ranks, source, other) : converted(source, other);
    expectSameFiles(allFilesOf(options.output), expected);
    EXPECT_EQ(entriesOf(options.output.parent_path()), entries) << "something is left";
    EXPECT_EQ(report.nodes, first.nodes);
    EXPECT_EQ(report.splats, first.splats);
    EXPECT_EQ(report.bricks, first.bricks);
    EXPECT_EQ(report.blanked.total(), first.blanked.total());
    EXPECT_EQ(report.degenerate, first.degenerate);
    EXPECT_EQ(report.inverted, first.inverted);
    EXPECT_EQ(report.merged_nodes, first.merged_nodes);
    EXPECT_EQ(report.volume, first.volume);
  }
  return first;
}

AddScalarReport expectSameAdditions(const DataSource& source, const fs::path& first,
                                    const AddScalarOptions& adding,
                                    const std::vector<Variation>& variations) {
  const auto copy = [&] {
    fs::remove_all(adding.cache);
    fs::copy(first, adding.cache, fs::copy_options::recursive);
  };
  copy();
  const AddScalarReport one = added(source, adding);
  const Files expected = allFilesOf(adding.cache);
  const size_t entries = entriesOf(adding.cache.parent_path());
  for (const Variation& variation : variations) {
    SCOPED_TRACE(describe(variation));
    copy();
    AddScalarOptions other = varied(adding, variation);
    if (variation.most_buckets) other.limits.most_buckets = variation.most_buckets;
    const AddScalarReport report =
        variation.ranks > 1 ? addedByRanks(variation.ranks, source, other) : added(source, other);
    expectSameFiles(allFilesOf(adding.cache), expected);
    EXPECT_EQ(entriesOf(adding.cache.parent_path()), entries) << "something is left";
    EXPECT_EQ(report.scalars, one.scalars);
    EXPECT_EQ(report.splats, one.splats);
    EXPECT_EQ(report.files.size(), one.files.size());
    if (variation.ranks > 1) {
      EXPECT_GT(report.temporary_bytes, 0u);
    }
  }
  return one;
}

}  // namespace curvisplat
