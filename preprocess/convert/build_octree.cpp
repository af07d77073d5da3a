#include "preprocess/convert/build_octree.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/build_cell.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/splat_record.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

// A bucket that turns out too large to be built in memory is counted and scattered again by finer cells
// (divideBucket()) or, where no cell separates its splats, read by their nodes' numbers
// (forEachRecordByNode()).

struct DividedBucket {
  std::unique_ptr<BucketFile> file;
  std::vector<uint32_t> leaves;  // of the tree, in Morton order: what the file's buckets hold
};

/// A bucket, and the leaves of the tree that have splats in it, in Morton order.
struct BucketOfLeaves {
  const BucketFile& file;
  uint32_t bucket;
  const std::vector<uint32_t>& leaves;
};

template <typename Use>
void forEachRecord(std::span<const std::byte> records, size_t variables, Use use) {
  for (size_t at = 0; at < records.size();) {
    const size_t bytes = recordBytes(&records[at], variables);
    use(records.subspan(at, bytes));
    at += bytes;
  }
}

template <typename Use>
void forEachRecordOf(const BucketFile& file, uint32_t bucket, size_t variables, Use use) {
  file.forEachChunk(bucket, [&](std::span<const std::byte> chunk) { forEachRecord(chunk, variables, use); });
}

/// Nodes' numbers, half-open.
struct NodeRange {
  uint64_t begin, end;
};

NodeRange nodesIn(const BucketFile& file, uint32_t bucket, size_t variables) {
  NodeRange range{UINT64_MAX, 0};
  forEachRecordOf(file, bucket, variables, [&](std::span<const std::byte> record) {
    const uint64_t node = recordNode(record.data());
    range = {std::min(range.begin, node), std::max(range.end, node + 1)};
  });
  return range;
}

/// The places in `records` at which each record begins.
std::vector<uint32_t> placesOfRecords(std::span<const std::byte> records, size_t variables) {
  std::vector<uint32_t> places;
  forEachRecord(records, variables, [&](std::span<const std::byte> record) {
    places.push_back(static_cast<uint32_t>(record.data() - records.data()));
  });
  return places;
}

/// Splits the leaves where they hold too many splats, and scatters the bucket's records into a new file at
/// `path`. Memory: the counting grid and chunk buffers. Throws Error if a disk fails.
DividedBucket divideBucket(const BucketOfLeaves& from, size_t variables, const MemoryPlan& plan,
                           const std::filesystem::path& path, BucketTree& tree) {
  const auto counts = makeCountingGrid(kMaxLevel, plan.counting_bytes);
  from.file.forEachChunk(from.bucket, [&](std::span<const std::byte> chunk) {
    VoxelRuns runs(counts->level());
    forEachRecord(chunk, variables,
                  [&](std::span<const std::byte> record) { runs.add(recordPosition(record.data())); });
    counts->add(runs.level(), runs.runs());
  });
  counts->close();

  DividedBucket divided;
  const size_t leaves_before = from.leaves.size();
  for (const uint32_t leaf : from.leaves) {
    const CellContents& contents = tree[leaf].contents;
    if (contents.splats > plan.plannedBucketSplats() && !contents.coincide())
      tree.split(
          leaf, [&](const Cell& cell) { return counts->count(cell); }, plan.plannedBucketSplats(),
          counts->level());
    const std::vector<uint32_t> below = tree.leavesBelow(leaf);
    divided.leaves.insert(divided.leaves.end(), below.begin(), below.end());
  }
  const auto countOf = [&](uint32_t leaf) {
    const BucketTree::Node& node = tree[leaf];
    return node.contents.splats > 0 ? node.contents.splats : counts->count(node.cell);
  };
  const uint32_t buckets =
      assignBucketsWithin(tree, divided.leaves, countOf, plan.plannedBucketSplats(), plan.most_buckets);
  CURVISPLAT_CHECK(buckets > 1 || divided.leaves.size() > leaves_before);

  divided.file = std::make_unique<BucketFile>(path, buckets, plan.chunkBytes(buckets));
  RecordRouter router(tree, *divided.file);
  forEachRecordOf(from.file, from.bucket, variables, [&](std::span<const std::byte> record) {
    router.add(record, recordPosition(record.data()));
  });
  router.flush();
  divided.file->close();
  tree.setContents(divided.leaves, router.contents());
  return divided;
}

