#include "preprocess/convert/shared_passes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <utility>

#include "preprocess/convert/build_cell.h"
#include "preprocess/splats/cell_splats.h"
#include "preprocess/splats/node_splats.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {
namespace {

/// Everything as 64 bits: six whole numbers, two a scalar that loses values, six of the box, two a scalar.
Ranks::Bytes pack(const GridSurvey& survey) {
  std::vector<uint64_t> words{
      survey.nodes,         survey.blanked.by_grid,    survey.blanked.by_value, survey.blanked.not_finite,
      survey.grid_checksum, survey.blanked.lost.size()};
  for (const BlankCounts::Lost& lost : survey.blanked.lost)
    words.insert(words.end(), {lost.samples, lost.set});
  const auto put = [&](double number) { words.push_back(std::bit_cast<uint64_t>(number)); };
  for (int axis = 0; axis < 3; ++axis) put(survey.lower[axis]);
  for (int axis = 0; axis < 3; ++axis) put(survey.upper[axis]);
  for (const ScalarRange& range : survey.ranges) {
    put(range.min);
    put(range.max);
  }
  return toBytes(words);
}

GridSurvey unpackSurvey(const Ranks::Bytes& bytes) {
  const auto words = fromBytes<uint64_t>(bytes);
  size_t at = 6;
  const auto get = [&] { return std::bit_cast<double>(words[at++]); };
  GridSurvey survey;
  survey.nodes = words[0];
  survey.blanked = {words[1], words[2], words[3], {}};
  for (uint64_t scalar = 0; scalar < words[5]; ++scalar, at += 2)
    survey.blanked.lost.push_back({words[at], words[at + 1]});
  survey.grid_checksum = words[4];
  for (int axis = 0; axis < 3; ++axis) survey.lower[axis] = get();
  for (int axis = 0; axis < 3; ++axis) survey.upper[axis] = get();
  while (at < words.size()) {
    const double min = get();
    survey.ranges.push_back({min, get()});
  }
  return survey;
}

}  // namespace

uint64_t slabBytesOfRanks(const NodeReader& reader, uint64_t slab_bytes, const Ranks& ranks) {
  constexpr uint64_t kSlabsOfRank = 8;
  if (ranks.alone()) return slab_bytes;
  const std::vector<GridBlock>& blocks = reader.source().description().blocks;
  uint64_t nodes = 0;
  for (const GridBlock& block : blocks) nodes += block.nodes();
  const uint64_t share = nodes * slabBytesPerNode(reader.scalars()) / (kSlabsOfRank * ranks.count());
  const Halo halo = reader.centring() == Centring::kCell ? kCellSplatHalo : kNodeSplatHalo;
  return std::min(slab_bytes, std::max(share, leastSlabBytes(blocks, reader.scalars(), halo)));
}

MemoryPlan commonPlan(MemoryPlan plan, Ranks& ranks) {
  const std::vector<MemoryPlan> own{plan};
  Ranks::Bytes plans;
  for (const Ranks::Bytes& one : ranks.gather(toBytes(own)))
    plans.insert(plans.end(), one.begin(), one.end());
  for (const MemoryPlan& other : fromBytes<MemoryPlan>(ranks.broadcast(std::move(plans)))) {
    for (auto bytes : {&MemoryPlan::slab_bytes, &MemoryPlan::counting_bytes, &MemoryPlan::seam_bytes,
                       &MemoryPlan::owner_bytes, &MemoryPlan::mesh_bytes, &MemoryPlan::chunk_buffer_bytes,
                       &MemoryPlan::bucket_splats, &MemoryPlan::bucket_bytes})
      plan.*bytes = std::min(plan.*bytes, other.*bytes);
    plan.most_buckets = std::min(plan.most_buckets, other.most_buckets);
  }
  return plan;
}

GridSurvey combinedSurvey(const GridSurvey& share, Ranks& ranks) {
  GridSurvey whole = share;
  const std::vector<Ranks::Bytes> shares = ranks.gather(pack(share));
  for (size_t n = 1; n < shares.size(); ++n) whole = unitedSurvey(std::move(whole), unpackSurvey(shares[n]));
  return broadcastSurvey(whole, ranks);
}

GridSurvey broadcastSurvey(const GridSurvey& survey, Ranks& ranks) {
  return unpackSurvey(ranks.broadcast(pack(survey)));
}

