#include "preprocess/scatter.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>

#include "preprocess/slabs.h"
#include "preprocess/splat_record.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNodesPerTask = 4096;
constexpr size_t kGatheredBytes = 32 << 10;

void addContents(std::vector<CellContents>& to, const std::vector<CellContents>& from) {
  for (size_t node = 0; node < to.size(); ++node) to[node].add(from[node]);
}

struct Handedness {
  uint64_t right = 0, left = 0;
};

/// What a thread has for itself.
struct Worker {
  RecordRouter router;
  NodeSplats splats;
  std::vector<std::byte> record;
  uint64_t degenerate = 0;
  std::vector<Handedness> handedness;  // [block]
};

class Scatter {
 public:
  Scatter(const NodeReader& reader, const RootCube& root, const BucketTree& tree, BucketFile& file,
          SeamMerger& seams, const Progress& progress)
      : progress_(&progress),
        blocks_(&reader.source().description().blocks),
        variables_(reader.scalars()),
        root_(root),
        seams_(&seams),
        workers_([this, &tree, &file] {
          return Worker{RecordRouter(tree, file), {}, {}, 0, std::vector<Handedness>(blocks_->size())};
        }) {}

  void scatter(const LoadedSlab& loaded) {
    const Slab& slab = loaded.slab;
    const GridBlock& block = (*blocks_)[slab.block];
    const BlockWindow window{block, slab.first_node, slab.window, &loaded.nodes};
    const std::vector<NodeBox> tasks = cutForTasks(block, slab.box, kNodesPerTask);
    tbb::parallel_for(size_t{0}, tasks.size(), [&](size_t task) {
      progress_->throwIfStopped();
      Worker& worker = workers_.local();
      computeNodeSplats(window, tasks[task], worker.splats);
      worker.degenerate += worker.splats.degenerate;
      worker.handedness[slab.block].right += worker.splats.right_handed;
      worker.handedness[slab.block].left += worker.splats.left_handed;
      route(worker);
    });
  }

  ScatterCounts finish(std::vector<CellContents>& contents) {
    ScatterCounts counts;
    std::vector<Handedness> of_blocks(blocks_->size());
    for (Worker& worker : workers_) {
      worker.router.flush();
      addContents(contents, worker.router.contents());
      counts.degenerate += worker.degenerate;
      for (size_t block = 0; block < of_blocks.size(); ++block) {
        of_blocks[block].right += worker.handedness[block].right;
        of_blocks[block].left += worker.handedness[block].left;
      }
    }
    for (const Handedness& of_block : of_blocks) counts.inverted += std::min(of_block.right, of_block.left);
    return counts;
  }

 private:
  std::span<const SplatScalar> valuesOf(const NodeSplats& splats, size_t n) const {
    return std::span(splats.values).subspan(n * variables_, variables_);
  }

  void route(Worker& worker) {
    const NodeSplats& splats = worker.splats;
    bool has_faces = false;
    for (size_t n = 0; n < splats.splats.size(); ++n) {
      const NodeSplat& splat = splats.splats[n];
      if (splat.on_block_face) {
        has_faces = true;
        continue;
      }
      const RootPosition position = root_.fromWorld(splat.splat.position);
      worker.record.clear();
      packRecord(splat, valuesOf(splats, n), position, worker.record);
      worker.router.add(worker.record, position);
    }
    if (!has_faces) return;
    const std::lock_guard lock(adding_to_seams_);
    for (size_t n = 0; n < splats.splats.size(); ++n)
      if (splats.splats[n].on_block_face) seams_->add(splats.splats[n], valuesOf(splats, n));
  }

  const Progress* progress_;
  const std::vector<GridBlock>* blocks_;
  const size_t variables_;
  const RootCube root_;
  std::mutex adding_to_seams_;  // guards *seams_
  SeamMerger* seams_;
  tbb::enumerable_thread_specific<Worker> workers_;
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

ScatterCounts scatterSplats(const NodeReader& reader, const RootCube& root, uint64_t slab_bytes,
                            const BucketTree& tree, BucketFile& file, std::vector<CellContents>& contents,
                            SeamMerger& seams, Progress& progress) {
  Scatter scatter(reader, root, tree, file, seams, progress);
  SlabStream slabs(reader, slab_bytes, true);
  while (const LoadedSlab* loaded = slabs.next()) {
    scatter.scatter(*loaded);
    const GridBlock& block = reader.source().description().blocks[loaded->slab.block];
    progress.advance(rowsOf(loaded->slab.box) * block.ni);
  }
  return scatter.finish(contents);
}

uint64_t scatterSeams(SeamMerger& seams, int coordinate_bytes, const RootCube& root, const BucketTree& tree,
                      BucketFile& file, std::vector<CellContents>& contents, Progress& progress) {
  RecordRouter router(tree, file);
  std::vector<std::byte> record;
  const uint64_t merged =
      seams.finish(coordinate_bytes, [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
        const RootPosition position = root.fromWorld(splat.splat.position);
        record.clear();
        packRecord(splat, values, position, record);
        router.add(record, position);
        progress.advance(1);
      });
  router.flush();
  addContents(contents, router.contents());
  return merged;
}

}  // namespace curvisplat
