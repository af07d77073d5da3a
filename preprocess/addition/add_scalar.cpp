#include "preprocess/addition/add_scalar.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/vector_relational.hpp>
#include <memory>

#include "preprocess/addition/addition_workspace.h"
#include "preprocess/addition/drawn_samples.h"
#include "preprocess/addition/value_buckets.h"
#include "preprocess/addition/value_passes.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/grid_origin.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/memory.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"
#include "stream/base/watched_file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {
namespace {

void checkNames(const std::vector<std::string>& names, const CacheReader& cache) {
  const std::vector<std::string> present = cache.allScalars();
  for (const std::string& name : names)
    if (std::find(present.begin(), present.end(), name) != present.end())
      throw UsageError("{}: already has a scalar '{}'; it has {}", cache.path().string(), name,
                       listed(present));
}

std::filesystem::path temporaryFolder(const AddScalarOptions& options) {
  return options.temporary_folder.empty() ? folderOf(options.cache) : options.temporary_folder;
}

/// An addition under way: what each pass leaves for the next.
class Addition {
 public:
  Addition(const DataSource& source, const AddScalarOptions& options, const MemoryPlan& plan,
           Progress& progress)
      : options_(options),
        plan_(plan),
        progress_(progress),
        ranks_(*options.ranks),
        workspace_(options.cache, temporaryFolder(options), ranks_),
        cache_(options.cache),
        description_(source.description()) {
    for (const uint32_t scalar : options.scalars)
      report_.scalars.push_back(source.description().scalars[scalar].name);
    report_.nodes = manifest().nodes;
    report_.splats = manifest().splats;
    if (cache_.series().steps.size() > 1)
      throw Error(
          "{}: is a series of {} steps; scalars cannot be added to a series: convert it again with all "
          "scalars",
          cache_.path().string(), cache_.series().steps.size());
    if (const auto* const mesh = dynamic_cast<const MeshSource*>(&source)) {
      mesh_ = std::make_unique<DrawnMesh>(*mesh);
      newOrigin();
    } else {
      grid_ = std::make_unique<CacheGrid>(dynamic_cast<const GridSource&>(source));
      reader_ = std::make_unique<NodeReader>(*grid_, options.scalars, options.blank_value);
      plan_.slab_bytes = slabBytesOfRanks(*reader_, plan_.slab_bytes, ranks_);
    }
    checkCentring();
    checkBlocks(mesh_ ? origin_->blocks() : description_.blocks, cache_);
    checkNames(report_.scalars, cache_);
    if (options.check_disk_space && isFirst())
      checkDiskSpace(diskNeedsOfAdding(manifest().splats, options.scalars.size(),
                                       minValueRecordBytes(options.scalars.size())),
                     options.cache, temporaryFolder(options));
  }

  AddScalarReport run() {
    scan();
    pass("scatter", nodesOfRank(), "nodes", &Addition::scatter);
    pass("seams", 0, "nodes", &Addition::mergeSeams);
    pass("build", manifest().splats, "splats", &Addition::build);
    pass("faces", manifest().nodes, "nodes", &Addition::writeFaces);
    pass("finish", 0, "bricks", &Addition::finish);
    progress_.end();
    return std::move(report_);
  }

 private:
  void pass(const char* name, uint64_t steps, const char* unit, void (Addition::*work)()) {
    progress_.begin(name, steps, unit);
    (this->*work)();
    // What a pass has freed goes back to the system: the next one counts on it.
    returnFreedMemory();
  }

  void scan() {
    pass("scan", nodesOfRank(), "nodes", &Addition::survey);
    if (survey_.blanked.by_grid < manifest().blanked_nodes) {
      if (manifest().overlap == kOverlapOwner)
        throw Error(
            "{}: its blocks overlap, and older scalars have no values at some of its samples; convert again "
            "with all scalars",
            cache_.path().string());
      warnOfLeftOut();
      // Older scalars have blanked nodes that the grid does not: only the cache knows them.
      pass("drawn nodes", manifest().bricks, "bricks", &Addition::findDrawnNodes);
      if (grid_ && manifest().splats < manifest().nodes - manifest().blanked_nodes)
        pass("merged nodes", manifest().nodes, "nodes", &Addition::findMergedNodes);
      pass("scan again", nodesOfRank(), "nodes", &Addition::survey);
    }
    if (isFirst()) checkSurvey();
  }