void sendCountsToFirst(CountingGrid& counts, Ranks& ranks) {
  for (unsigned sender = 1; sender < ranks.count(); ++sender) {
    const bool sends = sender == ranks.rank();
    const std::vector<uint32_t> level{counts.level()};
    const std::vector<Ranks::Bytes> levels = ranks.gather(toBytes(level));
    const std::vector<Ranks::Bytes> runs = ranks.gather(sends ? toBytes(counts.takeRuns()) : Ranks::Bytes{});
    if (ranks.isFirst())
      counts.addCoarser(fromBytes<uint32_t>(levels[sender])[0], fromBytes<VoxelRun>(runs[sender]));
  }
}

BucketTree broadcastTree(const BucketTree& tree, Ranks& ranks) {
  return BucketTree::fromLinks(fromBytes<BucketTree::Link>(ranks.broadcast(toBytes(tree.links()))));
}

void sumContents(std::vector<CellContents>& contents, Ranks& ranks) {
  const std::vector<Ranks::Bytes> shares = ranks.gather(toBytes(contents));
  for (size_t n = 1; n < shares.size(); ++n) {
    const auto share = fromBytes<CellContents>(shares[n]);
    for (size_t node = 0; node < contents.size(); ++node) contents[node].add(share[node]);
  }
  contents = fromBytes<CellContents>(ranks.broadcast(toBytes(contents)));
}

std::vector<BucketChains> gatherChains(const BucketChains& chains, Ranks& ranks) {
  std::vector<uint64_t> words{chains.chunk_bytes, chains.size};
  for (const BucketChains::OfBucket& bucket : chains.chains) {
    words.insert(words.end(), bucket.last_chunks.begin(), bucket.last_chunks.end());
    words.push_back(bucket.bytes);
  }
  const std::vector<Ranks::Bytes> sent = ranks.gather(toBytes(words));
  std::vector<BucketChains> of_ranks;
  for (size_t n = 1; n < sent.size(); ++n) {
    const auto from = fromBytes<uint64_t>(sent[n]);
    BucketChains& one = of_ranks.emplace_back();
    one.chunk_bytes = from[0];
    one.size = from[1];
    for (size_t at = 2; at < from.size(); at += BucketChains::kCount + 1) {
      BucketChains::OfBucket& bucket = one.chains.emplace_back();
      std::copy_n(&from[at], BucketChains::kCount, bucket.last_chunks.begin());
      bucket.bytes = from[at + BucketChains::kCount];
    }
  }
  return of_ranks;
}

namespace {

namespace fs = std::filesystem;

/// The files of a cache that is being written, to read from.
class BrickFiles {
 public:
  BrickFiles(const fs::path& folder, const std::vector<VariableInfo>& variables)
      : geometry_(folder / "geometry.bin") {
    for (const VariableInfo& variable : variables) values_.emplace_back(folder / variableFileName(variable));
  }

  std::vector<std::byte> geometry(const AppendedBrick& brick) const {
    return read(geometry_, brick.brick.geometry);
  }
  std::vector<std::byte> values(const AppendedBrick& brick, size_t variable) const {
    return read(values_[variable], brick.variables[variable].values);
  }
  BrickSplats splats(const RootCube& root, const AppendedBrick& brick) const {
    std::vector<std::vector<std::byte>> values_of;
    for (size_t v = 0; v < values_.size(); ++v) values_of.push_back(values(brick, v));
    return decodeForMerging(root, brick.brick, geometry(brick), brick.variables, values_of);
  }

 private:
  static std::vector<std::byte> read(const InputFile& file, const Extent& extent) {
    std::vector<std::byte> bytes(extent.length);
    file.readAt(extent.offset, std::span(bytes));
    return bytes;
  }

  InputFile geometry_;
  std::vector<InputFile> values_;
};

/// The part that a rank has built, as rank 0 sees it.
struct Part {
  BrickFiles files;
  std::vector<AppendedBrick> bricks;  // [as appended]
};

/// A brick of a part.
struct BrickId {
  uint32_t rank = 0, brick = 0;
};

fs::path folderOfBricks(const fs::path& scratch, unsigned rank) {
  fs::path folder = bricksOfRank(scratch, rank);
  folder += ".partial";
  return folder;
}

/// Whether `a` comes before `b` in post-order: what lies below a cell comes before it.
bool comesBefore(const Cell& a, const Cell& b) {
  const auto last_deepest = [](const Cell& cell) {
    Cell deepest{static_cast<uint32_t>(kMaxLevel), {}};
    for (int axis = 0; axis < 3; ++axis)
      deepest.at[axis] = ((cell.at[axis] + 1) << (kMaxLevel - cell.level)) - 1;
    return deepest;
  };
  const Cell last_of_a = last_deepest(a), last_of_b = last_deepest(b);
  if (!(last_of_a == last_of_b)) return mortonLess(last_of_a, last_of_b);
  return a.level > b.level;
}

/// Rank 0's work: merges what spans ranks.
class Joiner {
 public:
  Joiner(const SharedBuild& build, CacheWriter& own, std::vector<Part> parts)
      : build_(build), own_(own), parts_(std::move(parts)), built_(build.tree.size()) {
    for (uint32_t rank = 0; rank < parts_.size(); ++rank)
      for (uint32_t id = 0; id < parts_[rank].bricks.size(); ++id) note({rank, id});
  }

