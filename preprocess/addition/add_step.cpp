#include "preprocess/addition/add_step.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "preprocess/addition/addition_workspace.h"
#include "preprocess/addition/series_steps.h"
#include "preprocess/addition/value_buckets.h"
#include "preprocess/addition/value_passes.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/grid_origin.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/mesh_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/scan.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/grid_views.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/memory.h"
#include "stream/base/name_list.h"
#include "stream/base/watched_file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {
namespace {

constexpr size_t kNodesPerTask = 16384;

CacheReader openAtLastStep(const std::filesystem::path& path) {
  CacheReader first(path);
  const uint64_t last = first.series().steps.size() - 1;
  return last == 0 ? std::move(first) : first.atStep(last);
}

/// Positions of the cache's scalars in the source's description.
std::vector<uint32_t> scalarsOf(const GridDescription& description, const Manifest& manifest) {
  std::vector<uint32_t> positions;
  for (const VariableInfo& variable : manifest.variables) {
    const auto found = std::find_if(description.scalars.begin(), description.scalars.end(),
                                    [&](const GridScalar& scalar) { return scalar.name == variable.name; });
    if (found == description.scalars.end())
      throw Error("has no scalar '{}', which the steps before it have", variable.name);
    positions.push_back(static_cast<uint32_t>(found - description.scalars.begin()));
  }
  return positions;
}

/// The step's blocks in the order of the series, by their names; null if they are in that order, or if names do not tell.
std::unique_ptr<GridSource> inOrderOf(const Manifest& series, const DataSource& source) {
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  if (!grid) return nullptr;
  std::vector<std::string> names;
  for (const BlockInfo& block : series.blocks) names.push_back(block.name);
  std::vector<uint32_t> order = orderByName(grid->description().blocks, names);
  return order.empty() ? nullptr : reordered(*grid, std::move(order));
}

std::filesystem::path temporaryFolderOfStep(const AddStepOptions& options) {
  return options.temporary_folder.empty() ? folderOf(options.cache) : options.temporary_folder;
}

/// Facts that the scatter pass learns about a grid of node-centred scalars on its way.
struct SlabSurvey {
  GridChecksum grid_checksum;
  std::vector<ScalarRange> ranges;

  void add(const LoadedSlab& loaded, const GridBlock& block) {
    grid_checksum.add(loaded, block);
    // The halo's nodes are nodes of the grid as well: counting them twice changes no range.
    const NodeArrays& nodes = loaded.nodes;
    for (size_t scalar = 0; scalar < ranges.size(); ++scalar) {
      const std::vector<float>& values = nodes.scalars[scalar];
      ranges[scalar] = parallelReduce(
          tbb::blocked_range<size_t>(0, values.size(), kNodesPerTask), ranges[scalar],
          [&](const tbb::blocked_range<size_t>& part, ScalarRange range) {
            for (size_t n = part.begin(); n < part.end(); ++n) {
              if (nodes.blank[n]) continue;
              range.min = std::min<double>(range.min, values[n]);
              range.max = std::max<double>(range.max, values[n]);
            }
            return range;
          },
          [](const ScalarRange& a, const ScalarRange& b) {
            return ScalarRange{std::min(a.min, b.min), std::max(a.max, b.max)};
          });
    }
  }
};

/// A step on its way into the cache: what each pass leaves for the next.
class StepAddition {
 public:
  /// `lock`: of options.cache.
  StepAddition(const DataSource& source, const AddStepOptions& options, const CacheLock& lock,
               Progress& progress)
      : options_(options),
        progress_(progress),
        lock_(lock),
        cache_(openAtLastStep(options.cache)),
        reordered_(inOrderOf(cache_.seriesManifest(), source)),
        source_(reordered_ ? *reordered_ : source),
        scalars_(scalarsOf(source.description(), cache_.seriesManifest())),
        plan_(MemoryPlan::ofOptions(options.memory_bytes, scalars_.size(), options.threads)),
        grid_(dynamic_cast<const GridSource*>(&source_)) {
    if (grid_) GridOrigin::requireMemory(*grid_, scalars_, plan_);
    plan_.limitTo(options.limits, scalars_.size());
    report_.step = cache_.series().steps.size();
    if (grid_) {
      report_.nodes = cache_.manifest().nodes;
      reader_ = std::make_unique<NodeReader>(*grid_, scalars_, options.blank_value);
    } else {
      makeScratch();
      origin_ = std::make_unique<MeshOrigin>(dynamic_cast<const MeshSource&>(source), scalars_,
                                             options.blank_value, plan_, scratch_->path());
      for (const GridBlock& block : origin_->blocks()) report_.nodes += block.nodes();
    }
    // A mesh that differs from those before it gets a geometry of its own.
    if (grid_) checkBlocksOfStep(source_.description().blocks, cache_.seriesManifest());
    if ((centring() == Centring::kCell) != cache_.manifest().cells)
      throw Error("its scalars are {}-centred; those of the steps before it are {}-centred",
                  cache_.manifest().cells ? "node" : "cell", cache_.manifest().cells ? "cell" : "node");
    chooseTime();
  }

