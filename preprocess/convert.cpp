#include "preprocess/convert.h"

#include <malloc.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <memory>

#include "preprocess/bucket_file.h"
#include "preprocess/bucket_tree.h"
#include "preprocess/build_octree.h"
#include "preprocess/counting_grid.h"
#include "preprocess/memory_plan.h"
#include "preprocess/plan_buckets.h"
#include "preprocess/preflight.h"
#include "preprocess/scan.h"
#include "preprocess/scatter.h"
#include "preprocess/scratch_folder.h"
#include "preprocess/seams.h"
#include "preprocess/splat_record.h"
#include "stream/cache_writer.h"
#include "stream/error.h"
#include "stream/file.h"
#include "stream/manifest.h"

namespace curvisplat {
namespace {

uint64_t nodesOf(const GridDescription& description) {
  uint64_t nodes = 0;
  for (const GridBlock& block : description.blocks) nodes += block.nodes();
  if (nodes >= kMaxNodes)
    throw Error("{}: has {} nodes; the most that can be converted are {}", description.format, nodes,
                kMaxNodes - 1);
  return nodes;
}

std::filesystem::path temporaryFolder(const ConvertOptions& options) {
  return options.temporary_folder.empty() ? folderOf(options.output) : options.temporary_folder;
}

/// A conversion under way: what each pass leaves for the next.
class Conversion {
 public:
  Conversion(const GridSource& source, const ConvertOptions& options, const MemoryPlan& plan,
             Progress& progress)
      : source_(source),
        options_(options),
        plan_(plan),
        progress_(progress),
        reader_(source, options.scalars, options.blank_value),
        nodes_(nodesOf(source.description())),
        scratch_(temporaryFolder(options), options.output.filename().string() + ".tmp") {}

  ConvertReport run() {
    struct Pass {
      const char* name;
      const char* unit;
      uint64_t steps;  // 0: not known
      void (Conversion::*run)();
    };
    const Pass passes[] = {
        {"scan", "nodes", nodes_, &Conversion::scan},       {"count", "nodes", nodes_, &Conversion::count},
        {"scatter", "nodes", nodes_, &Conversion::scatter}, {"seams", "nodes", 0, &Conversion::mergeSeams},
        {"build", "nodes", nodes_, &Conversion::build},     {"finish", "bricks", 0, &Conversion::finish},
    };
    for (const Pass& pass : passes) {
      progress_.begin(pass.name, pass.steps, pass.unit);
      (this->*pass.run)();
      // What a pass has freed goes back to the system: the next one counts on it.
      malloc_trim(0);
    }
    progress_.end();
    return std::move(report_);
  }

 private:
  void scan() {
    survey_ = surveyGrid(reader_, plan_.slab_bytes, progress_);
    root_ = RootCube::around(survey_.lower, survey_.upper);
    report_.nodes = survey_.nodes;
    report_.blanked = survey_.blanked;
    writer_ = std::make_unique<CacheWriter>(options_.output, options_.overwrite, root_, variables());
  }

  void count() {
    CountingGrid counts(countingLevel(nodes_), plan_.counting_bytes);
    countNodes(source_, root_, plan_.slab_bytes, counts, progress_);
    counts.close();
    const uint32_t buckets = planBuckets(counts, plan_, tree_);
    file_ = std::make_unique<BucketFile>(scratch_.path() / "splats.bin", buckets, plan_.chunkBytes(buckets));
    contents_.resize(tree_.size());
  }

  void scatter() {
    seams_ = std::make_unique<SeamMerger>(options_.scalars.size(), plan_.seam_bytes, scratch_.path());
    const ScatterCounts counts =
        scatterSplats(reader_, root_, plan_.slab_bytes, tree_, *file_, contents_, *seams_, progress_);
    report_.degenerate = counts.degenerate;
    report_.inverted = counts.inverted;
  }