  void mergeSpanningCells() {
    const BucketTree& tree = build_.tree;
    // Children have higher numbers than their parent.
    for (auto node = static_cast<uint32_t>(tree.size()); node-- > 0;) {
      if (tree[node].isLeaf() || tree[node].contents.splats == 0 || built_[node].bricks > 0) continue;
      std::array<ChildBricks, 8> children;
      bool complete = true;
      for (uint32_t octant = 0; octant < 8; ++octant) {
        const uint32_t child = tree[node].first_child + octant;
        const Built& built = built_[child];
        complete &= tree[child].contents.splats == 0 || built.bricks > 0;
        children[octant] = {tree[child].cell, built.bricks, built.error, [this, &built](uint64_t n) {
                              const Part& part = parts_[built.first.rank];
                              return part.files.splats(build_.root, part.bricks[built.first.brick + n]);
                            }};
      }
      if (!complete) continue;  // in a cell that is built as a whole
      BuiltCell cell = buildFromChildren(build_.root, build_.codings, tree[node].cell, children);
      const uint64_t id = own_.append(std::move(cell.bricks[0].encoded), cell.bricks[0].error);
      CURVISPLAT_CHECK_OP(id, ==, parts_[0].bricks.size());
      parts_[0].bricks.push_back(own_.appended(id));
      note({0, static_cast<uint32_t>(id)});
    }
  }

  std::vector<BrickId> inPostOrder() const {
    std::vector<BrickId> order;
    for (uint32_t rank = 0; rank < parts_.size(); ++rank)
      for (uint32_t id = 0; id < parts_[rank].bricks.size(); ++id) order.push_back({rank, id});
    std::stable_sort(order.begin(), order.end(), [this](const BrickId& a, const BrickId& b) {
      return comesBefore((*this)[a].brick.cell, (*this)[b].brick.cell);
    });
    return order;
  }

  const AppendedBrick& operator[](const BrickId& id) const { return parts_[id.rank].bricks[id.brick]; }
  const std::vector<Part>& parts() const { return parts_; }

 private:
  struct Built {
    BrickId first;
    uint64_t bricks = 0;
    double error = 0;
  };

  void note(const BrickId& id) {
    const Brick& brick = (*this)[id].brick;
    const uint32_t node = build_.tree.nodeOf(brick.cell);
    if (node == BucketTree::kNone) return;  // of a cell below a leaf
    Built& built = built_[node];
    if (built.bricks++ == 0) built.first = id;
    built.error = std::max<double>(built.error, brick.error);
  }

  const SharedBuild& build_;
  CacheWriter& own_;
  std::vector<Part> parts_;
  std::vector<Built> built_;  // [node of the tree]
};

/// The parts of all ranks, `counts` [rank] bricks each.
std::vector<Part> partsOf(const SharedBuild& build, const CacheWriter& own,
                          const std::vector<uint64_t>& counts) {
  std::vector<Part> parts;
  for (unsigned rank = 0; rank < counts.size(); ++rank) {
    const fs::path folder = folderOfBricks(build.scratch, rank);
    std::vector<AppendedBrick> bricks;
    if (rank == 0)
      for (uint64_t id = 0; id < own.bricks().size(); ++id) bricks.push_back(own.appended(id));
    else
      bricks = readBrickLog(folder, build.variables.size());
    if (bricks.size() != counts[rank])
      throw Error(
          "{}: only {} of the {} bricks that rank {} has written can be seen here; the ranks need a file "
          "system that they share",
          folder.string(), bricks.size(), counts[rank], rank);
    parts.push_back({BrickFiles(folder, build.variables), std::move(bricks)});
  }
  return parts;
}

/// Copies a rank's streams to their places. `offsets`: of each brick, geometry and then each variable.
void copyStreams(const SharedBuild& build, const std::vector<AppendedBrick>& bricks,
                 const std::vector<uint64_t>& offsets, unsigned rank) {
  const BrickFiles from(folderOfBricks(build.scratch, rank), build.variables);
  const auto open = [&](const std::string& name) {
    return OutputFile(build.partial / name, Caching::kPages, OutputFile::Existing::kKeep);
  };
  OutputFile geometry = open("geometry.bin");
  std::vector<OutputFile> values;
  for (const VariableInfo& variable : build.variables) values.push_back(open(variableFileName(variable)));
  size_t at = 0;
  for (const AppendedBrick& brick : bricks) {
    geometry.writeAt(offsets[at++], from.geometry(brick));
    for (size_t v = 0; v < values.size(); ++v) values[v].writeAt(offsets[at++], from.values(brick, v));
  }
  CURVISPLAT_CHECK_OP(at, ==, offsets.size());
  geometry.close();
  for (OutputFile& file : values) file.close();
}

}  // namespace