  AddStepReport run() {
    const ConversionThreads threads(plan_.threads);
    const bool known = cache_.series().steps[cache_.step()].grid_checksum != 0;
    const bool try_first = grid_ && known && !options_.expect_new_geometry && centring() == Centring::kNode;
    if (!try_first || !addToLastGeometry()) addAfterScan();
    progress_.end();
    return std::move(report_);
  }

 private:
  Centring centring() const { return grid_ ? reader_->centring() : origin_->centring(); }

  TimeUnit unit() const { return {cache_.seriesManifest().time_unit, cache_.seriesManifest().calendar}; }

  void chooseTime() {
    const double last = cache_.series().steps.back().time;
    const std::optional<double> stated =
        options_.time ? options_.time : timeOf(source_.description(), unit());
    report_.time = stated.value_or(last + 1);
    if (!(report_.time > last) || !std::isfinite(report_.time))
      throw Error("its time {} is not after {}, the time of the step before it", report_.time, last);
  }

  template <typename Work>
  void pass(const char* name, uint64_t steps, const char* unit, const Work& work) {
    progress_.begin(name, steps, unit);
    work();
    // What a pass has freed goes back to the system: the next one counts on it.
    returnFreedMemory();
  }

  /// Most steps have the geometry of the step before: its checksum is computed while the values are scattered.
  /// Returns false if it is another.
  bool addToLastGeometry() {
    const uint64_t expected = cache_.series().steps[cache_.step()].grid_checksum;
    makeScratch();
    ValuePasses passes(cache_, scalars_.size(), plan_, scratch_->path(), progress_);
    passes.setOverlaps(overlapsFor(cache_.manifest(), *grid_, plan_.forOverlaps(), progress_));
    SlabSurvey survey;
    survey.ranges.resize(scalars_.size());
    try {
      pass("scatter", report_.nodes, "nodes", [&] {
        passes.scatter(*reader_, [&](const LoadedSlab& loaded) {
          survey.add(loaded, source_.description().blocks[loaded.slab.block]);
        });
      });
    } catch (const Interrupted&) {
      throw;
    } catch (const OutputError&) {
      throw;
    } catch (const Error&) {
      return false;  // its splats lie elsewhere; or it cannot be read, which the scan reports
    }
    if (survey.grid_checksum.value() != expected) return false;
    ranges_ = survey.ranges;
    finishValues(passes, cache_);
    return true;
  }

  void addAfterScan() {
    if (grid_) scratch_.reset();
    GridSurvey survey;
    pass("scan", report_.nodes, "nodes", [&] {
      survey = grid_ ? surveyGrid(*reader_, plan_.slab_bytes, {}, progress_) : origin_->survey(progress_);
    });
    checkRanges(survey, source_.description(), scalars_);
    ranges_ = survey.ranges;
    const auto geometry = cache_.series().geometryOf(survey.grid_checksum);
    if (!geometry) {
      report_.warnings = warningsOfValues(survey, source_, scalars_);
      return addGeometry();
    }
    const CacheReader cache = cache_.atStep(cache_.series().first_steps[*geometry]);
    grid_ ? makeScratch() : origin_->follow(cache.manifest());
    ValuePasses passes(cache, scalars_.size(), plan_, scratch_->path(), progress_);
    if (grid_) passes.setOverlaps(overlapsFor(cache.manifest(), *grid_, plan_.forOverlaps(), progress_));
    pass("scatter", report_.nodes, "nodes",
         [&] { grid_ ? passes.scatter(*reader_) : passes.scatter(*origin_); });
    finishValues(passes, cache);
  }

