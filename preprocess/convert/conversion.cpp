#include "preprocess/convert/conversion.h"

#include <algorithm>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <system_error>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/build_octree.h"
#include "preprocess/convert/conversion_journal.h"
#include "preprocess/convert/conversion_workspace.h"
#include "preprocess/convert/new_origin.h"
#include "preprocess/convert/preflight.h"
#include "preprocess/convert/sampled_scalars.h"
#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/convert/splat_record.h"
#include "stream/base/checksum.h"
#include "stream/base/disk_space.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/memory.h"
#include "stream/base/temporary_files.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/base/trace.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/partial_folder.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {

namespace {

Unfinished unfinishedOf(const ConvertOptions& options) {
  if (options.resume) return Unfinished::kResume;
  return options.overwrite ? Unfinished::kRemove : Unfinished::kRefuse;
}

/// A conversion under way: what each pass leaves for the next.
class Conversion {
 public:
  Conversion(const DataSource& source, const ConvertOptions& options, const MemoryPlan& plan,
             std::vector<ConversionFact> facts, FurtherParts parts, Progress& progress)
      : parts_(std::move(parts)),
        source_(source),
        options_(options),
        plan_(plan),
        progress_(progress),
        ranks_(*options.ranks) {
    if (ranks_.isFirst())
      workspace_.emplace(options.output, options.overwrite, unfinishedOf(options), temporaryFolder(options),
                         std::move(facts));
    shareFolders();
    scratch_files_.emplace(own_scratch_);
    origin_ = originOf(source, options, plan, *scratch_files_);
    nodes_ = nodesOf(*origin_);
  }

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
    if (parts_.own_blanks) own_blanks_ = parts_.own_blanks(partial_);
    if (isFirst()) checkDiskOf({options_, *origin_, nodes_, *workspace_, parts_.estimate}, progress_);
    if (hasSplats()) {
      try {
        runPasses(take_up_splats);
        runPasses(build_cache);
        return end();
      } catch (const LostBuckets&) {
        // The machine went down before all was on its disk. The bricks that are whole still count.
        if (!ranks_.alone()) throw;
        forgetSplats();
      }
    }
    runPasses(scatter_grid);
    runPasses(build_cache);
    return end();
  }