/// Calls `use` for each record of a bucket of any size, ordered by node. Memory: one bucket and chunk
/// buffers.
void forEachRecordByNode(const BucketFile& file, uint32_t bucket, size_t variables, const MemoryPlan& plan,
                         const std::filesystem::path& temporary_folder,
                         const std::function<void(std::span<const std::byte>)>& use) {
  if (file.bytes(bucket) <= plan.bucket_bytes) {
    std::vector<std::byte> bytes;
    file.read(bucket, bytes);
    std::vector<uint32_t> places = placesOfRecords(bytes, variables);
    const RecordSpan records{bytes.data(), places};
    sortByNode(records);
    for (size_t n = 0; n < records.size(); ++n) use({records[n], recordBytes(records[n], variables)});
    return;
  }
  static std::atomic<unsigned> files_made = 0;
  const NodeRange nodes = nodesIn(file, bucket, variables);
  const uint64_t wanted = 2 * (file.bytes(bucket) / plan.bucket_bytes + 1);
  const auto parts =
      static_cast<uint32_t>(std::min<uint64_t>({wanted, plan.most_buckets, nodes.end - nodes.begin}));
  const uint64_t nodes_a_part = (nodes.end - nodes.begin + parts - 1) / parts;
  BucketFile by_node(temporary_folder / fmt::format("by_node{}.bin", files_made++), parts,
                     plan.chunkBytes(parts));
  forEachRecordOf(file, bucket, variables, [&](std::span<const std::byte> record) {
    by_node.append(static_cast<uint32_t>((recordNode(record.data()) - nodes.begin) / nodes_a_part), record);
  });
  by_node.close();
  for (uint32_t part = 0; part < parts; ++part)
    forEachRecordByNode(by_node, part, variables, plan, temporary_folder, use);
}

}  // namespace

OctreeBuilder::OctreeBuilder(const OctreePlan& plan, BucketTree& tree, CacheWriter& writer,
                             Progress& progress)
    : root_(plan.root),
      variables_(plan.codings.size()),
      codings_(plan.codings),
      plan_(plan.memory),
      tree_(&tree),
      writer_(&writer),
      temporary_folder_(plan.temporary_folder),
      progress_(&progress),
      cells_(plan.root, plan.blocks, variables_, writer.histograms(), progress, plan.codings) {}

uint32_t OctreeBuilder::takeUpBricks(uint32_t buckets) {
  matchBricks();
  return finishTakenUp(tree_->leavesBelow(0), buckets);
}

void OctreeBuilder::build(const BucketFile& file, uint32_t first) {
  buildShare(file, first, file.buckets());
}

void OctreeBuilder::buildShare(const BucketFile& file, uint32_t first, uint32_t end) {
  buildBuckets(file, tree_->leavesBelow(0), first, end);
  CURVISPLAT_CHECK_OP(carried_.size(), ==, 0u);
}

/// Number of bricks of a node that has splats and is not below the cell that is built as a whole
/// (buildUnitOf).
uint64_t OctreeBuilder::bricksOf(uint32_t node) const {
  const CellContents& contents = (*tree_)[node].contents;
  if ((*tree_)[node].cell.level < kMaxLevel && !contents.coincide()) return 1;
  return (contents.splats + kMaxBrickSplats - 1) / kMaxBrickSplats;
}

