#include "preprocess/convert/scatter.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "preprocess/convert/shared_passes.h"
#include "preprocess/convert/splat_record.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/cell_splats.h"
#include "stream/base/mutex.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNodesPerTask = 1024;        // their splats stay in a core's cache until they are sent
constexpr uint64_t kNodesOfRowPerTask = 16384;  // longer rows are cut
constexpr size_t kGatheredBytes = 32 << 10;

struct Handedness {
  uint64_t right = 0, left = 0;
};

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
        seams_(&seams),
        workers_([this] {
          return Worker{{}, {}, {}, 0, std::vector<Handedness>(blocks_->size())};
        }) {
    corrections_.octants = pass.octants;
    corrections_.growth_codes = !pass.values_alone;
  }

  /// `covered`: of the slab, as BlockOwners::cover() sets it.
  void add(const LoadedSlab& loaded, std::span<const uint64_t> covered) {
    const Slab& slab = loaded.slab;
    const GridBlock& block = (*blocks_)[slab.block];
    const uint64_t row_nodes = slab.box.rowNodes(block.ni);
    const std::vector<NodeBox> boxes = cutForTasks(row_nodes, slab.box, kNodesPerTask);
    const uint64_t parts = (row_nodes + kNodesOfRowPerTask - 1) / kNodesOfRowPerTask;
    tbb::parallel_for(size_t{0}, boxes.size() * parts, [&](size_t task) {
      progress_->throwIfStopped();
      const TraceScope trace("make splats");
      const uint64_t i0 = slab.box.i0 + task % parts * kNodesOfRowPerTask;
      const uint64_t i1 = std::min(i0 + kNodesOfRowPerTask, slab.box.i1);
      const NodeBox& box = boxes[task / parts];
      BlockWindow window{block, slab.first_node, slab.window, &loaded.nodes, i0, i1};
      if (!covered.empty()) window.covered = covered.data();
      Worker& worker = workers_.local();
      if (centring_ == Centring::kCell)
        computeCellSplats(window, box, {slab.block, faces_}, worker.cells, worker.splats);
      else
        computeNodeSplats(window, box, worker.nodes, worker.splats, corrections_);
      worker.degenerate += worker.splats.degenerate;
      worker.handedness[slab.block].right += worker.splats.right_handed;
      worker.handedness[slab.block].left += worker.splats.left_handed;
      send(worker.splats);
    });
  }

  /// All ranks have to call it.
  ScatterCounts counts(Ranks* ranks) const {
    ScatterCounts counts;
    std::vector<Handedness> of_blocks(blocks_->size());
    for (const Worker& worker : workers_) {
      counts.degenerate += worker.degenerate;
      for (size_t block = 0; block < of_blocks.size(); ++block) {
        of_blocks[block].right += worker.handedness[block].right;
        of_blocks[block].left += worker.handedness[block].left;
      }
    }
    if (ranks) {
      static_assert(sizeof(Handedness) == 2 * sizeof(uint64_t));
      ranks->sum(std::span(&counts.degenerate, 1));
      ranks->sum(std::span(&of_blocks.front().right, 2 * of_blocks.size()));
    }
    for (const Handedness& of_block : of_blocks) counts.inverted += std::min(of_block.right, of_block.left);
    return counts;
  }

 private:
  /// What a thread has for itself.
  struct Worker {
    NodeSplats splats;
    NodeScratch nodes;
    CellScratch cells;
    uint64_t degenerate = 0;
    std::vector<Handedness> handedness;  // [block]
  };

  std::span<const SplatScalar> valuesOf(const NodeSplats& splats, size_t n) const {
    return std::span(splats.values).subspan(n * variables_, variables_);
  }

  void send(const NodeSplats& splats) {
    SplatSink& sink = (*sink_of_thread_)();
    bool has_faces = false;
    for (size_t n = 0; n < splats.splats.size(); ++n) {
      if (splats.splats[n].isForSeams())
        has_faces = true;
      else
        sink.add(splats.splats[n], valuesOf(splats, n));
    }
    if (!has_faces) return;
    const TraceScope trace("add to seams");
    const MutexLock lock(adding_to_seams_);
    seams_->add(splats, variables_);
  }

  const Progress* progress_;
  const std::vector<GridBlock>* blocks_;
  const size_t variables_;
  const Centring centring_;
  const AbuttingFaces* faces_;
  const SinkOfThread* sink_of_thread_;
  NodeSplatCorrections corrections_;
  Mutex adding_to_seams_;
  SeamMerger* seams_ PT_GUARDED_BY(adding_to_seams_);
  tbb::enumerable_thread_specific<Worker> workers_;
};

/// Packs splats and routes their records. One a thread.
class RecordSink : public SplatSink {
 public:
  explicit RecordSink(const SplatTarget& target)
      : root_(target.root), router_(*target.tree, *target.file), contents_(target.contents) {}

  void add(const NodeSplat& splat, std::span<const SplatScalar> values) override {
    const RootPosition position = root_.fromWorld(splat.splat.position);
    record_.clear();
    packRecord(splat, values, position, record_);
    router_.add(record_, position);
  }

  /// Sends what is gathered, and adds what was sent to the contents.
  void finish() {
    router_.flush();
    for (size_t node = 0; node < contents_->size(); ++node) (*contents_)[node].add(router_.contents()[node]);
  }

 private:
  const RootCube root_;
  RecordRouter router_;
  std::vector<CellContents>* contents_;
  std::vector<std::byte> record_;
};

/// What `run` returns, which gets the sinks.
template <typename Run>
auto withSinks(const SplatTarget& target, const Run& run) {
  tbb::enumerable_thread_specific<RecordSink> sinks([&] { return RecordSink(target); });
  const auto result = run([&]() -> SplatSink& { return sinks.local(); });
  for (RecordSink& sink : sinks) sink.finish();
  return result;
}

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
  SlabShare share = shareOf(pass.ranks);
  share.whole_rows = pass.see != nullptr;  // a checksum of the grid needs them
  SlabStream slabs(reader, slab_bytes, reader.centring() == Centring::kCell ? kCellSplatHalo : kNodeSplatHalo,
                   share);
  std::vector<uint64_t> covered;
  while (const LoadedSlab* loaded = slabs.next()) {
    if (pass.see) {
      const TraceScope trace("see slab");
      pass.see(*loaded);
    }
    if (pass.owners) pass.owners->cover(*loaded, covered);
    splats.add(*loaded, covered);
    const GridBlock& block = reader.source().description().blocks[loaded->slab.block];
    pass.progress.advance(rowsOf(loaded->slab.box) * loaded->slab.box.rowNodes(block.ni));
  }
  return splats.counts(pass.ranks);
}

ScatterCounts scatterSplats(SplatOrigin& origin, const SplatTarget& target, Progress& progress) {
  return withSinks(target, [&](const SinkOfThread& sinks) { return origin.scatter(sinks, progress); });
}

uint64_t scatterRest(SplatOrigin& origin, const SplatTarget& target, Progress& progress) {
  return withSinks(target, [&](const SinkOfThread& sinks) { return origin.finish(sinks, progress); });
}

}  // namespace curvisplat
