// The pass that makes splats and sends each to the bucket of the cell that it lies in. It reads the nodes of
// a structured grid once more, with a halo; those of block faces go through the seam merger first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/convert/value_sample.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/overset/block_owners.h"
#include "preprocess/seams/seams.h"
#include "preprocess/splats/node_splats.h"
#include "stream/base/progress.h"
#include "stream/base/ranks.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// Sends records to their buckets and keeps account of the leaves' contents. One a thread; the tree and the
/// file are shared.
class RecordRouter {
 public:
  RecordRouter(const BucketTree& tree, BucketFile& file)
      : tree_(&tree), file_(&file), contents_(tree.size()) {}

  void add(std::span<const std::byte> record, const RootPosition& position);
  /// Sends the records that are gathered. Call it at the end.
  void flush();
  /// [node of the tree]: what went to each leaf.
  std::vector<CellContents>& contents() { return contents_; }

 private:
  const BucketTree* tree_;
  BucketFile* file_;
  std::vector<CellContents> contents_;
  uint32_t leaf_ = BucketTree::kNone;
  std::vector<std::byte> gathered_;  // for the leaf's bucket
};

/// The receivers of a pass over a grid's slabs.
struct SlabPass {
  SlabPass(Progress& of_pass) : progress(of_pass) {}  // implicit: most passes report nothing else
  SlabPass(Progress& of_pass, std::function<void(const LoadedSlab&)> of_slab)
      : progress(of_pass), see(std::move(of_slab)) {}

  Progress& progress;
  std::function<void(const LoadedSlab&)>
      see;                        // each slab, in order, before its splats are made; may be empty
  BlockOwners* owners = nullptr;  // of overlapping blocks; null: all of them are drawn
  Ranks* ranks = &oneRank();      // each makes the splats of its share; the counts are of all
  ScatterNotes notes;             // of a scatter() without ranks
  SplatRules rules;
};

/// Makes all splats, of nodes or of cells as the reader's scalars are, in parallel. Those of block faces go
/// to `seams`, the others to what `sink_of_thread` gives: a sink of the calling thread's own, always the same
/// one. Cells end at borders as computeCellSplats() finds them with `faces`, which may be null.
ScatterCounts streamSplats(const NodeReader& reader, const AbuttingFaces* faces, uint64_t slab_bytes,
                           const SinkOfThread& sink_of_thread, SeamMerger& seams, const SlabPass& pass);

/// The octree and the buckets that splats are routed to.
struct SplatTarget {
  RootCube root;
  const BucketTree* tree = nullptr;
  BucketFile* file = nullptr;
  std::vector<CellContents>* contents = nullptr;  // [node of the tree]: what was routed is added
  ValueSample* sample = nullptr;                  // what was routed is added
};

/// Routes all splats that the origin makes in scatter(). Whenever the origin notes its progress, all splats
/// made so far are in the file, and in the target's contents and sample.
ScatterCounts scatterSplats(SplatOrigin& origin, const SplatTarget& target, const ScatterNotes& notes,
                            Progress& progress);

/// Routes those that the origin makes in finish(). Returns how many samples were merged into another one.
uint64_t scatterRest(SplatOrigin& origin, const SplatTarget& target, Progress& progress);

}  // namespace curvisplat