/// Notes which nodes the writer's bricks are of. Those behind the last that completes a node are of one that
/// is to be built again. The histograms become those of the bricks that stay: a build that was given up may
/// have added others.
void OctreeBuilder::matchBricks() {
  built_.resize(tree_->size());
  const std::span<const Brick> bricks = writer_->bricks();
  uint64_t complete = 0;
  for (uint64_t id = 0; id < bricks.size(); ++id) {
    const uint32_t node = tree_->nodeOf(bricks[id].cell);
    if (node == BucketTree::kNone) continue;  // of a cell below a leaf
    Built& built = built_[node];
    if (built.bricks++ == 0) built.first_brick = id;
    built.error = std::max<double>(built.error, bricks[id].error);
    if (built.bricks == bricksOf(node)) complete = id + 1;
  }
  for (Built& built : built_)
    if (built.first_brick + built.bricks > complete) built = {};
  writer_->keep(complete);
  writer_->histograms().clear();
  parallelFor(uint64_t{0}, complete, [&](uint64_t id) {
    const BrickSplats brick = writer_->readBack(id);
    const bool is_leaf = !brick.runs.empty();
    if (is_leaf) writer_->histograms().add(brick);
  });
}

/// Builds the parents that the bricks taken up lack. Returns the first bucket with more to build.
uint32_t OctreeBuilder::finishTakenUp(const std::vector<uint32_t>& leaves, uint32_t buckets) {
  uint32_t last = BucketTree::kNone;
  for (const uint32_t leaf : leaves) {
    if ((*tree_)[leaf].contents.splats == 0) continue;
    const uint32_t unit = buildUnitOf(*tree_, leaf);
    if (!isBuilt(unit)) {
      buckets = (*tree_)[leaf].bucket;
      break;
    }
    if (unit != last) progress_->skip((*tree_)[unit].contents.splats);
    last = unit;
  }
  if (last != BucketTree::kNone) completeParents(last);
  return buckets;
}

void OctreeBuilder::buildBuckets(const BucketFile& file, const std::vector<uint32_t>& leaves, uint32_t first,
                                 uint32_t end) {
  // Now, since dividing one of the buckets gives its leaves numbers in another file.
  std::vector<std::vector<uint32_t>> leaves_of(file.buckets());
  for (const uint32_t leaf : leaves)
    if ((*tree_)[leaf].contents.splats > 0) leaves_of[(*tree_)[leaf].bucket].push_back(leaf);
  for (uint32_t next = first; next < end; ++next) {
    const std::optional<uint32_t> too_large = buildLoaded(file, {next, end});
    if (!too_large) return;
    next = *too_large;
    buildTooLarge(file, next, leaves_of[next]);
  }
}

/// Builds buckets up to the first that is too large, and returns that.
std::optional<uint32_t> OctreeBuilder::buildLoaded(const BucketFile& file, const BucketRange& buckets) {
  built_.resize(tree_->size());  // now, since what asks it runs beside what appends
  BucketLoader loader(*tree_, file, variables_, buckets, plan_.bucket_bytes, plan_.bucketReaders());
  BucketBuilds builds({[&] { return loader.acquire(); }, [&] { loader.giveBack(); },
                       [&](LoadedBucket& loaded) { return jobsOf(loaded); },
                       [&](const CellJob& job) { return cells_.build((*tree_)[job.unit].cell, job.records); },
                       [&](uint32_t unit, BuiltCell&& cell) {
                         append(unit, std::move(cell));
                         completeParents(unit);
                       }});
  return builds.run();
}

BucketJobs OctreeBuilder::jobsOf(LoadedBucket& loaded) {
  BucketJobs jobs;
  for (const LoadedBucket::Part& part : loaded.parts) {
    if (isBuilt(part.unit)) continue;
    const RecordSpan records = loaded.records(part);
    const uint64_t expected = (*tree_)[part.unit].contents.splats;
    if (records.size() == expected) {
      jobs.cells.push_back({part.unit, records});
      continue;
    }
    std::vector<std::byte>& carried = carried_[part.unit];
    for (size_t n = 0; n < records.size(); ++n)
      carried.insert(carried.end(), records[n], records[n] + recordBytes(records[n], variables_));
    std::vector<uint32_t> places = placesOfRecords(carried, variables_);
    if (places.size() < expected) continue;
    jobs.carried.push_back(std::move(carried));
    jobs.carried_places.push_back(std::move(places));
    carried_.erase(part.unit);
    jobs.cells.push_back({part.unit, {jobs.carried.back().data(), jobs.carried_places.back()}});
  }
  return jobs;
}