  /// Warns if the grid has values at samples where older scalars have none, which are left out. The survey is
  /// of all that the grid has.
  void warnOfLeftOut() {
    const uint64_t kept_out = manifest().blanked_nodes, blanked = survey_.blanked.total();
    uint64_t values = blanked < kept_out ? kept_out - blanked : 0;
    uint64_t of_some = 0;  // where another added scalar has none
    for (const BlankCounts::Lost& lost : survey_.blanked.lost) of_some = std::max(of_some, lost.samples);
    values += of_some;
    if (values > 0)
      report_.warnings.push_back(
          fmt::format("left out: the values of {} at {}, where the scalars of the cache have none; to keep "
                      "them, convert again with all scalars",
                      listed(report_.scalars), countText(values, "sample")));
  }

  bool isFirst() const { return ranks_.isFirst(); }
  /// The nodes of this rank's share of a pass.
  uint64_t nodesOfRank() const { return manifest().nodes / ranks_.count(); }

  void survey() {
    if (grid_) {
      survey_ = surveyGrid(*reader_, plan_.slab_bytes, {}, progress_, ranks_);
      return;
    }
    if (isFirst()) survey_ = origin_->survey(progress_);
    survey_ = broadcastSurvey(survey_, ranks_);
  }
  void newOrigin() {
    origin_ =
        std::make_unique<MeshOrigin>(*mesh_, options_.scalars, options_.blank_value, plan_, workspace_.own());
    origin_->follow(manifest());
  }

  // Each rank finds these nodes for itself: it asks for them where it reads its share.
  void findDrawnNodes() {
    if (grid_) return grid_->restrictTo(cache_, plan_, workspace_.own(), progress_);
    if (!isFirst()) return;  // it makes all splats
    mesh_->restrictTo(cache_, plan_, workspace_.own(), progress_);
    newOrigin();
  }
  void findMergedNodes() {
    grid_->addMergedFaces(plan_, unlikeHalvesOf(manifest()), workspace_.own(), progress_);
  }

  void checkSurvey() const {
    const uint64_t missing = survey_.blanked.by_value + survey_.blanked.not_finite;
    // Samples of a mesh that lost all their cells to blanked ones have no splat, either.
    const bool restricted = mesh_ && mesh_->restricted();
    if (restricted ? survey_.blanked.by_grid < manifest().blanked_nodes
                   : survey_.blanked.by_grid != manifest().blanked_nodes)
      throw Error(
          "{}: {} samples were blanked when it was made, and this grid blanks {}; it is not the one the "
          "cache was made from, or scalars were missing at nodes where blocks meet: convert again with all "
          "scalars",
          cache_.path().string(), manifest().blanked_nodes, survey_.blanked.by_grid);
    if (missing > 0)
      throw LacksValues(
          "{}: {} of its samples have no value of {} ({} not finite in single precision, {} with the blank "
          "value), and every splat needs one; convert again with all scalars",
          cache_.path().string(), missing, listed(report_.scalars), survey_.blanked.not_finite,
          survey_.blanked.by_value);
    checkRanges(survey_, description_, options_.scalars);
    const auto inside = [](const glm::dvec3& a, const glm::dvec3& b) {
      return glm::all(glm::lessThanEqual(a, b));
    };
    const bool same_extent =
        restricted ? inside(manifest().lower, survey_.lower) && inside(survey_.upper, manifest().upper)
                   : survey_.lower == manifest().lower && survey_.upper == manifest().upper;
    if (!same_extent)
      throw Error(
          "{}: was made from a grid from ({}, {}, {}) to ({}, {}, {}); this grid goes from ({}, {}, {}) to "
          "({}, {}, {}) and is not the one the cache was made from",
          cache_.path().string(), manifest().lower.x, manifest().lower.y, manifest().lower.z,
          manifest().upper.x, manifest().upper.y, manifest().upper.z, survey_.lower.x, survey_.lower.y,
          survey_.lower.z, survey_.upper.x, survey_.upper.y, survey_.upper.z);
  }

