#include "preprocess/convert/scatter.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "preprocess/convert/shared_passes.h"
#include "preprocess/convert/splat_record.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/cell_splats.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNodesPerTask = 1024;        // their splats stay in a core's cache until they are sent
constexpr uint64_t kNodesOfRowPerTask = 16384;  // longer rows are cut
constexpr size_t kGatheredBytes = 32 << 10;
constexpr size_t kGatheredForSeams = 16 << 10;  // doubles
constexpr uint64_t kSeamReach =
    2;  // nodes of a row or column, from a face of the block on, that may be for seams

/// Makes splats of slabs.
class SplatStream {
 public:
  SplatStream(const NodeReader& reader, const AbuttingFaces* faces, const SinkOfThread& sink_of_thread,
              SeamMerger& seams, const SlabPass& pass)
      : progress_(&pass.progress),
        blocks_(&reader.source().description().blocks),
        variables_(reader.scalars()),
        centring_(reader.centring()),
        faces_(faces),
        sink_of_thread_(&sink_of_thread),
        rules_(pass.rules),
        seams_(&seams),
        workers_([this] { return Worker{{}, {}, {}, 0, std::vector<Handedness>(blocks_->size()), {}}; }) {
    if (pass.notes.from) before_ = *pass.notes.from;
    before_.handedness.resize(blocks_->size());
  }

  enum class Send {
    kAll,
    kSeams,  // the others were sent before
  };

  /// `covered`: of the slab, as BlockOwners::cover() sets it.
  void add(const LoadedSlab& loaded, std::span<const uint64_t> covered, Send what) {
    const Slab& slab = loaded.slab;
    const GridBlock& block = (*blocks_)[slab.block];
    const std::vector<Task> tasks = tasksOf(slab.box, block, what);
    parallelFor(size_t{0}, tasks.size(), [&](size_t n) {
      progress_->throwIfStopped();
      const TraceScope trace("make splats");
      const Task& task = tasks[n];
      BlockWindow window{block, slab.first_node, slab.window, &loaded.nodes, task.i0, task.i1};
      if (!covered.empty()) window.covered = covered.data();
      Worker& worker = workers_.local();
      if (centring_ == Centring::kCell)
        computeCellSplats(window, task.box, {slab.block, faces_}, worker.cells, worker.splats, rules_);
      else
        computeNodeSplats(window, task.box, worker.nodes, worker.splats, rules_);
      if (what == Send::kAll) {
        worker.degenerate += worker.splats.degenerate;
        worker.handedness[slab.block].right += worker.splats.right_handed;
        worker.handedness[slab.block].left += worker.splats.left_handed;
      }
      send(worker, what);
    });
  }

  /// To be called at the end.
  void finish() {
    for (Worker& worker : workers_) seams_->add(worker.for_seams);
  }

  /// The state of all that was sent. Call it only while no slab is being added.
  ScatterState state() const {
    ScatterState state = before_;
    for (const Worker& worker : workers_) {
      state.degenerate += worker.degenerate;
      for (size_t block = 0; block < state.handedness.size(); ++block) {
        state.handedness[block].right += worker.handedness[block].right;
        state.handedness[block].left += worker.handedness[block].left;
      }
    }
    return state;
  }

  /// All ranks have to call it.
  ScatterCounts counts(Ranks& ranks) const {
    static_assert(sizeof(Handedness) == 2 * sizeof(uint64_t));
    ScatterState all = state();
    ranks.sum(std::span(&all.degenerate, 1));
    ranks.sum(std::span(&all.handedness.front().right, 2 * all.handedness.size()));
    ScatterCounts counts{all.degenerate, 0};
    for (const Handedness& of_block : all.handedness)
      counts.inverted += std::min(of_block.right, of_block.left);
    return counts;
  }

 private:
  /// Scratch memory and results of a thread.
  struct Worker {
    NodeSplats splats;
    NodeScratch nodes;
    CellScratch cells;
    uint64_t degenerate = 0;
    std::vector<Handedness> handedness;  // [block]
    std::vector<double> for_seams;       // packed, not yet added
  };

  /// The nodes i0 .. i1 - 1 of each row of a box.
  struct Task {
    NodeBox box;
    uint64_t i0, i1;
  };

