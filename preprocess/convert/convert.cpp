#include "preprocess/convert/convert.h"

#include <malloc.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <memory>
#include <span>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/build_octree.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/counting_grid.h"
#include "preprocess/convert/grid_origin.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/plan_buckets.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/scattered_splats.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/convert/splat_record.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/paths.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/manifest.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {
namespace {

uint64_t nodesOf(const SplatOrigin& origin) {
  uint64_t nodes = 0;
  for (const GridBlock& block : origin.blocks()) nodes += block.nodes();
  if (nodes >= kMaxNodes)
    throw Error("{}: has {} nodes; the most that can be converted are {}", origin.description().format, nodes,
                kMaxNodes - 1);
  return nodes;
}

std::filesystem::path temporaryFolder(const ConvertOptions& options) {
  return options.temporary_folder.empty() ? folderOf(options.output) : options.temporary_folder;
}

Unfinished unfinishedOf(const ConvertOptions& options) {
  if (options.resume) return Unfinished::kResume;
  return options.overwrite ? Unfinished::kRemove : Unfinished::kRefuse;
}

/// What a cache's manifest tells.
void reportCache(const Manifest& written, ConvertReport& report) {
  report.centring = written.cells ? Centring::kCell : Centring::kNode;
  report.nodes = written.nodes;
  report.splats = written.splats;
  report.bricks = written.bricks;
  report.levels = written.levels;
  report.volume = written.volume;
  for (const FileInfo& file : written.files) report.files.push_back({file.name, file.size});
}

/// A conversion under way: what each pass leaves for the next.
class Conversion {
 public:
  Conversion(const GridSource& source, const ConvertOptions& options, const MemoryPlan& plan,
             std::vector<ConversionFact> facts, Progress& progress)
      : options_(options),
        plan_(plan),
        progress_(progress),
        workspace_(options.output, options.overwrite, unfinishedOf(options), temporaryFolder(options),
                   std::move(facts)),
        origin_(std::make_unique<GridOrigin>(source, options.scalars, options.blank_value, plan,
                                             workspace_.scratch())),
        nodes_(nodesOf(*origin_)) {}

  ConvertReport run() {
    const Pass scatter_grid[] = {
        {"scan", "nodes", nodes_, &Conversion::scan},
        {"count", "nodes", nodes_, &Conversion::count},
        {"scatter", "nodes", nodes_, &Conversion::scatter},
        {"seams", "nodes", 0, &Conversion::mergeSeams},
    };
    const Pass take_up_splats[] = {{"check", "bricks", 0, &Conversion::takeUpSplats}};
    const Pass build_cache[] = {
        {"build", "nodes", nodes_, &Conversion::build},
    };
    checkRoom();
    if (workspace_.splats()) {
      try {
        runPasses(take_up_splats);
        runPasses(build_cache);
        return end();
      } catch (const LostBuckets&) {
        // The machine went down before all was on its disk. The bricks that are whole still count.
        forgetSplats();
      }
    }
    runPasses(scatter_grid);
    runPasses(build_cache);
    return end();
  }

  /// After run() has thrown: whether there is something to resume, which then stays.
  bool leaveForResuming() {
    if (file_) file_->leave();
    return workspace_.leaveForResuming();
  }

 private:
  struct Pass {
    const char* name;
    const char* unit;
    uint64_t steps;  // 0: not known
    void (Conversion::*run)();
  };

  void runPasses(std::span<const Pass> passes) {
    for (const Pass& pass : passes) {
      progress_.begin(pass.name, pass.steps, pass.unit);
      (this->*pass.run)();
      // What a pass has freed goes back to the system: the next one counts on it.
      malloc_trim(0);
    }
    progress_.end();
  }

  ConvertReport end() {
    const Pass faces[] = {{"faces", "nodes", nodes_, &Conversion::writeFaces}};
    const Pass finish[] = {{"finish", "bricks", 0, &Conversion::finish}};
    if (options_.surfaces) runPasses(faces);
    runPasses(finish);
    return std::move(report_);
  }