  /// Returns, after run() has thrown, whether there is something to resume, which then stays.
  bool leaveForResuming() {
    if (file_) file_->leave();
    return workspace_ && workspace_->leaveForResuming();
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
      const TraceScope trace(pass.name, TraceKind::kStage);
      // Cells of one layer are two splats.
      const uint64_t built = pass.run == &Conversion::build ? splats_.tree[0].contents.splats : 0;
      progress_.begin(pass.name, std::max(pass.steps, built) / ranks_.count(), pass.unit);
      (this->*pass.run)();
      // What a pass has freed goes back to the system: the next one counts on it.
      returnFreedMemory();
    }
    progress_.end();
  }

  bool isFirst() const { return ranks_.isFirst(); }
  /// Whether this rank calls the origin.
  bool makesSplats() const { return isFirst() || origin_->isShared(); }

  /// Rank 0's folders, at every rank; and a folder for each rank's own temporary files.
  void shareFolders() {
    if (isFirst()) {
      scratch_ = std::filesystem::absolute(workspace_->scratch());
      partial_ = std::filesystem::absolute(workspace_->partial().path());
    }
    scratch_ = sharedFolder(scratch_, ranks_);
    partial_ = sharedFolder(partial_, ranks_);
    own_scratch_ = makeFolderOfRank(scratch_, ranks_);
  }

  /// Whether an interrupted conversion has left splats that are all there.
  bool hasSplats() {
    std::vector<uint8_t> has(1);
    if (isFirst() && workspace_->hasAllSplats()) {
      try {
        splats_ = *workspace_->splats();
        if (!ranks_.alone()) openSplats();  // otherwise once it is known whether they are needed
        has[0] = 1;
      } catch (const LostBuckets&) {
        forgetSplats();
      }
    }
    return fromBytes<uint8_t>(ranks_.broadcast(toBytes(has)))[0] != 0;
  }

  ConvertReport end() {
    const Pass faces[] = {{"faces", "nodes", nodes_, &Conversion::writeFaces}};
    const Pass finish[] = {{"finish", "bricks", 0, &Conversion::finish}};
    if (options_.surfaces) runPasses(faces);
    runPasses(finish);
    return std::move(report_);
  }

  /// All ranks throw DifferingBlanks alike, also where rank 0 alone surveys: they go on with it together.
  void survey() {
    try {
      if (makesSplats()) splats_.survey = origin_->survey(progress_);
    } catch (const DifferingBlanks& differing) {
      if (origin_->isShared()) throw;
      splats_.survey.blanked.lost = differing.lost();
    }
    if (origin_->isShared()) return;
    splats_.survey = broadcastSurvey(splats_.survey, ranks_);
    checkExtent(splats_.survey, origin_->description());
  }

  void scan() {
    survey();
    const auto& lost = splats_.survey.blanked.lost;
    if (options_.differing != DifferingScalars::kBlankAll && !lost.empty()) throw DifferingBlanks(lost, true);
    checkRanges(splats_.survey, origin_->description(), options_.scalars);
    openWriter();
    if (!isFirst()) return;
    report_.warnings = origin_->warnings();
    warnOfValues();
    if (options_.blank_faces && splats_.survey.blanked.total() == 0)
      report_.warnings.emplace_back("--surface blanks: nothing is blanked, so the cache has no such faces");
    report_.notes = origin_->notes();
    splats_.overlap = origin_->overlap();
  }

  void count() {
    if (takeUpScattered()) return;
    const uint64_t counted = nodes_ / origin_->splatsPerCounted();
    const auto counts = makeCountingGrid(countingLevel(counted, splats_.survey.upper - splats_.survey.lower),
                                         plan_.counting_bytes);
    if (makesSplats()) origin_->count(root_, *counts, progress_);
    if (origin_->isShared()) sendCountsToFirst(*counts, ranks_);
    if (isFirst()) {
      counts->close();
      planBuckets(*counts, plan_, splats_.tree);
    }
    splats_.tree = broadcastTree(splats_.tree, ranks_);
    uint32_t buckets = 0;
    for (const uint32_t leaf : splats_.tree.leavesBelow(0))
      buckets = std::max(buckets, splats_.tree[leaf].bucket + 1);
    file_ = std::make_unique<BucketFile>(ConversionWorkspace::splatsFileOf(scratch_, ranks_.rank()), buckets,
                                         plan_.chunkBytes(buckets));
    contents_.assign(splats_.tree.size(), {});
    sample_.emplace(options_.scalars.size());
  }

  /// Whether an interrupted conversion has left some of the splats, and this one adds the others.
  bool takeUpScattered() {
    if (!ranks_.alone() || !workspace_->splats()) return false;
    const ScatteredSplats& left = *workspace_->splats();
    try {
      file_ = openScattered(workspace_->splatsFile(), left, plan_);
    } catch (const LostBuckets& error) {
      report_.notes.emplace_back(error.what());
      workspace_->forgetSplats();
      return false;
    }
    splats_.tree = left.tree;
    splats_.unfinished = left.unfinished;
    sample_.emplace(options_.scalars.size());
    sample_->add(left.sample);
    contents_.assign(splats_.tree.size(), {});
    for (const uint32_t leaf : splats_.tree.leavesBelow(0)) contents_[leaf] = splats_.tree[leaf].contents;
    return true;
  }

  void noteScattered(const ScatterState& state) {
    ScatteredSplats so_far = splats_;
    so_far.unfinished = state;
    so_far.buckets = file_->chains();
    so_far.sample = sample_->rows();
    so_far.tree.setContents(so_far.tree.leavesBelow(0), contents_);
    workspace_->noteSplats(std::move(so_far));
  }

  SplatTarget target() { return {root_, &splats_.tree, file_.get(), &contents_, &*sample_}; }

  ScatterNotes scatterNotes() {
    if (!ranks_.alone()) return {};
    return timedNotes(options_.limits.note_interval, splats_.unfinished ? &*splats_.unfinished : nullptr,
                      [this](const ScatterState& state) { noteScattered(state); });
  }

  void scatter() {
    const auto counted = scratch_files_->countBeside([this] { return file_->size(); });
    if (makesSplats()) splats_.counts = scatterSplats(*origin_, target(), scatterNotes(), progress_);
    splats_.unfinished.reset();
  }

  void mergeSeams() {
    if (makesSplats()) splats_.merged_nodes = scatterRest(*origin_, target(), progress_);
    splats_.thin_walls = origin_->thinWalls();
    if (const std::string warning = origin_->warningOfWalls(); !warning.empty())
      report_.warnings.push_back(warning);
    file_->close(!ranks_.alone());
    splats_.buckets = file_->chains();
    sample_->gatherFrom(ranks_);
    splats_.sample = sample_->rows();
    sumContents(contents_, ranks_);
    splats_.buckets_of_ranks = gatherChains(splats_.buckets, ranks_);
    splats_.tree.setContents(splats_.tree.leavesBelow(0), contents_);
    if (isFirst()) workspace_->noteSplats(splats_);
    shareSplats();
    if (!isFirst()) file_->leave();  // it is to be resumed from
    for (unsigned other = 0; other < ranks_.count(); ++other)
      if (other != ranks_.rank())
        file_->join(ConversionWorkspace::splatsFileOf(scratch_, other), chainsOf(other));
  }

  const BucketChains& chainsOf(unsigned of_rank) const {
    return of_rank == 0 ? splats_.buckets : splats_.buckets_of_ranks[of_rank - 1];
  }

  /// Brings the facts in rank 0's journal to every rank.
  void shareSplats() {
    if (ranks_.alone()) return;
    std::string text;
    if (isFirst()) text = journalText(workspace_->journal());
    const auto sent = fromBytes<char>(ranks_.broadcast(toBytes(std::vector<char>(text.begin(), text.end()))));
    if (isFirst()) return;
    splats_ = journalFrom(std::string(sent.begin(), sent.end()))->splats.value();
    readSample(scratch_, splats_);
  }

  /// Takes up, in place of all passes before, the splats of a conversion that was interrupted, which may have
  /// had another number of ranks.
  void takeUpSplats() {
    shareSplats();
    if (!isFirst()) openSplats();
    openWriter();
    if (isFirst()) warnOfValues();
  }

  void openSplats() {
    const auto file_of = [&](unsigned n) { return ConversionWorkspace::splatsFileOf(scratch_, n); };
    file_ = std::make_unique<BucketFile>(file_of(0), splats_.buckets);
    if (!isFirst()) file_->leave();
    for (unsigned n = 1; n <= splats_.buckets_of_ranks.size(); ++n) file_->join(file_of(n), chainsOf(n));
  }

  OctreePlan octreePlan() const { return {root_, origin_->blocks(), plan_, own_scratch_, scalars_.codings}; }

  void build() {
    ValueSample sample(options_.scalars.size());
    sample.add(splats_.sample);
    scalars_ = SampledScalars(sample, options_.scalars.size(), options_.precision);
    if (writer_) scalars_.divide(writer_->histograms());
    if (!ranks_.alone()) return buildTogether();
    const auto buckets = static_cast<uint32_t>(splats_.buckets.chains.size());
    OctreeBuilder builder(octreePlan(), splats_.tree, *writer_, progress_);
    if (const uint32_t first = builder.takeUpBricks(buckets); first < buckets) {
      if (!file_) openSplats();
      builder.build(*file_, first);
    }
    removeSplats();
  }

  /// Removes the splats in a thread, beside the faces: a disk may take half a second for gigabytes. The
  /// bricks are synced before, so that a crash of the machine does not lose both.
  void removeSplats() {
    try {
      splats_removed_ = std::async(std::launch::async, [this, file = std::move(file_)]() mutable {
        nameThisThread("splats-removal");
        const TraceScope trace("remove splats", TraceKind::kWait);
        writer_->sync();
        file.reset();
      });
    } catch (const std::system_error&) {
      // No further thread: they are removed by now, since the function that had them is gone.
    }
  }

  /// Bricks that were appended by an interrupted conversion are made again.
  void buildTogether() {
    const BucketRange share = dealBuckets(splats_.tree, file_->buckets(), ranks_.count())[ranks_.rank()];
    PartialFolder own_folder(bricksOfRank(scratch_, ranks_.rank()), true);
    Progress nothing_to_check;
    CacheWriter own(own_folder, root_, variables(), nothing_to_check);
    own.keep(0);
    scalars_.divide(own.histograms());
    OctreeBuilder(octreePlan(), splats_.tree, own, progress_).buildShare(*file_, share.first, share.end);
    if (isFirst()) writer_->keep(0);
    const std::vector<VariableInfo> infos = variables();
    joinBricks({root_, infos, scalars_.codings, splats_.tree, scratch_, partial_}, own, writer_.get(),
               ranks_);
  }

  void writeFaces() {
    if (!isFirst()) return;
    std::vector<uint32_t> numbers;
    for (const VariableInfo& variable : variables()) numbers.push_back(variable.number);
    const FacesJob job{workspace_->partial().path() / kFacesFileName,
                       workspace_->scratch(),
                       splats_.survey.lower,
                       splats_.survey.upper,
                       options_.planes,
                       std::move(numbers),
                       plan_.seam_bytes,
                       options_.blank_faces && splats_.survey.blanked.total() > 0
                           ? workspace_->partial().path() / kBlanksFileName
                           : std::filesystem::path()};
    faces_files_ = origin_->writeFaces(job, progress_);
  }

  void finish() {
    if (isFirst()) finishCache();
    ranks_.barrier();
  }

  void finishCache() {
    if (splats_removed_.valid()) splats_removed_.get();
    Manifest manifest = manifestOf(*origin_, options_, splats_);
    for (const std::optional<FileInfo>& file : {faces_files_.faces, faces_files_.blanks})
      if (file) manifest.files.push_back(*file);
    if (!splats_.thin_walls.empty()) manifest.files.push_back(writeThinWalls());
    manifest.own_blanks = own_blanks_;
    if (!own_blanks_.empty()) manifest.requirements.push_back(kOwnBlanks);
    reportCache(writer_->finish(manifest), report_);
    writer_.reset();
    file_.reset();  // of ranks, which all read it
    report_.blanked = splats_.survey.blanked;
    report_.degenerate = splats_.counts.degenerate;
    report_.inverted = splats_.counts.inverted;
    report_.merged_nodes = splats_.merged_nodes;
    if (!splats_.thin_walls.empty()) report_.notes.push_back(noteOfWalls());
    report_.temporary_bytes = std::max(splats_.temporaryBytes(), origin_->temporaryBytes());
    report_.resumed = workspace_->resumed();
  }

  FileInfo writeThinWalls() const {
    const auto bytes = std::as_bytes(std::span(splats_.thin_walls));
    if (bytes.size() > kMaxThinWallsBytes)
      throw Error("{}: has too many thin walls (found {} boxes, expected at most {})",
                  options_.output.string(), splats_.thin_walls.size(), kMaxThinWallsBytes / sizeof(WallSide));
    writeFileDurably(partial_ / kThinWallsFileName, bytes);
    return {kThinWallsFileName, bytes.size(), checksumOf(bytes)};
  }

  std::string noteOfWalls() const {
    uint64_t nodes = 0;
    for (const WallSide& box : splats_.thin_walls)
      nodes += (box.last[0] - box.first[0] + 1) * (box.last[1] - box.first[1] + 1) *
               (box.last[2] - box.first[2] + 1);
    return fmt::format(
        "{} of nodes on both sides of thin walls stay apart: they have other values at one place",
        countText(nodes, "pair"));
  }

  /// Needs the survey.
  void openWriter() {
    root_ = RootCube::around(splats_.survey.lower, splats_.survey.upper);
    if (writer_ || !isFirst()) return;
    writer_ = std::make_unique<CacheWriter>(workspace_->partial(), root_, variables(), progress_);
    report_.resumed_bricks = ranks_.alone() ? writer_->bricks().size() : 0;
  }

  void warnOfValues() {
    for (std::string& warning : warningsOfValues(splats_.survey, source_, options_.scalars))
      report_.warnings.push_back(std::move(warning));
  }

  void forgetSplats() {
    workspace_->forgetSplats();
    file_.reset();
    splats_ = {};
  }

  std::vector<VariableInfo> variables() const {
    return variablesOf(origin_->description(), options_.scalars, splats_.survey);
  }

  const FurtherParts parts_;
  const DataSource& source_;
  const ConvertOptions& options_;
  const MemoryPlan plan_;
  Progress& progress_;
  Ranks& ranks_;
  std::optional<ConversionWorkspace> workspace_;  // before what has files in it; rank 0's alone
  std::filesystem::path scratch_, partial_;       // rank 0's
  std::filesystem::path own_scratch_;
  std::optional<ScratchFiles> scratch_files_;
  std::unique_ptr<SplatOrigin> origin_;
  uint64_t nodes_ = 0;
  ScatteredSplats splats_;
  RootCube root_;
  std::vector<CellContents> contents_;  // [node of the tree], while they are being scattered
  std::optional<ValueSample> sample_;
  SampledScalars scalars_;
  std::unique_ptr<BucketFile> file_;
  std::unique_ptr<CacheWriter> writer_;
  FacesFiles faces_files_;
  std::vector<OwnBlanks> own_blanks_;
  ConvertReport report_;
  std::future<void> splats_removed_;  // last: waits for the end of its thread
};