  void makeScratch() {
    if (options_.check_disk_space)
      checkDiskSpace(
          diskNeedsOfAdding(cache_.manifest().splats, scalars_.size(), minValueRecordBytes(scalars_.size())),
          options_.cache, temporaryFolderOfStep(options_));
    scratch_ = std::make_unique<ScratchFolder>(newScratch(options_.cache, temporaryFolderOfStep(options_)),
                                               ScratchFolder::Folder::kMake);
  }

  void finishValues(ValuePasses& passes, const CacheReader& cache) {
    GridSurvey survey;
    survey.ranges = ranges_;
    checkRanges(survey, source_.description(), scalars_);
    StepWriter writer(lock_, cache, newStep());
    pass("seams", 0, "nodes", [&] { passes.mergeSeams(); });
    if (!passes.warningOfWalls().empty()) report_.warnings.push_back(passes.warningOfWalls());
    pass("build", cache.manifest().splats, "splats", [&] {
      const StepReferences references(cache, options_.to_part);
      passes.build(writer, &references);
    });
    if (grid_)
      pass("faces", report_.nodes, "nodes", [&] {
        std::vector<uint32_t> numbers;
        for (const VariableInfo& variable : cache.manifest().variables) numbers.push_back(variable.number);
        const FurtherFaces job{cache, *reader_, scratch_->path(), facesFileOfStep(report_.step), numbers};
        if (const auto file = writeFurtherFaces(job, plan_, progress_)) writer.addFile(*file);
      });
    pass("finish", 0, "bricks", [&] {
      for (const FileInfo& file : writer.finish()) report_.files.push_back({file.name, file.size});
    });
  }

  void addGeometry() {
    ConvertOptions options;
    options.surfaces = FacesReader::open(cache_.path(), cache_.manifest()) != nullptr;
    options.planes = planesOf(cache_);
    options.blank_faces = hasFacesOfBlanks(cache_);
    options.output = options_.cache / geometryFolderName(cache_.series().geometries());
    // A kill between the two steps below leaves a geometry that the series does not have.
    ConversionWorkspace::clearKilled(options.output);
    requireCacheFolderRemoved(options.output);
    options.check_disk_space = options_.check_disk_space;
    options.resume = options_.resume;
    options.overwrite = !options_.resume;
    options.scalars = scalars_;
    options.blank_value = options_.blank_value;
    options.precision = precisionOf(cache_.manifest());
    options.memory_bytes = options_.memory_bytes;
    options.threads = options_.threads;
    options.temporary_folder = temporaryFolderOfStep(options_);
    options.given_folders = options_.given_folders;
    options.title = cache_.seriesManifest().title;
    options.time = report_.time;
    options.time_unit = unit();
    if (cache_.manifest().overlap == kOverlapAll) options.overlap = Overlap::kAll;
    options.limits = options_.limits;
    ConvertReport converted = convert(source_, options, progress_);
    report_.new_geometry = true;
    report_.files = std::move(converted.files);
    addGeometryStep(lock_, cache_, newStep());
  }

  NewStep newStep() const {
    NewStep step{report_.time, {}, source_.description().files};
    for (const ScalarRange& range : ranges_) step.ranges.push_back({range.min, range.max});
    return step;
  }

  const AddStepOptions& options_;
  Progress& progress_;
  const CacheLock& lock_;
  const CacheReader cache_;
  const std::unique_ptr<GridSource> reordered_;  // null: the source's blocks are in the cache's order
  const DataSource& source_;
  const std::vector<uint32_t> scalars_;
  MemoryPlan plan_;
  std::unique_ptr<ScratchFolder> scratch_;  // before what has files in it
  const GridSource* const grid_;            // null: unstructured
  std::unique_ptr<NodeReader> reader_;      // of a structured grid
  std::unique_ptr<MeshOrigin> origin_;      // of an unstructured one
  std::vector<ScalarRange> ranges_;
  AddStepReport report_;
};

/// Adds the step to the sets of scalars with blanks of their own.
class SetsAddition {
 public:
  SetsAddition(const DataSource& source, const AddStepOptions& options, const CacheLock& lock,
               Progress& progress)
      : source_(source), options_(options), lock_(lock), progress_(progress), whole_(options.cache) {}