  void scan() {
    splats_.survey = origin_->survey(progress_);
    checkRanges(splats_.survey, origin_->description(), options_.scalars);
    openWriter();
    for (std::string& warning : origin_->warnings(progress_)) report_.warnings.push_back(std::move(warning));
  }

  void count() {
    CountingGrid counts(countingLevel(nodes_), plan_.counting_bytes);
    origin_->count(root_, counts, progress_);
    counts.close();
    const uint32_t buckets = planBuckets(counts, plan_, splats_.tree);
    file_ = std::make_unique<BucketFile>(workspace_.splatsFile(), buckets, plan_.chunkBytes(buckets));
    contents_.resize(splats_.tree.size());
  }

  SplatTarget target() { return {root_, &splats_.tree, file_.get(), &contents_}; }

  void scatter() { splats_.counts = scatterSplats(*origin_, target(), progress_); }

  void mergeSeams() {
    splats_.merged_nodes = scatterRest(*origin_, target(), progress_);
    file_->close();
    splats_.buckets = file_->chains();
    splats_.tree.setContents(splats_.tree.leavesBelow(0), contents_);
    workspace_.noteSplats(splats_);
  }

  /// In the place of all before: the splats of a conversion that was interrupted.
  void takeUpSplats() {
    splats_ = *workspace_.splats();
    file_ = std::make_unique<BucketFile>(workspace_.splatsFile(), splats_.buckets);
    openWriter();
  }

  void build() {
    OctreeBuilder builder(root_, origin_->blocks(), options_.scalars.size(), plan_, splats_.tree, *writer_,
                          workspace_.scratch(), progress_);
    builder.build(*file_);
  }

  void writeFaces() {
    std::vector<uint32_t> numbers;
    for (const VariableInfo& variable : variables()) numbers.push_back(variable.number);
    const FacesJob job{workspace_.partial().path() / kFacesFileName,
                       workspace_.scratch(),
                       splats_.survey.lower,
                       splats_.survey.upper,
                       options_.planes,
                       std::move(numbers),
                       plan_.slab_bytes,
                       plan_.seam_bytes};
    faces_file_ = origin_->writeFaces(job, progress_);
  }

  void finish() {
    reportCache(writer_->finish(manifest()), report_);
    writer_.reset();
    file_.reset();
    report_.blanked = splats_.survey.blanked;
    report_.degenerate = splats_.counts.degenerate;
    report_.inverted = splats_.counts.inverted;
    report_.merged_nodes = splats_.merged_nodes;
    report_.temporary_bytes = splats_.buckets.size;
    report_.resumed = workspace_.resumed();
  }

  void checkRoom() const {
    DiskNeeds needs = diskNeeds(nodes_, options_.scalars.size());
    if (workspace_.splats())
      needs.temporary_bytes = 0;
    else
      needs.temporary_bytes = std::max(needs.temporary_bytes, origin_->temporaryBytes());
    if (options_.surfaces)
      needs.temporary_bytes +=
          temporaryBytesOfFaces(origin_->blocks(), options_.planes, options_.scalars.size());
    needs.cache_bytes -= std::min(needs.cache_bytes, workspace_.bytesInPartial());
    if (options_.check_disk_space) checkDiskSpace(needs, options_.output, temporaryFolder(options_));
  }

  /// Needs the survey.
  void openWriter() {
    root_ = RootCube::around(splats_.survey.lower, splats_.survey.upper);
    if (writer_) return;
    writer_ = std::make_unique<CacheWriter>(workspace_.partial(), root_, variables(), progress_);
    report_.resumed_bricks = writer_->bricks().size();
  }

  void forgetSplats() {
    workspace_.forgetSplats();
    file_.reset();
    splats_ = {};
  }

  std::vector<VariableInfo> variables() const {
    std::vector<VariableInfo> variables;
    for (size_t n = 0; n < options_.scalars.size(); ++n) {
      const GridScalar& scalar = origin_->description().scalars[options_.scalars[n]];
      variables.push_back({static_cast<uint32_t>(n), scalar.name, scalar.unit, splats_.survey.ranges[n].min,
                           splats_.survey.ranges[n].max});
    }
    return variables;
  }