std::vector<BucketRange> dealBuckets(const BucketTree& tree, uint32_t buckets, unsigned ranks) {
  std::vector<uint64_t> splats(buckets);
  std::vector<uint8_t> may_begin(buckets, 1);
  uint64_t total = 0;
  uint32_t before = BucketTree::kNone;  // the leaf before that has splats
  for (const uint32_t leaf : tree.leavesBelow(0)) {
    if (tree[leaf].contents.splats == 0) continue;
    const uint32_t bucket = tree[leaf].bucket;
    splats[bucket] += tree[leaf].contents.splats;
    total += tree[leaf].contents.splats;
    if (before != BucketTree::kNone && tree[before].bucket != bucket &&
        buildUnitOf(tree, before) == buildUnitOf(tree, leaf))
      for (uint32_t n = tree[before].bucket + 1; n <= bucket; ++n) may_begin[n] = 0;
    before = leaf;
  }
  std::vector<BucketRange> ranges(ranks, {buckets, buckets});
  ranges[0].first = 0;
  uint64_t sum = 0;
  unsigned rank = 0;
  for (uint32_t bucket = 0; bucket < buckets; ++bucket) {
    // The range ends where that is nearer to its share than behind the bucket.
    const double share = static_cast<double>(total) * (rank + 1) / ranks;
    if (rank + 1 < ranks && bucket > ranges[rank].first && may_begin[bucket] != 0 &&
        static_cast<double>(sum) + 0.5 * static_cast<double>(splats[bucket]) >= share) {
      ranges[rank].end = bucket;
      ranges[++rank].first = bucket;
    }
    sum += splats[bucket];
  }
  return ranges;
}

fs::path bricksOfRank(const fs::path& scratch, unsigned rank) {
  return scratch / fmt::format("rank{}.splats", rank);
}

void joinBricks(const SharedBuild& build, CacheWriter& own, CacheWriter* whole, Ranks& ranks) {
  if (!ranks.isFirst()) own.closeStreams();
  std::vector<uint64_t> counts(ranks.count());
  counts[ranks.rank()] = own.bricks().size();
  ranks.sum(std::span<uint64_t>(counts));
  std::vector<uint64_t> histograms = own.histograms().words();
  ranks.sum(std::span<uint64_t>(histograms));
  if (whole) whole->histograms().setWords(histograms);

  std::vector<Ranks::Bytes> offsets(ranks.count());
  if (whole) {
    Joiner joiner(build, own, partsOf(build, own, counts));
    joiner.mergeSpanningCells();
    const std::vector<BrickId> order = joiner.inPostOrder();
    std::vector<AppendedBrick> bricks;
    for (const BrickId& id : order) bricks.push_back(joiner[id]);
    whole->reserve(bricks);
    const size_t of_brick = 1 + build.variables.size();
    std::vector<std::vector<uint64_t>> places;
    for (const Part& part : joiner.parts()) places.emplace_back(part.bricks.size() * of_brick);
    for (size_t n = 0; n < order.size(); ++n) {
      uint64_t* const place = &places[order[n].rank][order[n].brick * of_brick];
      place[0] = bricks[n].brick.geometry.offset;
      for (size_t v = 0; v < build.variables.size(); ++v) place[1 + v] = bricks[n].variables[v].values.offset;
    }
    for (size_t rank = 0; rank < places.size(); ++rank) offsets[rank] = toBytes(places[rank]);
  }
  const std::vector<Ranks::Bytes> sent = ranks.exchange(std::move(offsets));
  std::vector<AppendedBrick> bricks;
  for (uint64_t id = 0; id < own.bricks().size(); ++id) bricks.push_back(own.appended(id));
  copyStreams(build, bricks, fromBytes<uint64_t>(sent[0]), ranks.rank());
  ranks.barrier();
}

}  // namespace curvisplat