  void mergeSeams() {
    report_.merged_nodes = scatterSeams(*seams_, source_.description().coordinate_bytes, root_, tree_, *file_,
                                        contents_, progress_);
    seams_.reset();
    file_->close();
    report_.temporary_bytes = file_->size();
    tree_.setContents(tree_.leavesBelow(0), contents_);
    report_.splats = tree_[0].contents.splats;
  }

  void build() {
    OctreeBuilder builder(root_, source_.description().blocks, options_.scalars.size(), plan_, tree_,
                          *writer_, scratch_.path(), progress_);
    builder.build(*file_);
    file_.reset();
  }

  void finish() {
    writer_->finish(manifest());
    writer_.reset();
    const std::filesystem::path path = options_.output / "manifest.json";
    const Manifest written = Manifest::fromJson(readTextFile(path), path);
    report_.bricks = written.bricks;
    report_.levels = written.levels;
    report_.volume = written.volume;
    for (const FileInfo& file : written.files) report_.files.push_back({file.name, file.size});
  }

  std::vector<VariableInfo> variables() const {
    std::vector<VariableInfo> variables;
    for (size_t n = 0; n < options_.scalars.size(); ++n) {
      const GridScalar& scalar = source_.description().scalars[options_.scalars[n]];
      variables.push_back(
          {static_cast<uint32_t>(n), scalar.name, scalar.unit, survey_.ranges[n].min, survey_.ranges[n].max});
    }
    return variables;
  }

  Manifest manifest() const {
    const GridDescription& description = source_.description();
    Manifest manifest;
    manifest.title = options_.title.empty() ? options_.output.filename().string() : options_.title;
    manifest.program = "curvisplat " CURVISPLAT_VERSION;
    manifest.sources = description.files;
    manifest.reader = description.format;
    if (options_.blank_value) manifest.reader += fmt::format(", blank value {}", *options_.blank_value);
    manifest.lower = survey_.lower;
    manifest.upper = survey_.upper;
    for (const GridBlock& block : description.blocks)
      manifest.blocks.push_back({block.name, block.ni, block.nj, block.nk});
    manifest.nodes = survey_.nodes;
    manifest.blanked_nodes = survey_.blanked.total();
    manifest.variables = variables();
    StepInfo step;
    for (const VariableInfo& variable : manifest.variables) step.variables.push_back(variable.number);
    manifest.steps = {step};
    return manifest;
  }

  const GridSource& source_;
  const ConvertOptions& options_;
  const MemoryPlan plan_;
  Progress& progress_;
  const NodeReader reader_;
  const uint64_t nodes_;
  const ScratchFolder scratch_;  // before what has files in it
  GridSurvey survey_;
  RootCube root_;
  BucketTree tree_;
  std::vector<CellContents> contents_;  // [node of tree_], while they are being scattered
  std::unique_ptr<BucketFile> file_;
  std::unique_ptr<SeamMerger> seams_;
  std::unique_ptr<CacheWriter> writer_;
  ConvertReport report_;
};

}  // namespace

ConvertReport convert(const GridSource& source, const ConvertOptions& options, Progress& progress) {
  const unsigned asked =
      options.threads > 0 ? options.threads : static_cast<unsigned>(tbb::info::default_concurrency());
  const uint64_t memory = options.memory_bytes > 0 ? options.memory_bytes : defaultMemory();
  MemoryPlan plan = MemoryPlan::of(memory, options.scalars.size(), asked);
  if (options.bucket_splats) plan.limitBuckets(*options.bucket_splats, options.scalars.size());

  checkOutput(options.output, options.overwrite, temporaryFolder(options));
  checkDiskSpace(diskNeeds(nodesOf(source.description()), options.scalars.size()), options.output,
                 temporaryFolder(options));

  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, plan.threads);
  ConvertReport report = Conversion(source, options, plan, progress).run();
  report.threads = plan.threads;
  report.memory_bytes = memory;
  return report;
}

}  // namespace curvisplat