  Manifest manifest() const {
    const GridDescription& description = origin_->description();
    Manifest manifest;
    manifest.title = options_.title.empty() ? options_.output.filename().string() : options_.title;
    manifest.program = "curvisplat " CURVISPLAT_VERSION;
    manifest.sources = description.files;
    manifest.reader = description.format;
    if (options_.blank_value) manifest.reader += fmt::format(", blank value {}", *options_.blank_value);
    manifest.lower = splats_.survey.lower;
    manifest.upper = splats_.survey.upper;
    for (const GridBlock& block : origin_->blocks())
      manifest.blocks.push_back({block.name, block.ni, block.nj, block.nk});
    manifest.requirements = {kBorderFaces, kCellGrowth};
    manifest.cells = origin_->centring() == Centring::kCell;
    manifest.nodes = splats_.survey.nodes;
    manifest.blanked_nodes = splats_.survey.blanked.total();
    manifest.grid_checksum = splats_.survey.grid_checksum;
    manifest.variables = variables();
    StepInfo step;
    if (!description.times.empty()) step.time = description.times[description.time_step];
    if (options_.time) step.time = *options_.time;
    manifest.time_unit = description.time_unit;
    manifest.calendar = description.calendar;
    for (const VariableInfo& variable : manifest.variables) step.variables.push_back(variable.number);
    manifest.steps = {step};
    if (faces_file_) manifest.files.push_back(*faces_file_);
    return manifest;
  }

  const ConvertOptions& options_;
  const MemoryPlan plan_;
  Progress& progress_;
  ConversionWorkspace workspace_;  // before what has files in it
  std::unique_ptr<SplatOrigin> origin_;
  const uint64_t nodes_;
  ScatteredSplats splats_;
  RootCube root_;
  std::vector<CellContents> contents_;  // [node of the tree], while they are being scattered
  std::unique_ptr<BucketFile> file_;
  std::unique_ptr<CacheWriter> writer_;
  std::optional<FileInfo> faces_file_;
  ConvertReport report_;
};

/// Runs it. What is to be resumed stays when it is stopped, and on an Error if that is wanted.
ConvertReport runOrLeave(Conversion& conversion, const ConvertOptions& options) {
  try {
    return conversion.run();
  } catch (const Interrupted& interrupted) {
    const char* what = conversion.leaveForResuming()
                           ? "interrupted; the same command with --resume goes on from here"
                           : "interrupted before there was anything to resume; its temporary files are gone";
    throw Interrupted(interrupted.signal(), fmt::format("{}: {}", options.output.string(), what));
  } catch (const Error& error) {
    if (options.resume && conversion.leaveForResuming())
      throw Error("{}; what is done is kept, and --resume goes on from it", error.what());
    throw;
  }
}

}  // namespace

ConvertReport convert(const GridSource& source, const ConvertOptions& options, Progress& progress) {
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  GridOrigin::requireMemory(source, options.scalars, plan);
  if (options.bucket_splats) plan.limitBuckets(*options.bucket_splats, options.scalars.size());

  if (options.surfaces) checkPlanes(source.description(), options.planes);
  std::vector<ConversionFact> facts = factsOf(source.description(), options.scalars, options.blank_value);
  ConvertReport report;
  const std::filesystem::path manifest = options.output / "manifest.json";
  if (options.resume && ConversionWorkspace::clearIfFinished(options.output, facts)) {
    report.resumed = true;
    reportCache(Manifest::fromJson(readTextFile(manifest), manifest), report);
    report.resumed_bricks = report.bricks;
  } else if (options.resume && !options.overwrite && std::filesystem::exists(manifest) &&
             !hasUnfinished(options.output)) {
    throw Error(
        "{}: is there, and no conversion to it was left unfinished: there is nothing to resume; to replace "
        "it, add --overwrite",
        options.output.string());
  } else {
    checkOutput(options.output, options.overwrite, temporaryFolder(options));
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, plan.threads);
    Conversion conversion(source, options, plan, std::move(facts), progress);
    report = runOrLeave(conversion, options);
  }
  report.threads = plan.threads;
  report.memory_bytes = plan.cap_bytes;
  return report;
}

}  // namespace curvisplat