constexpr const char* kKept = "; finished work is kept: continue with --resume";

}  // namespace

uint64_t samplesOf(const GridDescription& description) {
  uint64_t samples = 0;
  for (const GridBlock& block : description.blocks) samples += block.nodes();
  for (const MeshPiece& piece : description.pieces) samples += std::max(piece.points, piece.cells);
  return samples;
}

ConvertReport runConversion(const DataSource& source, const ConvertOptions& options, const MemoryPlan& plan,
                            std::vector<ConversionFact> facts, const FurtherParts& parts,
                            Progress& progress) {
  const RoomNeeded room = roomNeeded(options);
  std::optional<Conversion> conversion;
  room.during([&] { conversion.emplace(source, options, plan, std::move(facts), parts, progress); });
  try {
    return conversion->run();
  } catch (const Interrupted& interrupted) {
    const char* what = "interrupted; its temporary files were removed";
    if (options.keep_interrupted)
      what = conversion->leaveForResuming()
                 ? "interrupted; continue with the same command and --resume"
                 : "interrupted before there was anything to resume; its temporary files were removed";
    throw Interrupted(interrupted.signal(), fmt::format("{}: {}", options.output.string(), what));
  } catch (const DiskFull& full) {
    throw OutputError("{}{}", room.error(full).what(),
                      options.resume && conversion->leaveForResuming() ? kKept : "");
  } catch (const OutputError& error) {
    if (options.resume && conversion->leaveForResuming()) throw OutputError("{}{}", error.what(), kKept);
    throw;
  } catch (const Error& error) {
    if (options.resume && conversion->leaveForResuming()) throw Error("{}{}", error.what(), kKept);
    throw;
  }
}

}  // namespace curvisplat