  static std::vector<Task> tasksOf(const NodeBox& slab, const GridBlock& block, Send what) {
    std::vector<Task> tasks;
    for (const NodeBox& box : cutForTasks(slab.rowNodes(block.ni), slab, kNodesPerTask)) {
      const auto add = [&](uint64_t begin, uint64_t end) {
        for (uint64_t i0 = begin; i0 < end; i0 += kNodesOfRowPerTask)
          tasks.push_back({box, i0, std::min(i0 + kNodesOfRowPerTask, end)});
      };
      const auto isInside = [](uint64_t begin, uint64_t end, uint64_t nodes) {
        return begin >= kSeamReach && end + kSeamReach <= nodes;
      };
      const uint64_t i0 = slab.i0, i1 = std::min(slab.i1, block.ni);
      if (what == Send::kAll || !isInside(box.j0, box.j1, block.nj) || !isInside(box.k0, box.k1, block.nk)) {
        add(i0, i1);
      } else {
        const uint64_t first_end = std::clamp(kSeamReach, i0, i1);
        add(i0, first_end);
        add(std::clamp(block.ni - std::min(block.ni, kSeamReach), first_end, i1), i1);
      }
    }
    return tasks;
  }

  std::span<const SplatScalar> valuesOf(const NodeSplats& splats, size_t n) const {
    return std::span(splats.values).subspan(n * variables_, variables_);
  }

  void send(Worker& worker, Send what) {
    const NodeSplats& splats = worker.splats;
    SplatSink& sink = (*sink_of_thread_)();
    bool has_faces = false;
    for (size_t n = 0; n < splats.splats.size(); ++n) {
      if (splats.splats[n].isForSeams())
        has_faces = true;
      else if (what == Send::kAll)
        sink.add(splats.splats[n], valuesOf(splats, n));
    }
    if (!has_faces) return;
    const TraceScope trace("add to seams");
    seams_->pack(splats, worker.for_seams);
    if (worker.for_seams.size() < kGatheredForSeams) return;
    seams_->add(worker.for_seams);
    worker.for_seams.clear();
  }

  const Progress* progress_;
  const std::vector<GridBlock>* blocks_;
  const size_t variables_;
  const Centring centring_;
  const AbuttingFaces* faces_;
  const SinkOfThread* sink_of_thread_;
  const SplatRules rules_;
  ScatterState before_;  // of an interrupted run
  SeamMerger* seams_;
  tbb::enumerable_thread_specific<Worker> workers_;
};

/// Packs splats and routes their records. One a thread.
class RecordSink : public SplatSink {
 public:
  explicit RecordSink(const SplatTarget& target)
      : root_(target.root),
        router_(*target.tree, *target.file),
        contents_(target.contents),
        sample_(*target.sample) {}

  void add(const NodeSplat& splat, std::span<const SplatScalar> values) override {
    if (!isOfRoot(splat.splat) || !std::ranges::all_of(values, isNumber))
      throw Error(
          "positions or values are others than when the grid was measured: something changes it while it is "
          "converted; start again when it is complete");
    const RootPosition position = root_.fromWorld(splat.splat.position);
    record_.clear();
    packRecord(splat, values, position, record_);
    router_.add(record_, position);
    sample_.add(splat.node, splat.splat.weight, values);
  }

  /// Sends what is gathered, and adds what was sent since the last call to the contents and the sample.
  void flush() {
    router_.flush();
    sample_.flush();
    for (size_t node = 0; node < contents_->size(); ++node)
      (*contents_)[node].add(std::exchange(router_.contents()[node], {}));
  }

 private:
  /// Whether a splat can be one of the grid that was measured. Fits may move it beyond the nodes, and their axes
  /// reach further, but not by several times the grid. Weights have no such limit: cells may lie on one another.
  bool isOfRoot(const Splat& splat) const {
    const double reach = kReachOfRoot * root_.size;
    bool is_of_root = splat.weight >= 0 && splat.weight <= std::numeric_limits<float>::max();
    for (int axis = 0; axis < 3; ++axis)
      is_of_root &= std::abs(splat.position[axis] - root_.min[axis]) <= reach && splat.axis[axis] <= reach &&
                    !std::isnan(splat.shear[axis]);
    return is_of_root;
  }
  /// Slopes and variances beyond a float's range become its largest.
  static bool isNumber(const SplatScalar& value) {
    return std::isfinite(value.mean) && !glm::any(glm::isnan(value.slope)) && !std::isnan(value.variance);
  }