void OctreeBuilder::buildTooLarge(const BucketFile& file, uint32_t bucket,
                                  const std::vector<uint32_t>& leaves) {
  const BucketTree::Node& first = (*tree_)[leaves.front()];
  const auto leafIsBuilt = [this](uint32_t leaf) { return isBuilt(buildUnitOf(*tree_, leaf)); };
  if (std::all_of(leaves.begin(), leaves.end(), leafIsBuilt)) return;
  if (leaves.size() == 1 && (first.cell.level == kMaxLevel || first.contents.coincide())) {
    buildCoincident(file, bucket, leaves.front());
    return;
  }
  const std::filesystem::path path = temporary_folder_ / fmt::format("divided{}.bin", files_made_++);
  const DividedBucket divided = divideBucket({file, bucket, leaves}, variables_, plan_, path, *tree_);
  buildBuckets(*divided.file, divided.leaves, 0, divided.file->buckets());
}

void OctreeBuilder::buildCoincident(const BucketFile& file, uint32_t bucket, uint32_t leaf) {
  // No division parts these splats, so they become bricks one after the other, in node order.
  std::vector<std::byte> brick;
  uint64_t in_brick = 0;
  const uint32_t unit = buildUnitOf(*tree_, leaf);
  const auto appendBrick = [&] {
    std::vector<uint32_t> places = placesOfRecords(brick, variables_);
    append(unit, cells_.build((*tree_)[unit].cell, {brick.data(), places}));
    brick.clear();
    in_brick = 0;
  };
  forEachRecordByNode(file, bucket, variables_, plan_, temporary_folder_,
                      [&](std::span<const std::byte> record) {
                        brick.insert(brick.end(), record.begin(), record.end());
                        if (++in_brick == kMaxBrickSplats) appendBrick();
                      });
  if (in_brick > 0) appendBrick();
  completeParents(unit);
}

void OctreeBuilder::append(uint32_t node, BuiltCell&& cell) {
  const TraceScope trace("append bricks");
  Built& built = built_[node];
  for (size_t n = 0; n < cell.bricks.size(); ++n) {
    const uint32_t splats = cell.bricks[n].encoded.brick.splats;
    const uint64_t id = writer_->append(std::move(cell.bricks[n].encoded), cell.bricks[n].error);
    const bool own = n + cell.own_bricks >= cell.bricks.size();
    if (own && built.bricks++ == 0) built.first_brick = id;
    if (cell.bricks[n].is_leaf) progress_->advance(splats);
  }
  built.error = std::max(built.error, cell.error);
}

bool OctreeBuilder::childrenAreBuilt(uint32_t node) const {
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const uint32_t child = (*tree_)[node].first_child + octant;
    if ((*tree_)[child].contents.splats > 0 && !isBuilt(child)) return false;
  }
  return true;
}

void OctreeBuilder::completeParents(uint32_t node) {
  for (uint32_t parent = (*tree_)[node].parent; parent != BucketTree::kNone;
       parent = (*tree_)[parent].parent) {
    if (!childrenAreBuilt(parent)) return;
    if (!isBuilt(parent)) buildParent(parent);
  }
}

void OctreeBuilder::buildParent(uint32_t node) {
  const uint32_t first_child = (*tree_)[node].first_child;
  std::array<ChildBricks, 8> children;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const Built& built = built_[first_child + octant];
    children[octant] = {(*tree_)[first_child + octant].cell,
                        (*tree_)[first_child + octant].contents.splats > 0 ? built.bricks : 0, built.error,
                        [this, &built](uint64_t n) { return writer_->readBack(built.first_brick + n); }};
  }
  append(node, buildFromChildren(root_, codings_, (*tree_)[node].cell, children));
}

}  // namespace curvisplat