  /// The files and warnings.
  AddStepReport run() {
    const std::vector<OwnBlanks>& sets = whole_.seriesManifest().own_blanks;
    std::vector<size_t> going_on;
    for (size_t n = 0; n < sets.size(); ++n) {
      const CacheReader set = whole_.ownBlanks(n);
      if (set.series().steps.size() < whole_.series().steps.size()) continue;
      if (isInStep(set.seriesManifest()))
        going_on.push_back(n);
      else
        end(sets[n].variables, "missing");
    }
    for (const size_t n : going_on) add(n, sets[n].variables);
    return std::move(report_);
  }

 private:
  bool isInStep(const Manifest& set) const {
    const std::vector<GridScalar>& scalars = source_.description().scalars;
    return std::ranges::all_of(set.variables, [&](const VariableInfo& variable) {
      return std::ranges::find(scalars, variable.name, &GridScalar::name) != scalars.end();
    });
  }

  void add(size_t set, const std::vector<std::string>& names) {
    const CacheLock lock(lock_, set);
    AddStepOptions options = options_;
    options.cache = lock.cache();
    options.temporary_folder = temporaryFolderOfStep(options_);
    const Series series = CacheReader(options.cache).series();
    options.expect_new_geometry =
        series.geometries() > 1 && series.first_steps.back() == series.steps.size() - 1;
    try {
      AddStepReport added = StepAddition(source_, options, lock, progress_).run();
      for (FileReport& file : added.files) report_.files.push_back(std::move(file));
      for (std::string& warning : added.warnings) report_.warnings.push_back(std::move(warning));
    } catch (const NothingToDraw&) {
      end(names, "no sample has a value");
    } catch (const DifferingBlanks&) {
      end(names, "no sample has values of all of them");
    }
  }

  void end(const std::vector<std::string>& names, const char* reason) {
    report_.warnings.push_back(
        fmt::format("{}: {} at this step; kept up to the step before", listed(names), reason));
  }

  const DataSource& source_;
  const AddStepOptions& options_;
  const CacheLock& lock_;
  Progress& progress_;
  const CacheReader whole_;
  AddStepReport report_;
};

std::string textOf(const TimeUnit& unit) {
  return fmt::format("'{}'{}", unit.name,
                     unit.calendar.empty() ? "" : fmt::format(" ({} calendar)", unit.calendar));
}

}  // namespace

std::optional<double> timeOf(const GridDescription& description, const TimeUnit& of_series) {
  const std::optional<double> time = statedTime(description);
  const TimeUnit unit{description.time_unit, description.calendar};
  if (!time || unit.name.empty() || of_series.name.empty()) return time;
  const std::optional<double> converted = timeInUnit(*time, unit, of_series);
  if (!converted)
    throw Error("its times are in {}, which cannot be converted to {}, the unit of the steps before it",
                textOf(unit), textOf(of_series));
  return converted;
}

AddStepReport addStep(const DataSource& source, const AddStepOptions& options, Progress& progress) {
  checkWritable(options.cache, "; name a splat cache that you may change");
  RoomNeeded room{options.given_folders, "the step and its temporary files", kFullDiskHint};
  if (room.folders.empty()) room.folders = {options.cache, temporaryFolderOfStep(options)};
  const WatchedFiles files(source.description().files);
  return room.during([&] {
    prepareSets(options.cache);
    const CacheLock lock(options.cache);
    StepAddition addition(source, options, lock, progress);  // checks the step before a set is changed
    const AddStepReport of_sets = SetsAddition(source, options, lock, progress).run();
    AddStepReport report = addition.run();
    report.files.insert(report.files.end(), of_sets.files.begin(), of_sets.files.end());
    report.warnings.insert(report.warnings.end(), of_sets.warnings.begin(), of_sets.warnings.end());
    files.warn(report.warnings);
    return report;
  });
}

}  // namespace curvisplat
