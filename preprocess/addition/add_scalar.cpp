#include "preprocess/addition/add_scalar.h"

#include <malloc.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <memory>

#include "preprocess/addition/build_values.h"
#include "preprocess/addition/cache_grid.h"
#include "preprocess/addition/conversion_order.h"
#include "preprocess/addition/value_buckets.h"
#include "preprocess/addition/value_record.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/scratch_folder.h"
#include "preprocess/splats/seams.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/paths.h"
#include "stream/cache/cache_lock.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/variable_writer.h"

namespace curvisplat {
namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// Blocks say at once whether a grid can be the cache's.
void checkBlocks(const GridDescription& grid, const CacheReader& cache) {
  const std::vector<BlockInfo>& blocks = cache.manifest().blocks;
  if (grid.blocks.size() != blocks.size())
    throw Error("{}: was made from a grid of {} blocks, and this one has {}: it is another",
                cache.path().string(), blocks.size(), grid.blocks.size());
  for (size_t n = 0; n < blocks.size(); ++n) {
    const GridBlock& found = grid.blocks[n];
    const BlockInfo& expected = blocks[n];
    if (found.ni != expected.ni || found.nj != expected.nj || found.nk != expected.nk)
      throw Error("{}: block {} of its grid has {}x{}x{} nodes, and of this one {}x{}x{}: it is another",
                  cache.path().string(), n + 1, expected.ni, expected.nj, expected.nk, found.ni, found.nj,
                  found.nk);
  }
}

void checkNames(const std::vector<std::string>& names, const CacheReader& cache) {
  std::vector<std::string> present;
  for (const VariableInfo& variable : cache.manifest().variables) present.push_back(variable.name);
  for (const std::string& name : names)
    if (std::find(present.begin(), present.end(), name) != present.end())
      throw UsageError("{}: has a scalar '{}' already; it has {}", cache.path().string(), name,
                       joined(present));
}

std::filesystem::path temporaryFolder(const AddScalarOptions& options) {
  return options.temporary_folder.empty() ? folderOf(options.cache) : options.temporary_folder;
}

/// What an addition's temporary folder is called, up to its process: for this cache alone, wherever it is.
std::string scratchName(const std::filesystem::path& cache) {
  const std::string place = std::filesystem::canonical(cache).string();
  return fmt::format("{}.add-{:016x}", cache.filename().string(),
                     checksumOf(std::as_bytes(std::span(place))));
}

/// Makes the folder, and removes those of additions that were killed: the cache is locked, so none of them
/// lives.
std::filesystem::path newScratch(const AddScalarOptions& options) {
  const std::string name = scratchName(options.cache);
  for (const auto& entry : std::filesystem::directory_iterator(temporaryFolder(options)))
    if (entry.path().filename().string().starts_with(name + ".")) removeAll(entry.path());
  return ScratchFolder::newPath(temporaryFolder(options), name);
}

/// An addition under way: what each pass leaves for the next.
class Addition {
 public:
  Addition(const GridSource& source, const AddScalarOptions& options, const MemoryPlan& plan,
           Progress& progress)
      : options_(options),
        plan_(plan),
        progress_(progress),
        lock_(options.cache),
        cache_(options.cache),
        grid_(source),
        reader_(grid_, options.scalars, options.blank_value),
        scratch_(newScratch(options), ScratchFolder::Folder::kMake) {
    for (const uint32_t scalar : options.scalars)
      report_.scalars.push_back(source.description().scalars[scalar].name);
    report_.nodes = manifest().nodes;
    report_.splats = manifest().splats;
    checkBlocks(source.description(), cache_);
    checkCentring();
    checkNames(report_.scalars, cache_);
    if (options.check_disk_space)
      checkDiskSpace(diskNeedsOfAdding(manifest().splats, options.scalars.size(),
                                       minValueRecordBytes(options.scalars.size())),
                     options.cache, temporaryFolder(options));
  }

  AddScalarReport run() {
    scan();
    pass("scatter", manifest().nodes, "nodes", &Addition::scatter);
    pass("seams", 0, "nodes", &Addition::mergeSeams);
    pass("build", manifest().splats, "splats", &Addition::build);
    pass("finish", 0, "bricks", &Addition::finish);
    progress_.end();
    return std::move(report_);
  }

 private:
  void pass(const char* name, uint64_t steps, const char* unit, void (Addition::*work)()) {
    progress_.begin(name, steps, unit);
    (this->*work)();
    // What a pass has freed goes back to the system: the next one counts on it.
    malloc_trim(0);
  }

  void scan() {
    pass("scan", manifest().nodes, "nodes", &Addition::survey);
    if (survey_.blanked.by_grid < manifest().blanked_nodes) {
      // Older scalars have blanked nodes that the grid does not: only the cache knows them.
      pass("drawn nodes", manifest().bricks, "bricks", &Addition::findDrawnNodes);
      if (manifest().splats < manifest().nodes - manifest().blanked_nodes)
        pass("merged nodes", manifest().nodes, "nodes", &Addition::findMergedNodes);
      pass("scan again", manifest().nodes, "nodes", &Addition::survey);
    }
    checkSurvey();
  }

  void survey() { survey_ = surveyGrid(reader_, plan_.slab_bytes, nullptr, progress_); }

  void findMergedNodes() {
    grid_.addMergedFaces(plan_, unlikeHalvesOf(manifest()), scratch_.path(), progress_);
  }
  void findDrawnNodes() { grid_.restrictTo(cache_, plan_, scratch_.path(), progress_); }