  static constexpr double kReachOfRoot = 8;
  const RootCube root_;
  RecordRouter router_;
  std::vector<CellContents>* contents_;
  ValueSample::Adder sample_;
  std::vector<std::byte> record_;
};

/// The sinks of all threads.
class RecordSinks {
 public:
  explicit RecordSinks(const SplatTarget& target)
      : sinks_([&target] { return RecordSink(target); }),
        of_thread_([this]() -> SplatSink& { return sinks_.local(); }) {}

  const SinkOfThread& ofThread() const { return of_thread_; }
  /// To be called at the end, and at any time when no thread adds to its sink.
  void flush() {
    for (RecordSink& sink : sinks_) sink.flush();
  }

 private:
  tbb::enumerable_thread_specific<RecordSink> sinks_;
  const SinkOfThread of_thread_;
};

}  // namespace

void RecordRouter::add(std::span<const std::byte> record, const RootPosition& position) {
  const bool same_leaf = leaf_ != BucketTree::kNone && (*tree_)[leaf_].cell.contains(position);
  if (!same_leaf || gathered_.size() + record.size() > kGatheredBytes) {
    flush();
    if (!same_leaf) leaf_ = tree_->leafOf(position);
  }
  contents_[leaf_].add(position);
  gathered_.insert(gathered_.end(), record.begin(), record.end());
}

void RecordRouter::flush() {
  if (gathered_.empty()) return;
  file_->append((*tree_)[leaf_].bucket, gathered_);
  gathered_.clear();
}

ScatterCounts streamSplats(const NodeReader& reader, const AbuttingFaces* faces, uint64_t slab_bytes,
                           const SinkOfThread& sink_of_thread, SeamMerger& seams, const SlabPass& pass) {
  SplatStream splats(reader, faces, sink_of_thread, seams, pass);
  SlabShare share = shareOf(*pass.ranks);
  share.whole_rows = pass.see != nullptr;  // a checksum of the grid needs them
  const bool cells = reader.centring() == Centring::kCell;
  if (pass.notes.from) slab_bytes = pass.notes.from->slab_bytes;
  const uint64_t sent = pass.notes.from ? pass.notes.from->slabs : 0;
  SlabStream slabs(reader, slab_bytes, cells ? kCellSplatHalo : kNodeSplatHalo, share);
  std::vector<uint64_t> covered;
  for (uint64_t n = 0; const LoadedSlab* loaded = slabs.next(); ++n) {
    if (pass.see) {
      const TraceScope trace("see slab");
      pass.see(*loaded);
    }
    if (pass.owners) pass.owners->cover(*loaded, covered);
    if (n >= sent)
      splats.add(*loaded, covered, SplatStream::Send::kAll);
    else if (!cells)  // which have no seams
      splats.add(*loaded, covered, SplatStream::Send::kSeams);
    const GridBlock& block = reader.source().description().blocks[loaded->slab.block];
    const uint64_t nodes = rowsOf(loaded->slab.box) * loaded->slab.box.rowNodes(block.ni);
    if (n < sent) {
      pass.progress.skip(nodes);
      continue;
    }
    pass.progress.advance(nodes);
    if (!pass.notes.is_due || !pass.notes.is_due()) continue;
    ScatterState state = splats.state();
    state.slab_bytes = slab_bytes;
    state.slabs = n + 1;
    pass.notes.note(state);
  }
  splats.finish();
  return splats.counts(*pass.ranks);
}

ScatterCounts scatterSplats(SplatOrigin& origin, const SplatTarget& target, const ScatterNotes& notes,
                            Progress& progress) {
  RecordSinks sinks(target);
  ScatterNotes complete = notes;
  complete.note = [&](const ScatterState& state) {
    sinks.flush();
    target.file->flush();
    notes.note(state);
  };
  const ScatterCounts counts = origin.scatter(sinks.ofThread(), complete, progress);
  sinks.flush();
  return counts;
}

uint64_t scatterRest(SplatOrigin& origin, const SplatTarget& target, Progress& progress) {
  RecordSinks sinks(target);
  const uint64_t merged = origin.finish(sinks.ofThread(), progress);
  sinks.flush();
  return merged;
}

}  // namespace curvisplat