  void checkCentring() const {
    const auto words = [](bool cells) { return cells ? "cell" : "node"; };
    const bool cells = (mesh_ ? origin_->centring() : reader_->centring()) == Centring::kCell;
    if (cells != manifest().cells)
      throw Error("{}: its scalars are {}-centred, but {} is {}-centred; convert it to a cache of its own",
                  cache_.path().string(), words(manifest().cells), listed(report_.scalars), words(cells));
  }

  void scatter() {
    if (isFirst())
      writer_ = std::make_unique<VariableWriter>(workspace_.lock(), manifest(), this->variables());
    passes_ =
        std::make_unique<ValuePasses>(cache_, options_.scalars.size(), plan_, workspace_.own(), progress_);
    passes_->shareWith(ranks_, workspace_.shared());
    if (mesh_) return passes_->scatter(*origin_);
    passes_->setOverlaps(overlapsFor(manifest(), *grid_, plan_.forOverlaps(), progress_, ranks_));
    passes_->scatter(*reader_);
  }

  void mergeSeams() {
    passes_->mergeSeams();
    if (!passes_->warningOfWalls().empty()) report_.warnings.push_back(passes_->warningOfWalls());
    report_.temporary_bytes = passes_->temporaryBytes();
  }

  void build() {
    if (isFirst()) passes_->build(*writer_);
    passes_.reset();
  }

  void writeFaces() {
    if (mesh_ || !isFirst()) return;
    const std::vector<uint32_t> numbers = writer_->numbers();
    const FurtherFaces job{cache_, *reader_, workspace_.own(), facesFileOfVariable(numbers.front()), numbers};
    if (const auto file = writeFurtherFaces(job, plan_, progress_)) writer_->addFile(*file);
  }

  void finish() {
    progress_.throwIfStopped();  // the last moment: a rank without work of its own does not look before
    ranks_.barrier();            // where another has failed, the cache stays as it is
    if (isFirst())
      for (const FileInfo& file : writer_->finish(description_.files))
        report_.files.push_back({file.name, file.size});
    ranks_.barrier();
  }

  std::vector<VariableInfo> variables() const {
    std::vector<VariableInfo> variables;
    for (size_t n = 0; n < options_.scalars.size(); ++n) {
      const GridScalar& scalar = description_.scalars[options_.scalars[n]];
      variables.push_back({0, scalar.name, scalar.unit, survey_.ranges[n].min, survey_.ranges[n].max});
    }
    return variables;
  }

  const Manifest& manifest() const { return cache_.manifest(); }

  const AddScalarOptions& options_;
  MemoryPlan plan_;
  Progress& progress_;
  Ranks& ranks_;
  const AdditionWorkspace workspace_;  // before the cache is read, and before what has files in its folder
  const CacheReader cache_;
  const GridDescription& description_;
  // The grid, structured or unstructured.
  std::unique_ptr<CacheGrid> grid_;
  std::unique_ptr<NodeReader> reader_;
  std::unique_ptr<DrawnMesh> mesh_;
  std::unique_ptr<MeshOrigin> origin_;
  GridSurvey survey_;
  std::unique_ptr<VariableWriter> writer_;
  std::unique_ptr<ValuePasses> passes_;
  AddScalarReport report_;
};

}  // namespace

AddScalarReport addScalars(const DataSource& source, const AddScalarOptions& options, Progress& progress) {
  const WatchedFiles files(source.description().files);
  MemoryPlan plan = MemoryPlan::ofOptions(options.memory_bytes, options.scalars.size(), options.threads);
  if (const auto* const grid = dynamic_cast<const GridSource*>(&source))
    GridOrigin::requireMemory(*grid, options.scalars, plan);
  plan.limitTo(options.limits, options.scalars.size());
  plan = commonPlan(plan, *options.ranks);

  if (options.ranks->isFirst()) {
    checkWritable(options.cache, "; name a splat cache that you may change");
    checkWritable(temporaryFolder(options), "; name another folder with --tmp");
    ConversionWorkspace::clearKilled(options.cache);
  }

  const ConversionThreads threads(plan.threads);
  const RoomNeeded room{{options.cache, temporaryFolder(options)},
                        "the added scalars and their temporary files",
                        kFullDiskHint};
  AddScalarReport report = room.during([&] { return Addition(source, options, plan, progress).run(); });
  report.threads = plan.threads;
  report.memory_bytes = plan.cap_bytes;
  files.warn(report.warnings);
  return report;
}

}  // namespace curvisplat