  void checkSurvey() const {
    const uint64_t missing = survey_.blanked.by_value + survey_.blanked.not_finite;
    if (survey_.blanked.by_grid != manifest().blanked_nodes)
      throw Error(
          "{}: leaves out {} {} of its grid, and of this one it would be {}; this grid is not the one "
          "the cache was made from, or scalars were missing at nodes where blocks meet: convert again with "
          "all scalars",
          cache_.path().string(), manifest().blanked_nodes, manifest().cells ? "cells" : "nodes",
          survey_.blanked.by_grid);
    if (missing > 0)
      throw Error(
          "{}: {} of the {} that it draws have no value of {} ({} not finite in single precision, {} with "
          "the "
          "blank value), and every splat needs one; convert again with all scalars",
          cache_.path().string(), missing, manifest().cells ? "cells" : "nodes", joined(report_.scalars),
          survey_.blanked.not_finite, survey_.blanked.by_value);
    checkRanges(survey_, grid_.description(), options_.scalars);
    if (survey_.lower != manifest().lower || survey_.upper != manifest().upper)
      throw Error(
          "{}: its grid spans ({}, {}, {}) to ({}, {}, {}), and this one ({}, {}, {}) to ({}, {}, {}): it "
          "is another",
          cache_.path().string(), manifest().lower.x, manifest().lower.y, manifest().lower.z,
          manifest().upper.x, manifest().upper.y, manifest().upper.z, survey_.lower.x, survey_.lower.y,
          survey_.lower.z, survey_.upper.x, survey_.upper.y, survey_.upper.z);
  }

  void checkCentring() const {
    const auto words = [](bool cells) { return cells ? "in cells" : "at nodes"; };
    const bool cells = reader_.centring() == Centring::kCell;
    if (cells != manifest().cells)
      throw Error("{}: its scalars stand {}, and {} {}; convert it to a cache of its own",
                  cache_.path().string(), words(manifest().cells), joined(report_.scalars), words(cells));
  }

  void scatter() {
    const size_t variables = options_.scalars.size();
    writer_ = std::make_unique<VariableWriter>(lock_, manifest(), this->variables());
    order_ = std::make_unique<ConversionOrder>(cache_);
    buckets_ = std::make_unique<ValueBuckets>(cache_.bricks(), *order_, variables, plan_.bucket_bytes);
    grouped_ = ValueLoader::grouping(buckets_->size(), plan_);
    const uint32_t numbers = (buckets_->size() + grouped_ - 1) / grouped_;
    file_ = std::make_unique<BucketFile>(scratch_.path() / "values.bin", numbers, plan_.chunkBytes(numbers));
    seams_ = std::make_unique<SeamMerger>(variables, plan_.seam_bytes, scratch_.path(),
                                          unlikeHalvesOf(manifest()));

    tbb::enumerable_thread_specific<ValueSink> sinks([this] { return newSink(); });
    streamSplats(
        reader_, nullptr, plan_.slab_bytes, [&]() -> SplatSink& { return sinks.local(); }, *seams_,
        progress_);
    for (ValueSink& sink : sinks) sink.flush();
  }

  void mergeSeams() {
    ValueSink sink = newSink();
    seams_->finish(grid_.description().coordinate_bytes,
                   [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
                     sink.add(splat, values);
                     progress_.advance(1);
                   });
    sink.flush();
    seams_.reset();
    file_->close();
    report_.temporary_bytes = file_->size();
  }

  void build() {
    const size_t variables = options_.scalars.size();
    ValueBuilder builder(cache_, *order_, *buckets_, variables, *writer_, progress_);
    ValueLoader loader(cache_, *order_, *buckets_, variables, plan_, scratch_.path());
    loader.forEach(*file_, 0, buckets_->size(), grouped_,
                   [&](LoadedValues& loaded) { builder.build(loaded); });
    file_.reset();
  }

  void finish() {
    for (const FileInfo& file : writer_->finish(grid_.description().files))
      report_.files.push_back({file.name, file.size});
  }

  ValueSink newSink() const { return {cache_, *order_, *buckets_, grouped_, *file_}; }

  std::vector<VariableInfo> variables() const {
    std::vector<VariableInfo> variables;
    for (size_t n = 0; n < options_.scalars.size(); ++n) {
      const GridScalar& scalar = grid_.description().scalars[options_.scalars[n]];
      variables.push_back({0, scalar.name, scalar.unit, survey_.ranges[n].min, survey_.ranges[n].max});
    }
    return variables;
  }

  const Manifest& manifest() const { return cache_.manifest(); }

  const AddScalarOptions& options_;
  const MemoryPlan plan_;
  Progress& progress_;
  const CacheLock lock_;  // before the cache is read
  const CacheReader cache_;
  CacheGrid grid_;
  const NodeReader reader_;
  const ScratchFolder scratch_;  // before what has files in it
  GridSurvey survey_;
  uint32_t grouped_ = 1;
  std::unique_ptr<VariableWriter> writer_;
  std::unique_ptr<ConversionOrder> order_;
  std::unique_ptr<ValueBuckets> buckets_;
  std::unique_ptr<BucketFile> file_;
  std::unique_ptr<SeamMerger> seams_;
  AddScalarReport report_;
};

}  // namespace

AddScalarReport addScalars(const GridSource& source, const AddScalarOptions& options, Progress& progress) {
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  if (options.bucket_splats) plan.limitBuckets(*options.bucket_splats, options.scalars.size());
  if (options.most_buckets) plan.most_buckets = *options.most_buckets;

  checkWritable(options.cache, "; name a splat cache that you may change");
  checkWritable(temporaryFolder(options), "; name another folder with --tmp");

  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, plan.threads);
  AddScalarReport report = Addition(source, options, plan, progress).run();
  report.threads = plan.threads;
  report.memory_bytes = plan.cap_bytes;
  return report;
}

}  // namespace curvisplat
